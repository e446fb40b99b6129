//! Scenes, meshes and materials.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use numpy::{IntoPyArray, PyArray1, PyArray2, PyArray3, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use selvedge_cloth::generate::{Shape, SheetSpec, sheet};
use selvedge_cloth::{
    Handles, Material as ClothMaterial, Mesh as ClothMesh, Motion, RecordedMotion,
};
use selvedge_data::{
    LoadedScene, MeshOptions, materials, open_material, open_scene, parse_scene, read_mesh,
    shipped_scenes,
};
use selvedge_sim::SaggedRest;

use crate::arrays::{self, Numbers, natural};
use crate::errors::{raised, wrong};
use crate::json;
use crate::long::{Progress, beside_reporting};
use crate::pickling::{self, Call};

/// Targets of a frame that one call gives, at most.
const MOST_SAMPLES: usize = 1 << 16;

/// A mesh of triangles with its material coordinates, before anything moves it.
///
/// `Mesh(positions, faces, material=None)` takes positions (n, 3) [m], faces (f, 3), and material
/// coordinates (n, 2) [m]; without these the mesh must be flat in a plane x = constant, where they
/// are (z, y).
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Mesh {
    pub(crate) mesh: ClothMesh,
    labels: std::collections::BTreeMap<String, Vec<u32>>,
    /// The call that makes it again.
    made: Made,
    /// Faces, (f, 3), uint32.
    #[pyo3(get)]
    faces: Py<PyArray2<u32>>,
}

/// How a mesh was made.
enum Made {
    OfArrays,
    Read(PathBuf),
    Generated(SheetSpec),
}

impl Mesh {
    fn of(
        py: Python<'_>,
        mesh: ClothMesh,
        labels: std::collections::BTreeMap<String, Vec<u32>>,
        made: Made,
    ) -> PyResult<Self> {
        let faces = arrays::faces_of(py, mesh.topology())?;
        Ok(Self {
            mesh,
            labels,
            made,
            faces,
        })
    }
}

#[pymethods]
impl Mesh {
    #[new]
    #[pyo3(signature = (positions, faces, material=None))]
    fn new(
        py: Python<'_>,
        positions: Numbers<'_>,
        faces: Numbers<'_>,
        material: Option<Numbers<'_>>,
    ) -> PyResult<Self> {
        let positions = arrays::positions(&positions, "positions")?;
        let faces = corners(&faces)?;
        let material = match material {
            Some(material) => arrays::pairs(&material, "material")?,
            None => flat_coordinates(&positions)?,
        };
        let mesh = ClothMesh::new(&faces, material, positions).map_err(raised)?;
        Self::of(py, mesh, Default::default(), Made::OfArrays)
    }

    /// Reads a mesh from a file (.obj, .glb, .usda).
    #[staticmethod]
    fn read(py: Python<'_>, path: PathBuf) -> PyResult<Self> {
        let read = py.detach(|| read_mesh(&path, MeshOptions::default()));
        let read = read.map_err(raised)?;
        for warning in &read.warnings {
            tracing::warn!("{}: {warning}", path.display());
        }
        let path = Made::Read(pickling::absolute(&path));
        Self::of(py, read.sheet.mesh, read.sheet.labels, path)
    }

    /// An irregular sheet that hangs flat: `shape` is square, long, wide, triangle, diamond, disc,
    /// l-shape, holed, random, rectangle or tube; `size` [m] is the side of a square, or the height;
    /// `seed` places the inner vertices; `width` [m] is that of a rectangle, or the way around a tube.
    #[staticmethod]
    #[pyo3(signature = (shape="square", vertices=400, size=1.0, seed=1, width=None))]
    fn generate(
        py: Python<'_>,
        shape: &str,
        #[pyo3(from_py_with = natural)] vertices: usize,
        size: f64,
        #[pyo3(from_py_with = natural)] seed: u64,
        width: Option<f64>,
    ) -> PyResult<Self> {
        let shape: Shape = serde_json::from_value(shape.into()).map_err(raised)?;
        let spec = SheetSpec {
            shape,
            vertices,
            size,
            width,
            seed,
        };
        let made = py.detach(|| sheet(&spec)).map_err(raised)?;
        Self::of(py, made.mesh, made.labels, Made::Generated(spec))
    }

