//! What the libraries write as JSON, as Python's own dictionaries and lists.

use pyo3::prelude::*;
use serde::Serialize;

use crate::errors::raised;

/// A value as Python has it.
pub(crate) fn to_python<'py>(
    py: Python<'py>,
    value: &impl Serialize,
) -> PyResult<Bound<'py, PyAny>> {
    let text = serde_json::to_string(value).map_err(raised)?;
    py.import("json")?.call_method1("loads", (text,))
}

/// Reads a value from a dictionary, or from the text of one.
pub(crate) fn from_python<T: serde::de::DeserializeOwned>(value: &Bound<'_, PyAny>) -> PyResult<T> {
    let text: String = match value.extract() {
        Ok(text) => text,
        Err(_) => {
            let json = value.py().import("json")?;
            json.call_method1("dumps", (value,))?.extract()?
        }
    };
    serde_json::from_str(&text).map_err(raised)
}
