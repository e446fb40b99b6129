//! Many cloths that move side by side, with one array of positions.

use std::sync::{Mutex, MutexGuard, TryLockError};

use glam::DVec3;
use numpy::{IntoPyArray, PyArray3, PyArray4, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use selvedge::{HandleTargets, Run, Stepper as _, step_all};

use crate::arrays::{self, Numbers, natural};
use crate::errors::{raised, step_failed, wrong};
use crate::long::{Progress, beside_reporting};
use crate::scene::Scene;
use crate::simulator::begin;
use crate::stepper::{Snapshot, impulses_of, rigid_of};

/// Worlds of the physics, one for each of `scenes`, that move side by side on the processor's threads;
/// their cloths have the same number of vertices and of handles, and their scenes of bodies.
///
/// `Worlds(scenes, progress=None)` starts each where its scene says.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Worlds {
    runs: Mutex<Vec<Run>>,
    buffer: Py<PyArray3<f32>>,
    /// Positions of the newest frames [m], (worlds, n, 3), float32. It is the same array for the whole
    /// life of the worlds, and cannot be written.
    #[pyo3(get)]
    positions: Py<PyAny>,
    handles: usize,
}

impl Worlds {
    fn free(&self) -> PyResult<MutexGuard<'_, Vec<Run>>> {
        match self.runs.try_lock() {
            Ok(runs) => Ok(runs),
            Err(TryLockError::Poisoned(runs)) => Ok(runs.into_inner()),
            Err(TryLockError::WouldBlock) => Err(PyRuntimeError::new_err(
                "these worlds are moving in another thread",
            )),
        }
    }

    /// Calls `work` with a world, and shows its positions.
    fn with<R>(
        &self,
        py: Python<'_>,
        world: i64,
        work: impl FnOnce(&mut Run) -> PyResult<R>,
    ) -> PyResult<R> {
        let mut runs = self.free()?;
        let count = runs.len();
        let run = usize::try_from(world).ok().and_then(|w| runs.get_mut(w));
        let run = run.ok_or_else(|| {
            wrong(format!(
                "there is no world {world}: there are {count}, numbered from 0"
            ))
        })?;
        let done = work(run)?;
        self.show(py, &runs)?;
        Ok(done)
    }

    fn show(&self, py: Python<'_>, runs: &[Run]) -> PyResult<()> {
        let mut buffer = self.buffer.bind(py).try_readwrite()?;
        let shown = buffer.as_slice_mut()?;
        for (shown, run) in shown.chunks_exact_mut(shown.len() / runs.len()).zip(runs) {
            shown.copy_from_slice(arrays::flat(run.positions()));
        }
        Ok(())
    }
}

