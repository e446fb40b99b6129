//! Arrays of numbers between NumPy and the libraries.
//!
//! What never changes (the frames of a trajectory, the faces of a mesh) is shared: the array points
//! into the memory of the object that made it, keeps that object alive and cannot be written.

use glam::{DVec2, DVec3, Vec3};
use numpy::ndarray::{ArrayView, Dimension, ShapeBuilder};
use numpy::{AllowTypeChange, Element, IntoPyArray, PyArray, PyArray1, PyArray2, PyArray3};
use numpy::{PyArrayLikeDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::PyClass;
use pyo3::exceptions::PyOverflowError;
use pyo3::prelude::*;
use pyo3::pyclass::boolean_struct::True;
use selvedge_cloth::{HandlePath, Handles, Topology};

use crate::errors::wrong;

/// Numbers that Python gave: an array, or what NumPy makes one of.
pub(crate) type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// An array of a shape that cannot be written, over the memory of the `values` of `owner`.
///
/// # Errors
/// Another number of values than the shape has.
#[allow(
    unsafe_code,
    reason = "NumPy is given an address; the owner of the memory becomes the base of the array"
)]
pub(crate) fn shared<'py, O, T: Element, D: Dimension>(
    owner: &Bound<'py, O>,
    values: impl FnOnce(&O) -> &[T],
    shape: impl ShapeBuilder<Dim = D>,
) -> PyResult<Bound<'py, PyArray<T, D>>>
where
    O: PyClass<Frozen = True> + Sync,
{
    let values = values(owner.get());
    let view = ArrayView::from_shape(shape, values).map_err(|error| wrong(error.to_string()))?;
    // SAFETY: the values are borrowed from `owner` alone for as long as anyone likes. It is frozen, so
    // that nobody has it mutably, and the array keeps it alive.
    let array = unsafe { PyArray::borrow_from_array(&view, owner.as_any().clone()) };
    lock(&array)?;
    Ok(array)
}

/// Lets nobody write to `array`.
pub(crate) fn lock<'py>(array: &Bound<'py, impl pyo3::PyTypeInfo>) -> PyResult<()> {
    array.as_any().getattr("flags")?.setattr("writeable", false)
}

/// Positions as numbers, three for each.
pub(crate) fn flat(positions: &[Vec3]) -> &[f32] {
    bytemuck::cast_slice(positions)
}

/// Positions in f64 as numbers, three for each.
pub(crate) fn flat_f64(positions: &[DVec3]) -> &[f64] {
    bytemuck::cast_slice(positions)
}

/// An array of its own of positions in f64, `[n, 3]`.
pub(crate) fn of_f64<'py>(
    py: Python<'py>,
    positions: &[DVec3],
) -> PyResult<Bound<'py, PyArray2<f64>>> {
    let count = positions.len();
    let numbers = flat_f64(positions).to_vec().into_pyarray(py);
    numbers.reshape([count, 3])
}

/// The faces of a mesh, `[faces, 3]`, that cannot be written.
pub(crate) fn faces_of(py: Python<'_>, topology: &Topology) -> PyResult<Py<PyArray2<u32>>> {
    let faces: Vec<u32> = topology.face_indices().into_iter().flatten().collect();
    let count = faces.len() / 3;
    let faces = faces.into_pyarray(py).reshape([count, 3])?;
    lock(&faces)?;
    Ok(faces.unbind())
}

/// Numbers of the held vertices, `[handles]`.
pub(crate) fn handles_of<'py>(py: Python<'py>, handles: &Handles) -> Bound<'py, PyArray1<u32>> {
    let vertices = handles.vertices().iter();
    vertices.map(|v| v.0).collect::<Vec<u32>>().into_pyarray(py)
}

/// Targets of handles for the step from frame `frame` on `[m]`, `[samples, handles, 3]`, at equally
/// spaced times of which the last is the end of the frame, at `rate` frames per second.
pub(crate) fn targets<'py>(
    py: Python<'py>,
    path: &HandlePath,
    (frame, samples): (usize, usize),
    rate: f64,
) -> PyResult<Bound<'py, PyArray3<f64>>> {
    let times = (1..=samples).map(|k| (frame as f64 + k as f64 / samples as f64) / rate);
    let places: Vec<DVec3> = times.flat_map(|time| path.at(time)).collect();
    let handles = path.at(0.0).len();
    let numbers = flat_f64(&places).to_vec().into_pyarray(py);
    numbers.reshape([samples, handles, 3])
}

/// Reads `[n, 3]` numbers as positions.
///
/// # Errors
/// Another shape; `what` names the argument.
pub(crate) fn positions(numbers: &Numbers<'_>, what: &str) -> PyResult<Vec<DVec3>> {
    match numbers.shape() {
        [_, 3] => Ok(triples(numbers)),
        found => Err(wrong(format!(
            "{what} must have the shape (n, 3), found {found:?}"
        ))),
    }
}

/// Reads `[n, 2]` numbers as material coordinates.
///
/// # Errors
/// Another shape; `what` names the argument.
pub(crate) fn pairs(numbers: &Numbers<'_>, what: &str) -> PyResult<Vec<DVec2>> {
    match numbers.shape() {
        [_, 2] => {
            let flat: Vec<f64> = numbers.as_array().iter().copied().collect();
            Ok(flat.chunks_exact(2).map(DVec2::from_slice).collect())
        }
        found => Err(wrong(format!(
            "{what} must have the shape (n, 2), found {found:?}"
        ))),
    }
}

/// The numbers three by three, whatever the shape before the last axis and their order in memory.
pub(crate) fn triples(numbers: &Numbers<'_>) -> Vec<DVec3> {
    let flat: Vec<f64> = numbers.as_array().iter().copied().collect();
    flat.chunks_exact(3).map(DVec3::from_slice).collect()
}

/// Whole numbers of Python, none below 0.
///
/// # Errors
/// A number that is negative or too large: a wrong argument, and no `OverflowError`.
pub(crate) fn natural<'py, T>(given: &Bound<'py, PyAny>) -> PyResult<T>
where
    for<'a> T: FromPyObject<'a, 'py, Error = PyErr>,
{
    given.extract().map_err(|error: PyErr| {
        if error.is_instance_of::<PyOverflowError>(given.py()) {
            wrong(format!("give a whole number from 0 on, found {given}"))
        } else {
            error
        }
    })
}
