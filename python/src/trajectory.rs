//! Recordings of a cloth over time.

use std::io::Write;
use std::path::PathBuf;
use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use selvedge_cloth::Drape;
use selvedge_data::Trajectory as Recorded;
use selvedge_data::foreign::{TrajectoryParts, Weight};
use selvedge_data::write_atomically;
use selvedge_lab::physics;
use selvedge_lab::pictures::{self, Show};

use crate::arrays::{self, Numbers, natural};
use crate::errors::{raised, word, wrong};
use crate::exporting;
use crate::json;
use crate::long::beside_reporting;
use crate::pickling::{self, Call};
use crate::picture::Picture;

/// A cloth and its positions over time: what simulations, rollouts and data sets are made of.
///
/// `Trajectory(positions, faces, material, handles, frame_rate, ...)` makes one of arrays; without
/// material (None) each face rests in the shape that it has in `rest`.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Trajectory {
    pub(crate) inner: Arc<Recorded>,
    /// Faces, (f, 3), uint32.
    #[pyo3(get)]
    faces: Py<PyArray2<u32>>,
}

impl Trajectory {
    pub(crate) fn of(py: Python<'_>, inner: Recorded) -> PyResult<Self> {
        let faces = arrays::faces_of(py, inner.topology())?;
        let inner = Arc::new(inner);
        Ok(Self { inner, faces })
    }

    /// The measures of `other` against this one.
    pub(crate) fn compared<'py>(
        &self,
        py: Python<'py>,
        other: &Self,
    ) -> PyResult<Bound<'py, PyAny>> {
        let measures = py.detach(|| physics::compare(&self.inner, &other.inner));
        json::to_python(py, &measures.map_err(raised)?)
    }

    /// A contact sheet, beside a truth where there is one.
    pub(crate) fn drawn(&self, py: Python<'_>, truth: Option<&Self>) -> PyResult<Picture> {
        let title = self.name();
        let show = self.show(&title, truth);
        let png = py.detach(|| pictures::sheet(&show)).map_err(raised)?;
        Ok(Picture::of(png))
    }

    fn show<'a>(&'a self, title: &'a str, truth: Option<&'a Self>) -> Show<'a> {
        Show {
            title,
            label: if truth.is_some() { pictures::MODEL } else { "" },
            prediction: &self.inner,
            truth: truth.map(|truth| truth.inner.as_ref()),
        }
    }

    fn name(&self) -> String {
        let scene = &self.inner.provenance().scene;
        scene["name"].as_str().unwrap_or_default().to_owned()
    }
}

#[pymethods]
impl Trajectory {
    #[new]
    #[pyo3(signature = (positions, faces, material, handles, frame_rate, *, density=None, masses=None, areas=None, rest=None))]
    fn new(
        py: Python<'_>,
        positions: Numbers<'_>,
        faces: Vec<[u32; 3]>,
        material: Option<Numbers<'_>>,
        handles: Vec<u32>,
        frame_rate: f64,
        density: Option<f64>,
        masses: Option<Vec<f32>>,
        areas: Option<Vec<f32>>,
        rest: Option<Numbers<'_>>,
    ) -> PyResult<Self> {
        let material = material.map(|flat| arrays::pairs(&flat, "material"));
        let material = material.transpose()?;
        let count = match (positions.shape(), &material) {
            ([(1..), found, 3], None) => *found,
            ([(1..), found, 3], Some(flat)) if *found == flat.len() => *found,
            (found, flat) => {
                let count = flat.as_ref().map_or(0, Vec::len);
                return Err(wrong(format!(
                    "positions must have the shape (frames, {count}, 3), found {found:?}"
                )));
            }
        };
        let positions = arrays::triples(&positions);
        let rest = match &rest {
            Some(rest) => arrays::positions(rest, "rest")?,
            None => positions[..count].to_vec(),
        };
        let weight = match (density, masses, areas) {
            (Some(density), None, None) => Weight::Density(density),
            (None, Some(mass), Some(area)) => Weight::Given { mass, area },
            _ => return Err(wrong("give either density, or masses and areas")),
        };
        let parts = TrajectoryParts {
            faces,
            material,
            rest,
            positions,
            handles,
            weight,
            frame_rate,
            made_by: "from arrays".to_owned(),
        };
        let made = py.detach(|| parts.trajectory()).map_err(raised)?;
        Self::of(py, made)
    }

