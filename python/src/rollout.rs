//! Whole runs in one call: the physics, or a model under a guard with its word on every frame.

use std::path::PathBuf;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use selvedge_cloth::{Cloth, Scene as Built, Stepper};
use selvedge_data::{LoadedScene, Trajectory as Recorded};
use selvedge_guard::{Correction, Trust};
use selvedge_lab::domain::{self, Beyond};
use selvedge_lab::machine::Machine;
use selvedge_lab::physics::{self, Simulated, SimulationPlan, TimedRun};
use selvedge_lab::watched::{self, GuardSummary};
use selvedge_lab::{End, start};
use selvedge_sim::Threads;
use serde_json::Value;

use crate::arrays::Numbers;
use crate::errors::told;
use crate::guarding;
use crate::json;
use crate::long::{Stop, Teller, told_beside};
use crate::model::Model;
use crate::scene::Scene;
use crate::stepper::{begin, state_at};
use crate::trajectory::Trajectory;

/// A model's run, with the guard's word on every frame.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Rollout {
    /// The model's motion.
    #[pyo3(get)]
    trajectory: Py<Trajectory>,
    /// The physics from the same start, where it was asked for.
    #[pyo3(get)]
    truth: Option<Py<Trajectory>>,
    log: Vec<Trust>,
    summary: GuardSummary,
    beyond: Option<Beyond>,
    /// Wall time of a frame of the model [ms].
    #[pyo3(get)]
    ms_per_frame: f64,
    /// False where the progress callback asked to stop.
    #[pyo3(get)]
    is_complete: bool,
}

#[pymethods]
impl Rollout {
    /// The guard's word on every frame but the first, as columns.
    #[getter]
    fn trust<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        guarding::columns(py, &self.log)
    }

    /// The guard's words summed up.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.summary)
    }

    /// Parts of the scene that the model was not trained on, in words; `None` where its file does
    /// not say.
    #[getter]
    fn beyond(&self) -> Option<Vec<String>> {
        let beyond = self.beyond.as_ref()?;
        Some(beyond.departures.iter().map(ToString::to_string).collect())
    }

    /// Writes the guard's words (.csv), as `selvedge run --trust` does.
    fn write_trust(&self, path: PathBuf) -> PyResult<()> {
        watched::write_trust(&path, &self.log, self.beyond.as_ref()).map_err(told)
    }

    /// The measures of the rollout against its truth, in SI units; `None` without one.
    fn comparison<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        let Some(truth) = &self.truth else {
            return Ok(None);
        };
        let compared = truth.get().compared(py, self.trajectory.get())?;
        Ok(Some(compared))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyBytes>> {
        let truth = self.truth.as_ref().map(|truth| truth.get());
        Ok(self.trajectory.get().drawn(py, truth)?.bytes(py))
    }

    fn __repr__(&self) -> String {
        let GuardSummary {
            frames,
            corrected,
            lost,
            ..
        } = self.summary;
        format!("Rollout({frames} frames, {corrected} corrected, {lost} lost)")
    }
}

/// The trajectory of a run, with the scene where its spec says all of it.
fn trajectory_of(
    scene: &Scene,
    loaded: &LoadedScene,
    first: usize,
    rest: &[DVec3],
    positions: Vec<Vec3>,
) -> PyResult<Recorded> {
    let (spec, built) = (&loaded.spec, &loaded.scene);
    if scene.has_spec {
        return physics::trajectory(first, spec, built, rest, positions).map_err(told);
    }
    let mut provenance = physics::provenance(spec, built).map_err(told)?;
    provenance.scene = Value::Null;
    let cloth = Cloth::of_scene(built, physics::rounded(rest)).map_err(told)?;
    Recorded::new(cloth, positions, provenance).map_err(told)
}

/// Simulates a scene by the reference physics, as `selvedge run` does: from where the scene
/// says, or from `positions` (n, 3) [m] and `velocities` (n, 3) [m/s]. Ctrl-C stops within a
/// substep; an answer `False` of `progress(task, done, goal)` keeps the frames until then.
///
/// # Errors
/// What of the scene or a step went wrong.
#[pyfunction]
#[pyo3(signature = (scene, frames=None, positions=None, velocities=None, progress=None))]
pub(crate) fn simulate(
    py: Python<'_>,
    scene: &Scene,
    frames: Option<usize>,
    positions: Option<Numbers<'_>>,
    velocities: Option<Numbers<'_>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Trajectory> {
    let given = state_at(positions.as_ref(), velocities.as_ref())?;
    let made = told_beside(py, progress, |stop, teller| {
        let (state, rest) = begin(scene, given, teller)?;
        let (built, first) = (&scene.loaded.scene, state.frame);
        let frames = match frames {
            Some(frames) => frames,
            None => built.frame_count().map_err(told)?.saturating_sub(first),
        };
        let plan = SimulationPlan {
            start: state,
            frames,
            keeps_states: false,
            threads: Threads::Pool,
            stop: stop.flag(),
        };
        teller.begin("simulating", Some(frames as u64));
        let run = physics::run_plan(built, plan, &mut || teller.advance());
        let (run, _) = run.and_then(Simulated::whole).map_err(told)?;
        let at_rest = rest.as_ref().map(|rest| rest.positions.as_slice());
        let at_rest = at_rest.unwrap_or(built.mesh.positions());
        trajectory_of(scene, &scene.loaded, first, at_rest, run.positions)
    })??;
    Trajectory::of(py, made)
}

