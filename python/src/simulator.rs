//! The solver: steps, its state, and the gradients of a run.

use glam::{DVec2, DVec3};
use numpy::{IntoPyArray, PyArray2, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};
use selvedge::{Gradient, GradientError, GradientSettings, Run};
use selvedge_sim::{Checkpoint, Simulator as Physics};

use crate::arrays::{self, Numbers};
use crate::errors::{SelvedgeError, raised, wrong};
use crate::long::{Progress, beside_reporting};
use crate::pickling::{self, Call};
use crate::scene::Scene;
use crate::stepper::Stepper;

/// The reference physics of a scene: cloth with measured stiffness, gravity, air and contact. The
/// state is float64; `positions` are its float32 copies.
///
/// `Simulator(scene, positions=None, velocities=None)` starts where the scene says (by default in
/// its sagged rest pose, which is searched for), or at positions (n, 3) [m] with velocities (n, 3)
/// [m/s].
#[pyclass(frozen, extends = Stepper, module = "selvedge")]
pub(crate) struct Simulator;

#[pymethods]
impl Simulator {
    #[new]
    #[pyo3(signature = (scene, positions=None, velocities=None, progress=None))]
    fn new<'py>(
        py: Python<'py>,
        scene: &Bound<'py, Scene>,
        positions: Option<Numbers<'_>>,
        velocities: Option<Numbers<'_>>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let given = state_at(positions.as_ref(), velocities.as_ref())?;
        let own = given.as_ref();
        let places = own.map(|state| arrays::of_f64(py, &state.positions));
        let speeds = own.map(|state| arrays::of_f64(py, &state.velocities));
        let made = (scene, places.transpose()?, speeds.transpose()?).into_pyobject(py)?;
        Self::begun(scene, given, made, progress)
    }

    /// Positions of the state [m], (n, 3), a float64 copy.
    fn state_positions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        physics_of(slf, |physics| {
            arrays::of_f64(slf.py(), physics.positions_f64())
        })
    }

    /// Velocities of the state [m/s], (n, 3), a float64 copy.
    fn state_velocities<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        physics_of(slf, |physics| {
            arrays::of_f64(slf.py(), physics.velocities_f64())
        })
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Call<'py>> {
        let state = physics_of(slf, |physics| {
            serde_json::to_string(&physics.checkpoint()).map_err(raised)
        })?;
        let scene = slf.as_super().get().made.bind(slf.py()).get_item(0)?;
        pickling::call(slf.py(), "_simulator", (scene, state))
    }

    /// Records the steps from here on, so that `backward` can differentiate them; they keep their
    /// bytes. `restore` and `reset` end the recording. Beyond `memory` bytes the oldest frames are
    /// computed again.
    ///
    /// Raises `SelvedgeError` for a law that has no energy, and for contact with the formula `linearised`.
    #[pyo3(signature = (memory=GradientSettings::default().memory))]
    fn record_gradient(slf: &Bound<'_, Self>, memory: usize) -> PyResult<()> {
        let settings = GradientSettings {
            memory,
            ..GradientSettings::default()
        };
        let mut core = slf.as_super().get().free()?;
        core.kind.run()?.record_gradient(settings).map_err(raised)
    }

    /// The derivatives of a value of the recorded frames, a dictionary. `positions` (frames + 1, n, 3)
    /// are the value's derivatives by the positions of each frame since `record_gradient`, the start
    /// first, `velocities` those by the velocities. It has, all float64: `positions`, `velocities`
    /// (n, 3) by the start; `targets` (frames, samples, handles, 3); `obstacles` (frames + 1, obstacles,
    /// 2, 3) by a translation and a rotation about the origin of each; `gravity`, `wind` (3,);
    /// `air_density`, `air_drag`; `rest_angles` (edges,); `pattern` (points, 2) by the points of the pattern,
    /// of which point v is that of vertex v; and `materials`, a list of dictionaries with `density`, `damping`,
    /// `stretch` (6, 4) and `bend` (3, 5).
    #[pyo3(signature = (positions=None, velocities=None))]
    fn backward<'py>(
        slf: &Bound<'py, Self>,
        positions: Option<Numbers<'_>>,
        velocities: Option<Numbers<'_>>,
    ) -> PyResult<Bound<'py, PyDict>> {
        let py = slf.py();
        let seeds = |numbers: &Option<Numbers<'_>>, what: &str| match numbers {
            None => Ok(None),
            Some(numbers) => match numbers.shape() {
                [_, n, 3] => Ok(Some((*n, arrays::triples(numbers)))),
                found => Err(wrong(format!(
                    "{what} must have the shape (frames + 1, n, 3), found {found:?}"
                ))),
            },
        };
        let seeds = [
            seeds(&positions, "positions")?,
            seeds(&velocities, "velocities")?,
        ];
        let mut core = slf.as_super().get().free()?;
        let run = core.kind.run()?;
        let vertices = run.positions().len();
        let frames = run.solver().and_then(|solver| solver.recorded_frames());
        for (n, by) in seeds.iter().flatten() {
            let found = by.len() / n.max(&1);
            let expected = frames.map_or(found, |frames| frames + 1);
            if *n != vertices || found != expected {
                return Err(wrong(format!(
                    "derivatives must have the shape ({expected}, {vertices}, 3), one for each recorded frame and the start, found ({found}, {n}, 3)"
                )));
            }
        }
        let add = |frame: usize, into: &mut [DVec3], seed: &Option<(usize, Vec<DVec3>)>| {
            if let Some((n, seed)) = seed {
                let of_frame = &seed[frame * n..(frame + 1) * n];
                into.iter_mut()
                    .zip(of_frame)
                    .for_each(|(into, by)| *into += *by);
            }
        };
        let made = py.detach(|| {
            run.backward(&mut |frame, by| {
                add(frame, &mut by.positions, &seeds[0]);
                add(frame, &mut by.velocities, &seeds[1]);
            })
        });
        let made = made.map_err(|error| match error {
            GradientError::NotFinite { .. } => wrong(error.to_string()),
            _ => raised(error),
        });
        gradient_dict(py, made?, slf.as_super().get().handles.len())
    }

    /// Kinetic energy [J].
    #[getter]
    fn kinetic_energy(slf: &Bound<'_, Self>) -> PyResult<f64> {
        physics_of(slf, |physics| Ok(physics.kinetic_energy()))
    }
}

