//! Pictures that notebooks show.

use std::io::Write;
use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use selvedge_data::write_atomically;

use crate::errors::raised;

/// A picture (.png), which a notebook shows inline.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Picture {
    png: Vec<u8>,
}

impl Picture {
    pub(crate) fn of(png: Vec<u8>) -> Self {
        Self { png }
    }

    pub(crate) fn bytes<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.png)
    }
}

#[pymethods]
impl Picture {
    /// Writes the picture (.png).
    fn save(&self, path: PathBuf) -> PyResult<()> {
        write_atomically(&path, |out| out.write_all(&self.png)).map_err(raised)
    }

    /// The bytes of the file.
    #[getter]
    fn png<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        self.bytes(py)
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        self.bytes(py)
    }

    fn __repr__(&self) -> String {
        format!("Picture({} bytes)", self.png.len())
    }
}
