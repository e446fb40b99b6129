//! What crosses to another process, or is copied: the functions that Python's `pickle` calls there.
//! A scene goes as its resolved spec, and the files that it names are read again; a data set goes as
//! its folder; models and trajectories go as the bytes of their files; a simulator goes with its state.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyTuple;
use selvedge_cloth::Material as ClothMaterial;
use selvedge_data::{LoadedScene, SceneSpec, Trajectory as Recorded};
use selvedge_model::Model as Trained;

use crate::errors::raised;
use crate::model::Model;
use crate::scene::{Material, Mesh, Scene};
use crate::simulator::_simulator;
use crate::trajectory::Trajectory;

/// Adds the functions to the module.
pub(crate) fn add(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add_function(wrap_pyfunction!(_scene, module)?)?;
    module.add_function(wrap_pyfunction!(_material, module)?)?;
    module.add_function(wrap_pyfunction!(_model, module)?)?;
    module.add_function(wrap_pyfunction!(_trajectory, module)?)?;
    module.add_function(wrap_pyfunction!(_simulator, module)?)?;
    Ok(())
}

/// What `__reduce__` gives: a function and its arguments.
pub(crate) type Call<'py> = (Bound<'py, PyAny>, Bound<'py, PyTuple>);

/// A call of the function `name` here.
pub(crate) fn call<'py>(
    py: Python<'py>,
    name: &str,
    arguments: impl IntoPyObject<'py, Target = PyTuple, Output = Bound<'py, PyTuple>, Error = PyErr>,
) -> PyResult<Call<'py>> {
    let function = py.import("selvedge._native")?.getattr(name)?;
    Ok((function, arguments.into_pyobject(py)?))
}

/// `path` for a process that may stand in another folder.
pub(crate) fn absolute(path: &Path) -> PathBuf {
    std::env::current_dir().map_or_else(|_| path.to_owned(), |folder| folder.join(path))
}

/// The scene of a spec, on another mesh where one is given.
#[pyfunction]
fn _scene(
    py: Python<'_>,
    spec: &str,
    folder: PathBuf,
    mesh: Option<(Py<Mesh>, Vec<u32>)>,
) -> PyResult<Scene> {
    let spec: SceneSpec = serde_json::from_str(spec).map_err(raised)?;
    let loaded = py.detach(|| LoadedScene::of_spec(spec, &folder));
    let mut loaded = loaded.map_err(raised)?;
    // They were said when the scene was made.
    loaded.warnings.clear();
    let scene = Scene::of(py, loaded, None, folder)?;
    match mesh {
        Some((mesh, handles)) => scene.with_mesh(py, mesh, handles),
        None => Ok(scene),
    }
}

#[pyfunction]
fn _material(values: &str) -> PyResult<Material> {
    let material: ClothMaterial = serde_json::from_str(values).map_err(raised)?;
    Ok(Material { material })
}

#[pyfunction]
fn _model(bytes: &[u8], name: String) -> PyResult<Model> {
    let model = Arc::new(Trained::from_bytes(bytes).map_err(raised)?);
    Ok(Model { name, model })
}

#[pyfunction]
fn _trajectory(py: Python<'_>, bytes: &[u8]) -> PyResult<Trajectory> {
    Trajectory::of(py, Recorded::from_bytes(bytes).map_err(raised)?)
}