    /// Start positions [m], (n, 3), float64; shared, not copied.
    #[getter]
    fn positions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let shape = (slf.get().mesh.positions().len(), 3);
        arrays::shared(slf, |own| arrays::flat_f64(own.mesh.positions()), shape)
    }

    /// Lists of vertices by their names.
    #[getter]
    fn labels<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let labels = PyDict::new(py);
        for (name, vertices) in &self.labels {
            labels.set_item(name, vertices.clone().into_pyarray(py))?;
        }
        Ok(labels)
    }

    fn __repr__(&self) -> String {
        let topology = self.mesh.topology();
        let (vertices, faces) = (topology.vertex_count(), topology.faces().len());
        format!("Mesh({vertices} vertices, {faces} faces)")
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> PyResult<Call<'py>> {
        let (py, own, class) = (slf.py(), slf.get(), slf.get_type());
        // Methods of a class cannot be pickled; what calls them can.
        let caller = py.import("operator")?.getattr("methodcaller")?;
        let call = match &own.made {
            Made::OfArrays => {
                let places = own.mesh.material_coordinates().iter();
                let places: Vec<[f64; 2]> = places.map(|p| [p.x, p.y]).collect();
                let arrays = (Self::positions(slf)?, &own.faces, places);
                return Ok((class.into_any(), arrays.into_pyobject(py)?));
            }
            Made::Read(path) => caller.call1(("read", path))?,
            Made::Generated(spec) => {
                let shape = serde_json::to_value(spec.shape).map_err(raised)?;
                let shape = shape.as_str().unwrap_or_default();
                let (vertices, size) = (spec.vertices, spec.size);
                caller.call1(("generate", shape, vertices, size, spec.seed, spec.width))?
            }
        };
        Ok((call, (class,).into_pyobject(py)?))
    }
}

fn corners(faces: &Numbers<'_>) -> PyResult<Vec<[u32; 3]>> {
    let is_vertex = |x: f64| x >= 0.0 && x <= f64::from(u32::MAX) && x.fract() == 0.0;
    let whole = arrays::positions(faces, "faces")?;
    let corner = |face: &glam::DVec3| match face.to_array() {
        numbers if numbers.into_iter().all(is_vertex) => Ok(numbers.map(|x| x as u32)),
        numbers => Err(wrong(format!(
            "faces must be numbers of vertices, found {numbers:?}"
        ))),
    };
    whole.iter().map(corner).collect()
}

fn flat_coordinates(positions: &[glam::DVec3]) -> PyResult<Vec<glam::DVec2>> {
    if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
        return Err(wrong(format!(
            "positions must be finite, and those of vertex {vertex} are not"
        )));
    }
    let first = positions.first().map_or(0.0, |p| p.x);
    match positions.iter().position(|p| p.x != first) {
        None => Ok(positions
            .iter()
            .map(|p| glam::DVec2::new(p.z, p.y))
            .collect()),
        Some(vertex) => Err(wrong(format!(
            "material is missing: vertex {vertex} is not in the plane x = {first} of vertex 0, so that the mesh does not say what the cloth is like when flat; give material coordinates (n, 2) in metres"
        ))),
    }
}

/// The constants of a fabric.
///
/// `Material(name_or_file)` opens a shipped fabric by its name, or a fabric of a TOML file.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Material {
    pub(crate) material: ClothMaterial,
}

#[pymethods]
impl Material {
    #[new]
    fn new(name_or_file: PathBuf) -> PyResult<Self> {
        let material = open_material(&name_or_file.to_string_lossy()).map_err(raised)?;
        Ok(Self { material })
    }

    /// A material by its values, as `to_dict` has them; `source`, `damping` and `compression` may be
    /// missing.
    #[staticmethod]
    fn from_dict(values: &Bound<'_, PyAny>) -> PyResult<Self> {
        let material: ClothMaterial = json::from_python(values)?;
        material.validate().map_err(raised)?;
        Ok(Self { material })
    }

    /// Names of the shipped fabrics.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        materials().iter().map(|material| material.0).collect()
    }

    /// Name.
    #[getter]
    fn name(&self) -> &str {
        &self.material.name
    }

    /// Mass per area [kg/m²].
    #[getter]
    fn density(&self) -> f64 {
        self.material.density
    }

    /// Everything as a dictionary, in SI units; `compression` has the pressures at a `half` and a
    /// `third` of `contact.thickness` [Pa].
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let values = json::to_python(py, &self.material)?;
        // Files leave out the usual one.
        let compression = json::to_python(py, &self.material.compression)?;
        values.set_item("compression", compression)?;
        Ok(values)
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Call<'py>> {
        let values = serde_json::to_string(&self.material).map_err(raised)?;
        pickling::call(py, "_material", (values,))
    }

    fn __repr__(&self) -> String {
        format!("Material({:?})", self.material.name)
    }
}

