//! Whole runs in one call: the physics, or a model under a guard with its word on every frame.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use selvedge::machine::Machine;
use selvedge::{Correction, End, Network, Run, Stepper, Trust};
use selvedge_data::Trajectory as Recorded;
use selvedge_lab::domain::{self, Beyond};
use selvedge_lab::physics::{self, Simulated};
use selvedge_lab::watched::{self, GuardSummary};

use crate::arrays::{Numbers, natural};
use crate::errors::{raised, wrong};
use crate::guarding;
use crate::json;
use crate::long::{Progress, Stop, beside_reporting};
use crate::model::Model;
use crate::scene::Scene;
use crate::simulator::{begin, state_at};
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

    /// The reason not to trust the motion, in words: more than 3 % of its frames were beyond the guard's
    /// bounds; `None` otherwise.
    #[getter]
    fn doubt(&self) -> Option<String> {
        self.summary.doubt_in_words()
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
        watched::write_trust(&path, &self.log, self.beyond.as_ref()).map_err(raised)
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
    #[pyo3(from_py_with = natural)] frames: Option<usize>,
    positions: Option<Numbers<'_>>,
    velocities: Option<Numbers<'_>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Trajectory> {
    let given = state_at(positions.as_ref(), velocities.as_ref())?;
    let made = beside_reporting(py, progress, |stop, reporter| {
        let mut run = begin(scene, given, reporter)?;
        for warning in run.start_warnings() {
            tracing::warn!("{warning}");
        }
        let frames = match frames {
            Some(frames) => frames,
            None => run.frames_left().map_err(raised)?,
        };
        simulated(&mut run, frames, "simulating", stop, reporter).map(|made| made.0)
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
    #[pyo3(from_py_with = natural)] frames: Option<usize>,
    guard: &str,
    truth: bool,
    progress: Option<Py<PyAny>>,
) -> PyResult<Rollout> {
    let guard = guard.parse().map_err(wrong)?;
    let made = beside_reporting(py, progress, |stop, reporter| {
        roll(scene, model, frames, guard, truth, stop, reporter)
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
    reporter: &mut Progress<'_>,
) -> PyResult<Made> {
    let built = scene.run.built();
    let frames = match frames {
        Some(frames) => frames,
        None => built.frame_count().map_err(raised)?,
    };
    let beyond = domain::of_scene(&model.model, built, frames).map_err(raised)?;
    let model = model.named();
    let network = Network {
        model: &model,
        machine: &Machine::Cpu,
        guard,
    };
    let run = Run::begin_model(&scene.run, network, &mut |event| reporter.on_event(event));
    let mut run = run.map_err(raised)?;
    for warning in run.start_warnings() {
        tracing::warn!("{}: {warning}", built.name);
    }
    let mut log = Vec::new();
    run.stop_by(stop.flag().into());
    reporter.begin("predicting", Some(frames as u64));
    let made = physics::simulate(&mut run, frames, false, &mut |now| {
        log.extend(now.trust());
        reporter.advance()
    });
    let (made, _) = made.whole().map_err(raised)?;
    let (mut end, mut truth) = (made.end, None);
    if has_truth && end == End::Complete {
        let mut solver = Run::new(run.scene()).map_err(raised)?;
        let what = "simulating the truth";
        let (trajectory, reached) = simulated(&mut solver, frames, what, stop, reporter)?;
        (truth, end) = (Some(trajectory), reached);
    }
    Ok(Made {
        run: run.trajectory(made.positions).map_err(raised)?,
        truth,
        summary: watched::summary(&log),
        log,
        beyond,
        ms_per_frame: made.ms_per_frame,
        end,
    })
}

/// The frames of a run by the solver, and its end.
fn simulated(
    run: &mut Run,
    frames: usize,
    what: &str,
    stop: &Stop,
    reporter: &mut Progress<'_>,
) -> PyResult<(Recorded, End)> {
    run.stop_by(stop.flag().into());
    reporter.begin(what, Some(frames as u64));
    let made = physics::simulate(run, frames, false, &mut |_| reporter.advance());
    let (made, _) = Simulated::whole(made).map_err(raised)?;
    Ok((run.trajectory(made.positions).map_err(raised)?, made.end))
}
