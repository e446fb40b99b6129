//! The arrays of a foreign folder: .npy files of a known shape, their numbers checked.

use std::path::Path;

use super::error::{ForeignError, ForeignProblem};
use crate::formats::input::read_file;
use crate::formats::npy;

/// Numbers and their shape.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Array<T> {
    pub(super) shape: Vec<usize>,
    /// Row by row.
    pub(super) values: Vec<T>,
}

/// Reads floating-point numbers, all finite. `shape` has `None` where any length will do.
pub(super) fn read_floats(
    path: &Path,
    shape: &[Option<usize>],
) -> Result<Array<f64>, ForeignError> {
    read(path, shape, floats)
}

/// Reads numbers of vertices.
pub(super) fn read_indices(
    path: &Path,
    shape: &[Option<usize>],
) -> Result<Array<u32>, ForeignError> {
    read(path, shape, indices)
}

fn read<T>(
    path: &Path,
    shape: &[Option<usize>],
    numbers: impl Fn(&npy::Array) -> Result<Vec<T>, ForeignProblem>,
) -> Result<Array<T>, ForeignError> {
    let array = || {
        let array = npy::Array::parse(&read_file(path).map_err(ForeignProblem::Read)?)?;
        let values = numbers(&array)?;
        array.expect_shape(shape)?;
        let shape = array.shape;
        Ok(Array { shape, values })
    };
    array().map_err(|problem| ForeignError {
        path: path.to_owned(),
        problem,
    })
}

fn floats(array: &npy::Array) -> Result<Vec<f64>, ForeignProblem> {
    let values = array.floats()?;
    match values.iter().position(|v| !v.is_finite()) {
        None => Ok(values),
        Some(element) => Err(ForeignProblem::Element {
            element,
            found: values[element].to_string(),
            why: "every number must be finite",
        }),
    }
}

fn indices(array: &npy::Array) -> Result<Vec<u32>, ForeignProblem> {
    let values = array.integers()?.into_iter().enumerate();
    values
        .map(|(element, value)| {
            u32::try_from(value).map_err(|_| ForeignProblem::Element {
                element,
                found: value.to_string(),
                why: "a vertex has a number from 0 to 4294967295",
            })
        })
        .collect()
}
