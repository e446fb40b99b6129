//! What handles stand for: scenes, models, moving cloths and their snapshots.

use std::sync::atomic::AtomicBool;
use std::sync::{Arc, Mutex};

use selvedge::{Error, Model, Run, Scene, Snapshot, Stepper};

use crate::border::call;
use crate::fault::Fault;
use crate::registry::{Kind, Registry, lock};
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

/// Calls `work` with the cloth of a stepper, which no other call has meanwhile.
pub(crate) fn with(
    stepper: u64,
    work: impl FnOnce(&mut Run) -> Result<(), Fault>,
) -> SelvedgeStatus {
    call(|| {
        let kept = STEPPERS.get(stepper)?;
        work(&mut *lock(&kept.cloth)?)
    })
}

/// A scene that cannot be made ready to move.
pub(crate) fn not_begun(error: Error) -> Fault {
    let status = if error.is_stopped() { SelvedgeStatus::Stopped } else { SelvedgeStatus::Start };
    Fault::of(status, error)
}
