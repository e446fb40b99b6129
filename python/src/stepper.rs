//! Cloths that move one frame at a time.
//!
//! The array of positions is one for the whole life of a stepper: after each step the newest frame
//! is put into it, with the interpreter's lock held. So it is never seen half made, reading it
//! costs nothing, and writing to it cannot reach the state, which belongs to the stepper alone.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, Mutex, MutexGuard, TryLockError};
use std::time::{Duration, Instant};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::{PyRuntimeError, PyTypeError};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};
use selvedge::machine::Machine;
use selvedge::{
    HandleTargets, Network, RecordingEnd, Rigid, Run, Snapshot as State, StepError, Trust, rounded,
};
use selvedge_cloth::{Cloth, Stepper as MovesCloth};
use selvedge_data::Playback;
use selvedge_lab::rigid::RigidRest;

use crate::arrays::{self, Numbers, natural};
use crate::errors::{raised, step_failed, wrong};
use crate::guarding;
use crate::long::{Progress, Stop, beside, beside_reporting};
use crate::model::Model;
use crate::scene::Scene;
use crate::trajectory::Trajectory;

/// Time of a step from which the next one listens for Ctrl-C, which takes some microseconds.
const LONG: Duration = Duration::from_millis(20);

/// The mover of a cloth.
pub(crate) enum Kind {
    /// A run of a scene.
    Run(Box<Run>),
    /// A recording, which has no scene.
    Recording(Box<Playback>),
}

impl Kind {
    fn mover(&self) -> &(dyn MovesCloth + Send) {
        match self {
            Self::Run(run) => run.as_ref(),
            Self::Recording(recording) => recording.as_ref(),
        }
    }

    fn mover_mut(&mut self) -> &mut (dyn MovesCloth + Send) {
        match self {
            Self::Run(run) => run.as_mut(),
            Self::Recording(recording) => recording.as_mut(),
        }
    }

    pub(crate) fn run(&mut self) -> PyResult<&mut Run> {
        match self {
            Self::Run(run) => Ok(run),
            Self::Recording(_) => Err(wrong(
                "targets are missing: this stepper has no motion of its own to follow",
            )),
        }
    }

    fn trust(&self) -> Option<&Trust> {
        match self {
            Self::Run(run) => run.trust(),
            Self::Recording(_) => None,
        }
    }
}

/// The parts of a stepper that a step changes.
pub(crate) struct Core {
    pub(crate) kind: Kind,
    last: Duration,
    beginning: Option<State>,
}

/// A state of a stepper in memory, which its `restore` goes back to.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Snapshot(pub(crate) State);

/// A cloth that moves one frame at a time, given targets for its handles. Make one of its kinds:
/// `Simulator`, `LearnedStepper`, `Playback`, `RigidStepper`.
#[pyclass(frozen, subclass, module = "selvedge")]
pub(crate) struct Stepper {
    core: Mutex<Core>,
    stop: Arc<AtomicBool>,
    buffer: Py<PyArray2<f32>>,
    /// Positions of the newest frame [m], (n, 3), float32. It is the same array for the whole life
    /// of the stepper, and cannot be written; `step` returns a copy.
    #[pyo3(get)]
    positions: Py<PyAny>,
    /// Faces, (f, 3), uint32.
    #[pyo3(get)]
    faces: Py<PyArray2<u32>>,
    pub(crate) handles: Vec<u32>,
    /// Frames per second.
    #[pyo3(get)]
    frame_rate: f64,
    /// With what its class makes it.
    pub(crate) made: Py<PyTuple>,
}