/// The outcome of a rollout before Python has it.
struct Made {
    run: Recorded,
    truth: Option<Recorded>,
    log: Vec<Trust>,
    summary: GuardSummary,
    beyond: Option<Beyond>,
    ms_per_frame: f64,
    end: End,
}

/// Runs a model on a scene from its rest pose, as `selvedge run --model` does, with the `guard` none
/// or limit. `truth=True` also runs the physics. `progress(task, done,
/// goal)` hears of every frame; its answer `False` keeps the frames until then.
///
/// # Errors
/// What of the scene, the model or a step went wrong.
#[pyfunction]
#[pyo3(signature = (scene, model, frames=None, guard="limit", truth=false, progress=None))]
pub(crate) fn rollout(
    py: Python<'_>,
    scene: &Scene,
    model: &Model,
    frames: Option<usize>,
    guard: &str,
    truth: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Rollout> {
    let guard = guarding::settings(guard)?;
    let made = told_beside(py, progress, |stop, teller| {
        roll(scene, model, frames, guard, truth, stop, teller)
    })??;
    let truth = made.truth.map(|truth| Trajectory::of(py, truth));
    let truth = truth.transpose()?.map(|truth| Py::new(py, truth));
    Ok(Rollout {
        trajectory: Py::new(py, Trajectory::of(py, made.run)?)?,
        truth: truth.transpose()?,
        log: made.log,
        summary: made.summary,
        beyond: made.beyond,
        ms_per_frame: made.ms_per_frame,
        is_complete: made.end == End::Complete,
    })
}

fn roll(
    scene: &Scene,
    model: &Model,
    frames: Option<usize>,
    guard: Correction,
    has_truth: bool,
    stop: &Stop,
    teller: &mut Teller<'_>,
) -> PyResult<Made> {
    let mut loaded = scene.loaded.clone();
    for warning in start::for_model(&mut loaded) {
        tracing::warn!("{}: {warning}", loaded.spec.name);
    }
    let built = Arc::new(loaded.scene.clone());
    let frames = match frames {
        Some(frames) => frames,
        None => built.frame_count().map_err(told)?,
    };
    let beyond = domain::of_scene(&model.model, &built, frames).map_err(told)?;
    let rest = scene.rest_of(&built, teller)?;
    let rest = &rest.positions;
    let path = built.handle_path().map_err(told)?;
    let guard = start::guarded(&built, rest, &model.named(), &Machine::Cpu, guard);
    let (mut guard, mut log) = (guard.map_err(told)?, Vec::new());
    guard.stop_by(stop.flag().into());
    teller.begin("predicting", Some(frames as u64));
    let run = physics::drive(&mut guard, &path, frames, &mut |guard| {
        log.push(*guard.trust());
        teller.advance()
    });
    let run = run.map_err(told)?;
    if let Some(failure) = guard.physics_failure() {
        tracing::warn!("the guard did without its physics: {failure}");
    }
    let mut end = run.end;
    let ms_per_frame = run.ms_per_frame;
    let mut truth = None;
    if has_truth && end == End::Complete {
        let run = simulated(&built, rest, frames, stop, teller)?;
        end = run.end;
        truth = Some(trajectory_of(scene, &loaded, 0, rest, run.positions)?);
    }
    Ok(Made {
        run: trajectory_of(scene, &loaded, 0, rest, run.positions)?,
        truth,
        summary: watched::summary(&log),
        log,
        beyond,
        ms_per_frame,
        end,
    })
}

fn simulated(
    scene: &Built,
    rest: &[DVec3],
    frames: usize,
    stop: &Stop,
    teller: &mut Teller<'_>,
) -> PyResult<TimedRun> {
    let plan = SimulationPlan {
        start: selvedge_data::SavedState::at_rest(rest.to_vec()),
        frames,
        keeps_states: false,
        threads: Threads::Pool,
        stop: stop.flag(),
    };
    teller.begin("simulating the truth", Some(frames as u64));
    let run = physics::run_plan(scene, plan, &mut || teller.advance());
    Ok(run.and_then(Simulated::whole).map_err(told)?.0)
}
