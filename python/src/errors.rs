//! Errors of the libraries as Python exceptions, with their own words.

use std::error::Error;

use pyo3::create_exception;
use pyo3::exceptions::{PyException, PyValueError};
use pyo3::prelude::*;
use selvedge::cause;
use selvedge_cloth::StepError;
use serde::Deserialize;
use serde::de::IntoDeserializer;
use serde::de::value::Error as WordError;

create_exception!(
    selvedge,
    SelvedgeError,
    PyException,
    "Something that could not be done. The message names the file, field, frame or vertex, and the remedy."
);
create_exception!(
    selvedge,
    FrameError,
    SelvedgeError,
    "A frame that could not be reached. `frame` is its number; the stepper is as it was before."
);

/// An error with its causes as an exception.
pub(crate) fn raised(error: impl Into<Box<dyn Error + Send + Sync>>) -> PyErr {
    SelvedgeError::new_err(cause::chain(&*error.into()))
}

/// A wrong argument as an exception.
pub(crate) fn wrong(problem: impl Into<String>) -> PyErr {
    PyValueError::new_err(problem.into())
}

/// The value of an argument that is one of a few words, as files have them.
pub(crate) fn word<'w, T: Deserialize<'w>>(argument: &str, word: &'w str) -> PyResult<T> {
    let read = T::deserialize(word.into_deserializer());
    read.map_err(|error: WordError| wrong(format!("{argument}: {error}")))
}

/// A step that failed as an exception with the number of its frame; a body that does not exist is a
/// wrong argument.
pub(crate) fn step_failed(py: Python<'_>, error: StepError) -> PyErr {
    if matches!(error, StepError::Obstacle { .. }) {
        return wrong(error.to_string());
    }
    let frame = error.frame();
    let exception = FrameError::new_err(cause::chain(&error));
    match exception.value(py).setattr("frame", frame) {
        Ok(()) => exception,
        Err(problem) => problem,
    }
}