impl Stepper {
    fn of<'py>(made: Bound<'py, PyTuple>, mut kind: Kind, frame_rate: f64) -> PyResult<Self> {
        let py = made.py();
        let stop = Arc::<AtomicBool>::default();
        let mover = kind.mover_mut();
        mover.stop_by(Arc::clone(&stop).into());
        let faces = arrays::faces_of(py, mover.topology())?;
        let handles = mover.handles().vertices().iter().map(|v| v.0).collect();
        let positions = arrays::flat(mover.positions()).to_vec();
        let count = positions.len() / 3;
        let buffer = positions.into_pyarray(py).reshape([count, 3])?;
        let shown = buffer.call_method0("view")?;
        shown.getattr("flags")?.setattr("writeable", false)?;
        Ok(Self {
            core: Mutex::new(Core {
                beginning: kind.mover().snapshot(),
                kind,
                last: LONG,
            }),
            stop,
            buffer: buffer.unbind(),
            positions: shown.unbind(),
            faces,
            handles,
            frame_rate,
            made: made.unbind(),
        })
    }

    pub(crate) fn free(&self) -> PyResult<MutexGuard<'_, Core>> {
        match self.core.try_lock() {
            Ok(core) => Ok(core),
            Err(TryLockError::Poisoned(core)) => Ok(core.into_inner()),
            Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err(
                "this stepper is moving in another thread: give each thread one of its own",
            )),
        }
    }

    /// Puts the newest frame into the array of positions.
    fn show(&self, py: Python<'_>, core: &Core) -> PyResult<()> {
        let mut buffer = self.buffer.bind(py).try_readwrite()?;
        let shown = buffer.as_slice_mut()?;
        shown.copy_from_slice(arrays::flat(core.kind.mover().positions()));
        Ok(())
    }

    /// Moves by a frame; listens for Ctrl-C where the last step was long.
    fn move_on(&self, py: Python<'_>, targets: &HandleTargets) -> PyResult<()> {
        let mut guard = self.free()?;
        let core = &mut *guard;
        let is_long = core.last >= LONG;
        let work = || {
            let began = Instant::now();
            let moved = core.kind.mover_mut().step(targets);
            core.last = began.elapsed();
            moved
        };
        let moved = if is_long {
            let stop = Stop::with_flag(Arc::clone(&self.stop));
            let moved = beside(py, &stop, work);
            self.stop.store(false, Ordering::Relaxed);
            // A step that came to its end in spite of a signal is shown.
            self.show(py, &guard)?;
            moved?
        } else {
            py.detach(work)
        };
        moved.map_err(|error| step_failed(py, error))?;
        self.show(py, &guard)
    }

    /// A stepper of a run, whose warnings are told.
    pub(crate) fn of_run(made: Bound<'_, PyTuple>, run: Run) -> PyResult<Self> {
        let scene = run.scene().built();
        for warning in run.start_warnings() {
            tracing::warn!("{}: {warning}", scene.name);
        }
        let rate = scene.frame_rate;
        Self::of(made, Kind::Run(Box::new(run)), rate)
    }

    fn go_back(&self, py: Python<'_>, state: &State) -> PyResult<()> {
        let mut core = self.free()?;
        let back = core.kind.mover_mut().rewind(state);
        back.map_err(|error| step_failed(py, error))?;
        self.show(py, &core)
    }

    fn targets_of(&self, numbers: &Numbers<'_>) -> PyResult<HandleTargets> {
        let handles = self.handles.len();
        match numbers.shape() {
            [found, 3] if *found == handles => {}
            [samples, found, 3] if *found == handles && *samples > 0 => {}
            found => {
                return Err(wrong(format!(
                    "targets must have the shape ({handles}, 3), or (samples, {handles}, 3) for several times in the frame, found {found:?}"
                )));
            }
        }
        HandleTargets::sampled(arrays::triples(numbers), handles).map_err(raised)
    }
}