impl Simulator {
    fn begun<'py>(
        scene: &Bound<'py, Scene>,
        given: Option<Checkpoint>,
        made: Bound<'py, PyTuple>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<PyClassInitializer<Self>> {
        let own = scene.get();
        let run = beside_reporting(scene.py(), progress, |_, reporter| {
            begin(own, given, reporter)
        })??;
        Ok(PyClassInitializer::from(Stepper::of_run(made, run)?).add_subclass(Self))
    }
}

/// The solver in a state that was pickled.
#[pyfunction]
pub(crate) fn _simulator(scene: &Bound<'_, Scene>, state: &str) -> PyResult<Py<Simulator>> {
    let state = serde_json::from_str(state).map_err(raised)?;
    let made = (scene,).into_pyobject(scene.py())?;
    let begun = Simulator::begun(scene, Some(state), made, None)?;
    Py::new(scene.py(), begun)
}

/// A gradient as a dictionary of arrays.
fn gradient_dict<'py>(
    py: Python<'py>,
    gradient: Gradient,
    handles: usize,
) -> PyResult<Bound<'py, PyDict>> {
    let made = PyDict::new(py);
    made.set_item("positions", arrays::of_f64(py, &gradient.start.positions)?)?;
    let velocities = arrays::of_f64(py, &gradient.start.velocities)?;
    made.set_item("velocities", velocities)?;
    let frames = gradient.targets.len();
    let targets = gradient.targets.concat();
    let samples = targets.len() / (frames * handles).max(1);
    let targets = arrays::flat_f64(&targets).to_vec().into_pyarray(py);
    made.set_item("targets", targets.reshape([frames, samples, handles, 3])?)?;
    let obstacles = gradient.obstacles.iter().flatten();
    let motions = obstacles.flat_map(|by| [by.translation, by.rotation]);
    let motions: Vec<DVec3> = motions.collect();
    let bodies = motions.len() / (2 * gradient.obstacles.len()).max(1);
    let motions = arrays::flat_f64(&motions).to_vec().into_pyarray(py);
    made.set_item("obstacles", motions.reshape([frames + 1, bodies, 2, 3])?)?;
    for (name, vector) in [("gravity", gradient.gravity), ("wind", gradient.wind)] {
        made.set_item(name, vector.to_array().to_vec().into_pyarray(py))?;
    }
    made.set_item("air_density", gradient.air_density)?;
    made.set_item("air_drag", gradient.air_drag)?;
    made.set_item("rest_angles", gradient.rest_angles.into_pyarray(py))?;
    let table = |flat: &[f64], columns: usize| {
        let rows = flat.len() / columns;
        flat.to_vec().into_pyarray(py).reshape([rows, columns])
    };
    let points: Vec<f64> = gradient.pattern.iter().flat_map(DVec2::to_array).collect();
    made.set_item("pattern", table(&points, 2)?)?;
    let materials = PyList::empty(py);
    for material in &gradient.materials {
        let by = PyDict::new(py);
        by.set_item("density", material.density)?;
        by.set_item("damping", material.damping)?;
        by.set_item("stretch", table(material.stretch.as_flattened(), 4)?)?;
        by.set_item("bend", table(material.bend.as_flattened(), 5)?)?;
        materials.append(by)?;
    }
    made.set_item("materials", materials)?;
    Ok(made)
}

fn physics_of<R>(
    slf: &Bound<'_, Simulator>,
    read: impl FnOnce(&Physics) -> PyResult<R>,
) -> PyResult<R> {
    let stepper = slf.as_super().get();
    match stepper.free()?.kind.run()?.solver() {
        Some(physics) => read(physics),
        None => Err(SelvedgeError::new_err("this is no solver")),
    }
}

/// The state that Python gave; none where it gave none.
pub(crate) fn state_at(
    positions: Option<&Numbers<'_>>,
    velocities: Option<&Numbers<'_>>,
) -> PyResult<Option<Checkpoint>> {
    let Some(positions) = positions else {
        return match velocities {
            None => Ok(None),
            Some(_) => Err(wrong("positions are missing: velocities are of a state")),
        };
    };
    let positions = arrays::positions(positions, "positions")?;
    let velocities = match velocities {
        Some(velocities) => arrays::positions(velocities, "velocities")?,
        None => vec![DVec3::ZERO; positions.len()],
    };
    Ok(Some(Checkpoint::of(0, positions, velocities)))
}

/// The solver on a scene, from where the scene says or from a state. Long work: the lock must be
/// released.
pub(crate) fn begin(
    scene: &Scene,
    given: Option<Checkpoint>,
    reporter: &mut Progress<'_>,
) -> PyResult<Run> {
    let scene = match given {
        Some(state) => &scene.run.from_state(state),
        None => &scene.run,
    };
    Run::begin(scene, &mut |event| reporter.on_event(event)).map_err(raised)
}
