//! What handles stand for: scenes, models, moving cloths and their snapshots.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use selvedge::machine::Machine;
use selvedge::{Correction, Error, Model, Network, Run, Scene, Snapshot, Stepper};

use crate::fault::Fault;
use crate::listener::Progress;
use crate::registry::{Kind, Registry};
use crate::status::SelvedgeStatus;

/// Scenes by their handles.
pub(crate) static SCENES: Registry<Scene> = Registry::new(Kind::Scene);
/// Models by their handles.
pub(crate) static MODELS: Registry<Model> = Registry::new(Kind::Model);
/// Steppers by their handles.
pub(crate) static STEPPERS: Registry<KeptCloth> = Registry::new(Kind::Stepper);
/// Snapshots by their handles.
pub(crate) static SNAPSHOTS: Registry<Snapshot> = Registry::new(Kind::Snapshot);

/// A cloth that moves, and beside its lock the wish that its steps stop.
pub(crate) struct KeptCloth {
    pub(crate) cloth: Mutex<Run>,
    pub(crate) stop: Arc<AtomicBool>,
}

impl From<Run> for KeptCloth {
    fn from(mut run: Run) -> Self {
        let stop = Arc::new(AtomicBool::new(false));
        run.stop_by(Arc::clone(&stop).into());
        let cloth = Mutex::new(run);
        Self { cloth, stop }
    }
}

/// The solver on the cloth of a scene, where the scene starts.
pub(crate) fn by_solver(scene: &Scene, progress: &mut Progress) -> Result<Run, Fault> {
    Run::begin(scene, &mut |event| progress.tell(event)).map_err(fault)
}

/// A model on the cloth of a scene, from its rest pose on.
pub(crate) fn by_model(
    scene: &Scene,
    model: &Model,
    guard: Correction,
    progress: &mut Progress,
) -> Result<Run, Fault> {
    let network = Network {
        model,
        machine: &Machine::Cpu,
        guard,
    };
    Run::begin_model(scene, network, &mut |event| progress.tell(event)).map_err(fault)
}

/// A scene that cannot be made ready to move.
fn fault(error: Error) -> Fault {
    let status = if error.is_stopped() { SelvedgeStatus::Stopped } else { SelvedgeStatus::Start };
    Fault::of(status, error)
}