#[pymethods]
impl Worlds {
    #[new]
    #[pyo3(signature = (scenes, progress=None))]
    fn new(
        py: Python<'_>,
        scenes: Vec<Bound<'_, Scene>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Self> {
        let own: Vec<&Scene> = scenes.iter().map(Bound::get).collect();
        let runs = beside_reporting(py, progress, |_, reporter: &mut Progress<'_>| {
            let made = own.iter().map(|scene| begin(scene, None, reporter));
            made.collect::<PyResult<Vec<Run>>>()
        })??;
        let size = |run: &Run| {
            let bodies = run.scene().built().obstacles.len();
            [run.positions().len(), run.handles().len(), bodies]
        };
        let first = runs.first().map(size);
        let [vertices, handles, _] = first.ok_or_else(|| wrong("scenes are missing"))?;
        if let Some(other) = runs.iter().position(|run| Some(size(run)) != first) {
            return Err(wrong(format!(
                "scene {other} has {:?} vertices, handles and bodies, and the first {first:?}: worlds have as many",
                size(&runs[other])
            )));
        }
        let zeros = vec![0.0_f32; 3 * vertices * runs.len()];
        let buffer = zeros.into_pyarray(py).reshape([runs.len(), vertices, 3])?;
        let shown = buffer.call_method0("view")?;
        shown.getattr("flags")?.setattr("writeable", false)?;
        let worlds = Self {
            buffer: buffer.unbind(),
            positions: shown.unbind(),
            handles,
            runs: Mutex::new(runs),
        };
        worlds.show(py, &worlds.free()?)?;
        Ok(worlds)
    }

    /// Moves every world by a frame: its handles to its part of `targets` [m], (worlds, handles, 3),
    /// without them along the motions of the scenes; those in `released`, (worlds, handles) of bool, are
    /// let go during this frame. Returns for each world `None`, or the error for which it stayed.
    #[pyo3(signature = (targets=None, released=None))]
    fn step(
        &self,
        py: Python<'_>,
        targets: Option<Numbers<'_>>,
        released: Option<Vec<Vec<bool>>>,
    ) -> PyResult<Vec<Option<Py<PyAny>>>> {
        let mut runs = self.free()?;
        let mut all = Vec::new();
        if let Some(numbers) = &targets {
            let expected = [runs.len(), self.handles, 3];
            if numbers.shape() != expected {
                let found = numbers.shape();
                return Err(wrong(format!(
                    "targets must have the shape {expected:?}, found {found:?}"
                )));
            }
            let places = arrays::triples(numbers);
            for own in places.chunks(self.handles.max(1)) {
                all.push(HandleTargets::at_frame_end(own.to_vec()).map_err(raised)?);
            }
        } else if released.is_some() {
            for run in runs.iter_mut() {
                all.push(run.next_targets(run.samples()).map_err(raised)?);
            }
        }
        let mut released = released.into_iter().flatten();
        let all = all.into_iter().map(|own| match released.next() {
            Some(released) => own.releasing(released).map(Some),
            None => Ok(Some(own)),
        });
        let all = all.collect::<Result<Vec<_>, _>>().map_err(raised)?;
        let own = &mut runs[..];
        let done = py.detach(|| step_all(own, &all));
        self.show(py, &runs)?;
        let error = |done: Result<(), _>| match done {
            Ok(()) => None,
            Err(error) => Some(step_failed(py, error).into_value(py).into_any()),
        };
        Ok(done.into_iter().map(error).collect())
    }

    /// Momentum [N s] and angular momentum about the origin [N m s] that each body received in the last
    /// frame, (worlds, bodies, 2, 3), float64.
    #[getter]
    fn impulses<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray4<f64>>> {
        let runs = self.free()?;
        let all: Vec<DVec3> = runs.iter().flat_map(impulses_of).collect();
        let bodies = all.len() / (2 * runs.len());
        let numbers = arrays::flat_f64(&all).to_vec().into_pyarray(py);
        numbers.reshape([runs.len(), bodies, 2, 3])
    }

    /// Frames stepped, (worlds,).
    #[getter]
    fn frames(&self) -> PyResult<Vec<usize>> {
        Ok(self.free()?.iter().map(Run::frame).collect())
    }

    /// Leads a body of a world, as `Stepper.lead_body` does.
    fn lead_body(
        &self,
        py: Python<'_>,
        world: i64,
        #[pyo3(from_py_with = natural)] body: usize,
        matrix: Numbers<'_>,
    ) -> PyResult<()> {
        let away = rigid_of(&matrix)?;
        self.with(py, world, |run| {
            let led = run.lead_obstacle(body, away);
            led.map_err(|error| step_failed(py, error))
        })
    }

    /// Puts a world back to its start.
    fn reset(&self, py: Python<'_>, world: i64) -> PyResult<()> {
        self.with(py, world, |run| {
            run.reset().map_err(|error| step_failed(py, error))
        })
    }

    /// The state of a world, for `restore` of any world of the same scene.
    fn snapshot(&self, py: Python<'_>, world: i64) -> PyResult<Snapshot> {
        self.with(py, world, |run| {
            let state = run.snapshot().map(Snapshot);
            state.ok_or_else(|| wrong("this world cannot go back"))
        })
    }

    /// Puts a world into the state of a snapshot.
    fn restore(&self, py: Python<'_>, world: i64, snapshot: &Snapshot) -> PyResult<()> {
        self.with(py, world, |run| {
            let back = run.restore(&snapshot.0);
            back.map_err(|error| step_failed(py, error))
        })
    }

    fn __len__(&self) -> PyResult<usize> {
        Ok(self.free()?.len())
    }
}