/// A mesh, its handles, its material, its surroundings and a motion of the handles.
///
/// `Scene(name_or_file)` opens a file (.toml, ARCSim's .json) or a shipped scene by its name.
#[pyclass(frozen, module = "selvedge")]
pub(crate) struct Scene {
    pub(crate) loaded: LoadedScene,
    /// The same as it is run.
    pub(crate) run: selvedge::Scene,
    /// False where arrays of Python are in it, which its spec does not have.
    pub(crate) has_spec: bool,
    /// The mesh that was put in the place of its own.
    own_mesh: Option<Py<Mesh>>,
    /// The folder to which its files are relative.
    folder: PathBuf,
    /// Faces, (f, 3), uint32.
    #[pyo3(get)]
    faces: Py<PyArray2<u32>>,
}

impl Scene {
    pub(crate) fn of(
        py: Python<'_>,
        loaded: LoadedScene,
        own_mesh: Option<Py<Mesh>>,
        folder: PathBuf,
    ) -> PyResult<Self> {
        for warning in &loaded.warnings {
            tracing::warn!("{}: {warning}", loaded.spec.name);
        }
        let faces = arrays::faces_of(py, loaded.scene.mesh.topology())?;
        let spec = own_mesh.is_none().then(|| loaded.spec.clone());
        Ok(Self {
            run: selvedge::Scene::of_loaded(loaded.clone(), spec),
            loaded,
            has_spec: own_mesh.is_none(),
            own_mesh,
            folder,
            faces,
        })
    }

    /// The rest pose, found once. Long work: the lock must be released.
    pub(crate) fn found_rest(&self, reporter: &mut Progress<'_>) -> PyResult<Arc<SaggedRest>> {
        let found = self.run.rest_pose(&mut |event| reporter.on_event(event));
        found.map_err(raised)
    }

    /// This scene after a change.
    fn changed(&self, py: Python<'_>, loaded: LoadedScene) -> PyResult<Self> {
        let own_mesh = self.own_mesh.as_ref().map(|mesh| mesh.clone_ref(py));
        Self::of(py, loaded, own_mesh, self.folder.clone())
    }

    fn copy(&self) -> LoadedScene {
        let mut loaded = self.loaded.clone();
        loaded.warnings.clear();
        loaded
    }
}

#[pymethods]
impl Scene {
    #[new]
    #[pyo3(signature = (name_or_file=PathBuf::from("default")))]
    fn new(py: Python<'_>, name_or_file: PathBuf) -> PyResult<Self> {
        let loaded = py.detach(|| open_scene(&name_or_file.to_string_lossy()));
        let folder = pickling::absolute(name_or_file.parent().unwrap_or(Path::new("")));
        Self::of(py, loaded.map_err(raised)?, None, folder)
    }

    /// Reads a scene from the TOML text of its file; paths in it are relative to `folder`.
    #[staticmethod]
    #[pyo3(signature = (text, folder=PathBuf::new()))]
    fn parse(py: Python<'_>, text: &str, folder: PathBuf) -> PyResult<Self> {
        let loaded = py.detach(|| parse_scene(text, &folder, "the text"));
        let folder = pickling::absolute(&folder);
        Self::of(py, loaded.map_err(raised)?, None, folder)
    }