#[pymethods]
impl Stepper {
    /// Moves the cloth by one frame, its handles to `targets` [m], (handles, 3), at its end; or
    /// (samples, handles, 3) at equally spaced times of which the last is its end. Handles in
    /// `released`, (handles,) of bool, are let go during this frame. Without targets the handles
    /// follow the scene's motion. Returns the new positions [m], (n, 3), float32, in an array of
    /// their own.
    ///
    /// Raises `FrameError`; the cloth is then as it was before.
    #[pyo3(signature = (targets=None, released=None))]
    fn step<'py>(
        &self,
        py: Python<'py>,
        targets: Option<Numbers<'_>>,
        released: Option<Vec<bool>>,
    ) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let targets = match &targets {
            Some(numbers) => self.targets_of(numbers)?,
            None => {
                let mut core = self.free()?;
                let run = core.kind.run()?;
                run.next_targets(run.samples()).map_err(raised)?
            }
        };
        let targets = match released {
            Some(released) => targets.releasing(released).map_err(raised)?,
            None => targets,
        };
        self.move_on(py, &targets)?;
        let numbers = arrays::flat(self.free()?.kind.mover().positions()).to_vec();
        let count = numbers.len() / 3;
        numbers.into_pyarray(py).reshape([count, 3])
    }

    /// Follows the scene's motion for `frames` steps and returns all positions [m], (frames + 1, n,
    /// 3), float32, with those now first. Ctrl-C stops at the frame that was reached.
    /// `progress(task, done, goal)` hears of every frame; its answer `False` stops too.
    #[pyo3(signature = (frames, progress=None))]
    fn follow<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = natural)] frames: usize,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let mut guard = self.free()?;
        let run = guard.kind.run()?;
        let stop = Stop::with_flag(Arc::clone(&self.stop));
        let mut reporter = Progress::new(progress, &stop);
        reporter.begin("moving", Some(frames as u64));
        let made = beside(py, &stop, || {
            run.record(frames, &mut |_| reporter.advance())
        });
        self.stop.store(false, Ordering::Relaxed);
        self.show(py, &guard)?;
        let made = made?;
        if let RecordingEnd::Failed(error) = made.end {
            return Err(step_failed(py, error));
        }
        let vertices = guard.kind.mover().positions().len();
        let count = made.positions.len() / vertices.max(1);
        let numbers = arrays::flat(&made.positions).to_vec();
        numbers.into_pyarray(py).reshape([count, vertices, 3])
    }

    /// Targets of the scene's motion for the next step [m], (samples, handles, 3), as `step` takes
    /// them.
    fn next_targets<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let mut core = self.free()?;
        let run = core.kind.run()?;
        let samples = run.samples();
        let targets = run.next_targets(samples).map_err(raised)?;
        let fractions = (1..=samples).map(|k| k as f64 / samples as f64);
        let handles = 0..targets.handle_count();
        let places = fractions.flat_map(|fraction| {
            let at = |handle| targets.at(handle, fraction, DVec3::ZERO);
            handles.clone().map(at).collect::<Vec<DVec3>>()
        });
        let places: Vec<DVec3> = places.collect();
        let numbers = arrays::flat_f64(&places).to_vec().into_pyarray(py);
        numbers.reshape([samples, targets.handle_count(), 3])
    }

    /// Frames stepped since the start.
    #[getter]
    fn frame(&self) -> PyResult<usize> {
        Ok(self.free()?.kind.mover().frame())
    }

    /// Numbers of the held vertices, (handles,), uint32, in the order of the targets.
    #[getter]
    fn handles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        self.handles.clone().into_pyarray(py)
    }

    /// The guard's word on the newest frame as a dictionary; `None` without a guard.
    #[getter]
    fn trust<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let core = self.free()?;
        let trust = core.kind.trust();
        trust.map(|trust| guarding::word(py, trust)).transpose()
    }

    /// All that is to be known so far: warnings of the scene, of its start, of what a model does not
    /// see and was not trained on, and of edges that strain too far.
    #[getter]
    fn warnings(&self) -> PyResult<Vec<String>> {
        match &self.free()?.kind {
            Kind::Run(run) => Ok(run.warnings()),
            Kind::Recording(_) => Ok(Vec::new()),
        }
    }

    /// The state now, for `restore`.
    fn snapshot(&self, py: Python<'_>) -> PyResult<Snapshot> {
        let core = self.free()?;
        let frame = core.kind.mover().frame();
        let state = core.kind.mover().snapshot();
        let state = state.ok_or(StepError::Snapshot { frame });
        state.map(Snapshot).map_err(|error| step_failed(py, error))
    }

    /// Goes back to a snapshot of this stepper, or of another one of its scene by the same mover:
    /// the frames that follow have the bytes of those that followed then.
    ///
    /// Raises `FrameError` for a snapshot of another kind of stepper or cloth.
    fn restore(&self, py: Python<'_>, snapshot: &Snapshot) -> PyResult<()> {
        self.go_back(py, &snapshot.0)
    }

    /// Sets the cloth elsewhere between two frames, by the rigid motion of a matrix (4, 4), and with
    /// it the obstacles of the numbers `bodies`; its velocities turn along. The next targets begin
    /// from there.
    ///
    /// Raises `FrameError` where it would meet an obstacle, or is moved by a model, and `ValueError` for
    /// the number of no obstacle; it stays then.
    #[pyo3(signature = (matrix, bodies=Vec::new()))]
    fn teleport(
        &self,
        py: Python<'_>,
        matrix: Numbers<'_>,
        #[pyo3(from_py_with = natural)] bodies: Vec<usize>,
    ) -> PyResult<()> {
        let to = rigid_of(&matrix)?;
        let mut core = self.free()?;
        let moved = core.kind.mover_mut().teleport(to, &bodies);
        moved.map_err(|error| step_failed(py, error))?;
        self.show(py, &core)
    }

    /// Leads the obstacle of this number, from 0, in the next frame away from its own path, by the
    /// rigid motion of a matrix (4, 4); it stays there until it is led on. Only the solver has them.
    ///
    /// Raises `ValueError` for the number of no obstacle.
    fn lead_body(
        &self,
        py: Python<'_>,
        #[pyo3(from_py_with = natural)] body: usize,
        matrix: Numbers<'_>,
    ) -> PyResult<()> {
        let away = rigid_of(&matrix)?;
        let mut core = self.free()?;
        let led = core.kind.run()?.lead_obstacle(body, away);
        led.map_err(|error| step_failed(py, error))
    }

    /// Momentum [N s] and angular momentum about the origin [N m s] that each body received in the last
    /// frame, (bodies, 2, 3), float64: times the frame rate, force and torque. Only the solver has them.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray3<f64>>> {
        let mut core = self.free()?;
        let all: Vec<DVec3> = impulses_of(core.kind.run()?).collect();
        let numbers = arrays::flat_f64(&all).to_vec().into_pyarray(py);
        numbers.reshape([all.len() / 2, 2, 3])
    }

    /// Goes back to the start.
    fn reset(&self, py: Python<'_>) -> PyResult<()> {
        let beginning = self.free()?.beginning.clone();
        match beginning {
            Some(beginning) => self.go_back(py, &beginning),
            None => Ok(()),
        }
    }

    fn __copy__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let (py, own) = (slf.py(), slf.get());
        let other = slf.get_type().call1(own.made.bind(py))?;
        other.call_method1("restore", (own.snapshot(py)?,))?;
        Ok(other)
    }

    fn __deepcopy__<'py>(
        slf: &Bound<'py, Self>,
        _memo: &Bound<'py, PyAny>,
    ) -> PyResult<Bound<'py, PyAny>> {
        Self::__copy__(slf)
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> PyResult<()> {
        Err(PyTypeError::new_err(format!(
            "a {} is not pickled: pickle the scene and the model, and make it there (copy.deepcopy copies it here; a Simulator is pickled with its state)",
            slf.get_type().name()?
        )))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let name = slf.get_type().name()?.to_string();
        let stepper = slf.get();
        let core = stepper.free()?;
        Ok(format!(
            "{name}({} vertices, frame {})",
            core.kind.mover().positions().len(),
            core.kind.mover().frame()
        ))
    }
}