    /// Reads a trajectory (.safetensors).
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = py.detach(|| Recorded::read(&path)).map_err(raised)?;
        Self::of(py, read)
    }

    /// Writes the trajectory (.safetensors), whole or not at all.
    fn write(&self, py: Python<'_>, path: PathBuf) -> PyResult<()> {
        py.detach(|| self.inner.write(&path)).map_err(raised)
    }

    /// The bytes of the trajectory's file.
    fn to_bytes<'py>(&self, py: Python<'py>) -> Bound<'py, pyo3::types::PyBytes> {
        let bytes = py.detach(|| self.inner.to_bytes());
        pyo3::types::PyBytes::new(py, &bytes)
    }

    /// Positions of all frames [m], (frames, n, 3), float32; shared, not copied.
    #[getter]
    fn positions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray3<f32>>> {
        let inner = &slf.get().inner;
        let shape = (inner.frame_count(), inner.vertex_count(), 3);
        arrays::shared(slf, |own| arrays::flat(own.inner.positions()), shape)
    }

    /// Positions of the cloth at rest [m], (n, 3), float32; shared, not copied.
    #[getter]
    fn rest_positions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f32>>> {
        let count = slf.get().inner.vertex_count();
        let shape = (count, 3);
        arrays::shared(
            slf,
            |own| arrays::flat(own.inner.cloth().rest_positions()),
            shape,
        )
    }

    /// Mass of each vertex [kg], (n,), float32; shared, not copied.
    #[getter]
    fn masses<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f32>>> {
        let count = slf.get().inner.vertex_count();
        arrays::shared(slf, |own| own.inner.cloth().vertex_mass(), count)
    }

    /// Edges, (e, 2), uint32.
    #[getter]
    fn edges<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyArray2<u32>>> {
        use numpy::PyArrayMethods;
        let edges = self.inner.topology().edges();
        let ends: Vec<u32> = edges.iter().flat_map(|e| e.vertices.map(|v| v.0)).collect();
        ends.into_pyarray(py).reshape([edges.len(), 2])
    }

    /// Numbers of the held vertices, (handles,), uint32.
    #[getter]
    fn handles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        arrays::handles_of(py, self.inner.handles())
    }

    /// Frames per second.
    #[getter]
    fn frame_rate(&self) -> f64 {
        self.inner.frame_rate()
    }

    /// The resolved scene that it is from, as a dictionary; `None` where it is not known.
    #[getter]
    fn scene<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        json::to_python(py, &self.inner.provenance().scene)
    }

    /// The measures of `other` against this trajectory of the same mesh, in SI units.
    fn compare<'py>(&self, py: Python<'py>, other: &Self) -> PyResult<Bound<'py, PyAny>> {
        self.compared(py, other)
    }

    /// The measures of the last frame of a drape test, in SI units; `None` of any other cloth.
    fn drape<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let last = self.inner.frame(self.inner.frame_count() - 1);
        json::to_python(py, &Drape::of(self.inner.cloth(), last))
    }

    /// Writes the trajectory for other programs, in the format that the name ends in. `frames` is a
    /// span such as "20..80", of which `every` n-th frame is taken; `up` is "y" or "z".
    #[pyo3(signature = (path, frames=None, every=1, up="y", progress=None))]
    fn export(
        &self,
        py: Python<'_>,
        path: PathBuf,
        frames: Option<&str>,
        #[pyo3(from_py_with = natural)] every: usize,
        up: &str,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let options = exporting::options(&path, frames, every, word("up", up)?)?;
        exporting::export_to(py, &self.inner, &path, &options, progress)
    }

    /// A picture of one frame.
    #[pyo3(signature = (frame=-1, size=[960, 720]))]
    fn picture(&self, py: Python<'_>, frame: isize, size: [u32; 2]) -> PyResult<Picture> {
        let count = self.inner.frame_count();
        let wanted = if frame < 0 { frame + count as isize } else { frame };
        let wanted = usize::try_from(wanted).unwrap_or(usize::MAX);
        let png = py.detach(|| pictures::picture(&self.inner, wanted, size));
        Ok(Picture::of(png.map_err(raised)?))
    }

    /// A contact sheet of even moments; beside a `truth` of as many frames, with the error.
    #[pyo3(signature = (truth=None))]
    fn sheet(&self, py: Python<'_>, truth: Option<&Self>) -> PyResult<Picture> {
        self.drawn(py, truth)
    }

    /// A contact sheet in the colours of the strain.
    fn strain_sheet(&self, py: Python<'_>) -> PyResult<Picture> {
        let title = self.name();
        let png = py.detach(|| pictures::strain_sheet(&title, &self.inner));
        Ok(Picture::of(png.map_err(raised)?))
    }

    /// Writes a clip (.gif) in real time, beside a `truth` of as many frames where there is one.
    #[pyo3(signature = (path, truth=None, progress=None))]
    fn clip(
        &self,
        py: Python<'_>,
        path: PathBuf,
        truth: Option<&Self>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<()> {
        let title = self.name();
        let show = self.show(&title, truth);
        let count = pictures::clip_pictures(&self.inner);
        beside_reporting(py, progress, |_, reporter| {
            reporter.begin("drawing the clip", Some(count as u64));
            let mut gif = Vec::new();
            // A clip that was stopped is told by `beside_reporting`.
            let _ = pictures::clip(&mut gif, &show, &mut || reporter.advance()).map_err(raised)?;
            write_atomically(&path, |out| out.write_all(&gif)).map_err(raised)
        })?
    }

    fn __len__(&self) -> usize {
        self.inner.frame_count()
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Call<'py>> {
        pickling::call(py, "_trajectory", (self.to_bytes(py),))
    }

    fn _repr_png_<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, pyo3::types::PyBytes>> {
        Ok(self.drawn(py, None)?.bytes(py))
    }

    fn __repr__(&self) -> String {
        let (frames, vertices) = (self.inner.frame_count(), self.inner.vertex_count());
        format!("Trajectory({frames} frames, {vertices} vertices)")
    }
}
