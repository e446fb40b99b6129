//! What the libraries write as JSON, as Python's own dictionaries and lists.

use pyo3::prelude::*;
use pyo3::types::PyDict;
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

/// Reads a value from a dictionary, which may have arrays and numbers of NumPy, or from the text of one.
pub(crate) fn from_python<T: serde::de::DeserializeOwned>(value: &Bound<'_, PyAny>) -> PyResult<T> {
    let text: String = match value.extract() {
        Ok(text) => text,
        Err(_) => {
            let py = value.py();
            let options = PyDict::new(py);
            let to_list = py
                .import("operator")?
                .call_method1("methodcaller", ("tolist",))?;
            options.set_item("default", to_list)?;
            let json = py.import("json")?;
            json.call_method("dumps", (value,), Some(&options))?
                .extract()?
        }
    };
    serde_json::from_str(&text).map_err(raised)
}