/// Momentum and angular momentum that each body received in the last frame.
pub(crate) fn impulses_of(run: &Run) -> impl Iterator<Item = DVec3> {
    let received = run.impulses().iter();
    received.flat_map(|one| [one.linear, one.angular])
}

/// The rigid motion of a matrix.
pub(crate) fn rigid_of(matrix: &Numbers<'_>) -> PyResult<Rigid> {
    if matrix.shape() != [4, 4] {
        let found = matrix.shape();
        return Err(wrong(format!(
            "matrix must have the shape (4, 4), found {found:?}"
        )));
    }
    let columns: Vec<f64> = matrix.as_array().t().iter().copied().collect();
    Rigid::try_from(&columns[..]).map_err(raised)
}

/// A trained model on the cloth of a scene, from its sagged rest pose.
///
/// `LearnedStepper(scene, model, guard="limit")`; the guard is none or limit.
#[pyclass(frozen, extends = Stepper, module = "selvedge")]
pub(crate) struct LearnedStepper;

#[pymethods]
impl LearnedStepper {
    #[new]
    #[pyo3(signature = (scene, model, guard="limit", progress=None))]
    fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        model: &Bound<'py, Model>,
        guard: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let made = (scene, model, guard).into_pyobject(py)?;
        let (scene, model) = (scene.get(), model.get().named());
        let guard = guard.parse().map_err(wrong)?;
        let network = Network {
            model: &model,
            machine: &Machine::Cpu,
            guard,
        };
        let run = beside_reporting(py, progress, |_, reporter| {
            Run::begin_model(&scene.run, network, &mut |event| reporter.on_event(event))
                .map_err(raised)
        })??;
        let stepper = Stepper::of_run(made, run)?;
        Ok(PyClassInitializer::from(stepper).add_subclass(Self))
    }
}

/// A recording, played frame by frame. Its targets are ignored but for their number.
///
/// `PlaybackStepper(trajectory)` begins with the first frame.
#[pyclass(frozen, extends = Stepper, module = "selvedge")]
pub(crate) struct PlaybackStepper;

#[pymethods]
impl PlaybackStepper {
    #[new]
    fn new(trajectory: &Bound<'_, Trajectory>) -> PyResult<PyClassInitializer<Self>> {
        let made = (trajectory,).into_pyobject(trajectory.py())?;
        let played = trajectory.get().inner.as_ref().clone();
        let rate = played.frame_rate();
        let kind = Kind::Recording(Box::new(Playback::new(played)));
        let stepper = Stepper::of(made, kind, rate)?;
        Ok(PyClassInitializer::from(stepper).add_subclass(Self))
    }
}

/// The rest pose, moved rigidly with its handles: the rival that a model must beat.
///
/// `RigidStepper(scene)` starts in the sagged rest pose.
#[pyclass(frozen, extends = Stepper, module = "selvedge")]
pub(crate) struct RigidStepper;

#[pymethods]
impl RigidStepper {
    #[new]
    #[pyo3(signature = (scene, progress=None))]
    fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let made = (scene,).into_pyobject(py)?;
        let scene = scene.get();
        let rest = beside_reporting(py, progress, |_, reporter| scene.found_rest(reporter))??;
        let built = scene.run.built();
        let cloth = Cloth::of_scene(built, rounded(&rest.positions)).map_err(raised)?;
        let run = Run::of_stepper(&scene.run, Box::new(RigidRest::new(&cloth)));
        let stepper = Stepper::of_run(made, run.map_err(raised)?)?;
        Ok(PyClassInitializer::from(stepper).add_subclass(Self))
    }
}
