//! The reference run: states in f64 that count as the truth, kept in a file, so that another study
//! of the same scene need not make them again.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use glam::DVec3;
use selvedge_cloth::Stepper;
use selvedge_data::{Drive, SavedState, StateRun};
use selvedge_sim::{Simulator, Threads};

use super::case::Case;
use super::error::ConvergenceError;
use super::method::Method;
use crate::event::{End, Task};
use crate::physics::{self, Keep, SimulationPlan};
use crate::state_log::simulator_in;

/// Frames of a kept run that are made again, to see that the physics still makes it.
const CHECKED: usize = 5;

/// Positions `[m]` and velocities `[m/s]` of a cloth, `[vertices]` each.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct State<'a> {
    pub(super) positions: &'a [DVec3],
    pub(super) velocities: &'a [DVec3],
}

/// States of every frame of a run.
pub(super) struct Reference {
    run: StateRun,
}

impl Reference {
    /// The state of `frame`; none where the run has no such frame.
    pub(super) fn state(&self, frame: usize) -> Option<State<'_>> {
        let first = self.run.states.first()?.frame;
        let state = self.run.states.get(frame.checked_sub(first)?)?;
        Some(State {
            positions: &state.positions,
            velocities: &state.velocities,
        })
    }

    /// The state of `frame`, to start from.
    pub(super) fn saved(&self, frame: usize) -> Option<SavedState> {
        let state = self.state(frame)?;
        Some(SavedState {
            frame,
            ..SavedState::moving(state.positions.to_vec(), state.velocities.to_vec())
        })
    }
}

/// The file of a case's run in `folder`. Its name tells the scene and the method apart from others.
///
/// # Errors
/// A scene that cannot be written as JSON.
pub(super) fn path(
    folder: &Path,
    case: &Case,
    method: &Method,
) -> Result<PathBuf, ConvergenceError> {
    let spec = case.spec_by(method).to_json()?.to_string();
    let hash = blake3::hash(spec.as_bytes()).to_hex();
    let (case, short) = (case.slug(), &hash[..16]);
    Ok(folder.join(format!("{case}-{short}.safetensors")))
}

/// The kept run of `case` in the file `path` up to frame `last`; none where there is none that
/// fits. A run that is there and does not fit is warned of.
pub(super) fn open(path: &Path, case: &Case, method: &Method, last: usize) -> Option<Reference> {
    let bytes = selvedge_data::read_file(path).ok()?;
    let unfit = |problem: String| {
        tracing::warn!("{}: {problem}: it is made again", path.display());
        None
    };
    let run = match StateRun::from_bytes(&bytes) {
        Ok(run) => run,
        Err(error) => return unfit(error.to_string()),
    };
    let vertices = case.scene().mesh.positions().len();
    let reference = Reference { run };
    let mut states = reference.run.states.iter();
    if states.any(|state| state.positions.len() != vertices) {
        return unfit("the kept reference is of another mesh".to_owned());
    }
    let first = case.first_frame();
    let mut states = reference.run.states.iter().zip(first..);
    if !states.all(|(state, expected)| state.frame == expected) {
        return unfit("the kept reference lacks frames".to_owned());
    }
    // A shorter run served a study of an earlier part of the motion.
    reference.state(last)?;
    match is_made_again(&reference, case, method) {
        Ok(true) => Some(reference),
        Ok(false) => unfit("this program makes another reference".to_owned()),
        Err(error) => unfit(error),
    }
}

/// Makes the first frames of a kept run again and returns `true` where they are the same.
fn is_made_again(reference: &Reference, case: &Case, method: &Method) -> Result<bool, String> {
    let first = case.first_frame();
    let start = reference
        .saved(first)
        .ok_or("the kept reference is empty")?;
    let scene = case.scene_by(method);
    let mut simulator = start_simulator(&scene, start)?;
    let path = scene.handle_path().map_err(|error| error.to_string())?;
    let drive = Drive {
        path: &path,
        samples_per_frame: method.substeps as usize,
    };
    for frame in first + 1..=first + CHECKED {
        let Some(kept) = reference.state(frame) else {
            break;
        };
        step(&mut simulator, drive)?;
        if kept != state_of(&simulator) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Makes the run of `case` from `start` to frame `last` and keeps it in the file `path`. None where
/// an end is asked for.
///
/// # Errors
/// A step that fails, or a file that cannot be written.
pub(super) fn make(
    job: &ReferenceJob<'_>,
    start: SavedState,
    task: &Task<'_, '_>,
) -> Result<Option<Reference>, ConvergenceError> {
    let scene = job.case.scene_by(job.method);
    let plan = SimulationPlan {
        frames: job.last.saturating_sub(start.frame),
        start,
        keep: Keep::States,
        threads: Threads::Pool,
        stop: Arc::default(),
    };
    let (run, states) =
        physics::run_plan(&scene, plan, &mut || task.advance_by(job.method.substeps))?.whole()?;
    let Some(states) = states.filter(|_| run.end == End::Complete) else {
        return Ok(None);
    };
    let provenance = selvedge_data::Provenance {
        frame_rate: scene.frame_rate,
        scene: job.case.spec_by(job.method).to_json()?,
        made_by: physics::MADE_BY.to_owned(),
    };
    states.write(job.path, &provenance)?;
    Ok(Some(Reference { run: states }))
}

/// A reference run to be made.
pub(super) struct ReferenceJob<'a> {
    pub(super) case: &'a Case,
    pub(super) method: &'a Method,
    /// The last frame that is needed.
    pub(super) last: usize,
    pub(super) path: &'a Path,
}

/// A simulator of `scene` that goes on from `start`, on one thread.
///
/// # Errors
/// A state or a scene that cannot be run, in words.
pub(super) fn start_simulator(
    scene: &selvedge_cloth::Scene,
    start: SavedState,
) -> Result<Simulator, String> {
    let frame = start.frame;
    let simulator = simulator_in(scene, start).and_then(|start| start.taken_up_at(frame));
    let mut simulator = simulator.map_err(|error| error.to_string())?;
    simulator.set_threads(Threads::One);
    Ok(simulator)
}

/// Moves `simulator` by a frame.
///
/// # Errors
/// The step that failed, in words.
pub(super) fn step(simulator: &mut Simulator, drive: Drive<'_>) -> Result<(), String> {
    let targets = drive
        .path
        .targets(simulator.frame(), drive.samples_per_frame);
    let targets = targets.map_err(|error| error.to_string())?;
    simulator.step(&targets).map_err(|error| error.to_string())
}

/// The state of a simulator now.
pub(super) fn state_of(simulator: &Simulator) -> State<'_> {
    State {
        positions: simulator.positions_f64(),
        velocities: simulator.velocities_f64(),
    }
}