    /// Names of the shipped scenes.
    #[staticmethod]
    fn names() -> Vec<&'static str> {
        shipped_scenes().iter().map(|scene| scene.0).collect()
    }

    /// The same scene of another material.
    fn with_material(&self, py: Python<'_>, material: &Material) -> PyResult<Self> {
        let mut loaded = self.copy();
        loaded.spec.setting.material = material.material.clone();
        loaded.scene.material = material.material.clone();
        loaded.scene.validate().map_err(raised)?;
        self.changed(py, loaded)
    }

    /// The same scene with another motion: a shipped name, a TOML file, or a recorded motion (.csv,
    /// .npz).
    fn with_motion(&self, py: Python<'_>, name_or_file: PathBuf) -> PyResult<Self> {
        let loaded = self.copy().of_motion(&name_or_file.to_string_lossy());
        self.changed(py, loaded.map_err(raised)?)
    }

    /// The same scene with handles that move as `targets` (frames, handles, 3) [m]; frame 0 is the
    /// start.
    fn with_targets(&self, py: Python<'_>, targets: Numbers<'_>) -> PyResult<Self> {
        let handles = self.loaded.scene.handles.len();
        let frames = match targets.shape() {
            [frames, found, 3] if *found == handles && *frames > 0 => *frames,
            found => {
                return Err(wrong(format!(
                    "targets must have the shape (frames, {handles}, 3), found {found:?}"
                )));
            }
        };
        let positions = arrays::triples(&targets);
        let each = positions.chunks_exact(handles.max(1)).take(frames);
        let motion = Motion::Recorded(RecordedMotion {
            positions: each.map(<[_]>::to_vec).collect(),
        });
        let mut loaded = self.copy();
        loaded.spec.motion = motion.clone();
        loaded.scene.motion = motion;
        loaded.scene.validate().map_err(raised)?;
        self.changed(py, loaded)
    }

    /// The same scene of another mesh, held at the vertices `handles`. Its motion must fit them.
    pub(crate) fn with_mesh(
        &self,
        py: Python<'_>,
        mesh: Py<Mesh>,
        handles: Vec<u32>,
    ) -> PyResult<Self> {
        let mut loaded = self.copy();
        let built = &mesh.get().mesh;
        loaded.scene.handles =
            Handles::new(&handles, built.topology().vertex_count()).map_err(raised)?;
        loaded.scene.mesh = built.clone();
        loaded.scene.validate().map_err(raised)?;
        loaded.state = None;
        loaded.loose = None;
        Self::of(py, loaded, Some(mesh), self.folder.clone())
    }

    /// Name.
    #[getter]
    fn name(&self) -> &str {
        &self.loaded.scene.name
    }

    /// Frames of the motion, the start included not.
    #[getter]
    fn frames(&self) -> PyResult<usize> {
        self.loaded.scene.frame_count().map_err(raised)
    }

    /// Frames per second.
    #[getter]
    fn frame_rate(&self) -> f64 {
        self.loaded.scene.frame_rate
    }

    /// The material.
    #[getter]
    fn material(&self) -> Material {
        Material {
            material: self.loaded.scene.material.clone(),
        }
    }

    /// Start positions [m], (n, 3), float64; shared, not copied.
    #[getter]
    fn positions<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let shape = (slf.get().loaded.scene.mesh.positions().len(), 3);
        arrays::shared(
            slf,
            |own| arrays::flat_f64(own.loaded.scene.mesh.positions()),
            shape,
        )
    }

    /// Numbers of the held vertices, (handles,), uint32, in the order of the targets.
    #[getter]
    fn handles<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<u32>> {
        arrays::handles_of(py, &self.loaded.scene.handles)
    }

    /// Warnings of what the file asks for and cannot have.
    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.loaded.warnings.clone()
    }

    /// Targets of the handles by the scene's motion for the step from `frame` on [m], (samples,
    /// handles, 3), at equally spaced times of which the last is the end of the frame.
    #[pyo3(signature = (frame, samples=1))]
    fn targets<'py>(
        &self,
        py: Python<'py>,
        #[pyo3(from_py_with = natural)] frame: usize,
        #[pyo3(from_py_with = natural)] samples: usize,
    ) -> PyResult<Bound<'py, PyArray3<f64>>> {
        if samples > MOST_SAMPLES {
            return Err(wrong(format!(
                "samples must be at most {MOST_SAMPLES}, found {samples}"
            )));
        }
        let path = self.loaded.scene.handle_path().map_err(raised)?;
        arrays::targets(py, &path, (frame, samples), self.loaded.scene.frame_rate)
    }

    /// The static equilibrium in which the cloth hangs from its handles [m], (n, 3), float64. It is
    /// searched for once; `progress(task, done, goal)` hears of every solve.
    #[pyo3(signature = (progress=None))]
    fn rest_pose<'py>(
        &self,
        py: Python<'py>,
        progress: Option<Py<PyAny>>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let found = beside_reporting(py, progress, |_, reporter| self.found_rest(reporter))??;
        arrays::of_f64(py, &found.positions)
    }

    /// The resolved scene as a dictionary, as results carry it; `None` where arrays are in it.
    fn to_dict<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyAny>>> {
        if self.has_spec { json::to_python(py, &self.loaded.spec).map(Some) } else { Ok(None) }
    }

    fn __reduce__<'py>(&self, py: Python<'py>) -> PyResult<Call<'py>> {
        let spec = serde_json::to_string(&self.loaded.spec).map_err(raised)?;
        let held = arrays::handles_of(py, &self.loaded.scene.handles);
        let mesh = self.own_mesh.as_ref().map(|mesh| (mesh, held));
        pickling::call(py, "_scene", (spec, &self.folder, mesh))
    }

    fn __repr__(&self) -> String {
        let scene = &self.loaded.scene;
        let (vertices, handles) = (scene.mesh.positions().len(), scene.handles.len());
        format!(
            "Scene({:?}, {vertices} vertices, {handles} handles)",
            scene.name
        )
    }
}
