//! Models by their names: opened from a file or shipped, and started on a cloth.

use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use selvedge_cloth::{Cloth, ElasticLaw, HandlePath, Integrator, Scene, StepError, Stepper};
use selvedge_corrected::cloth_graph;
use selvedge_data::{Drive, record};
use selvedge_model::{ClothGraph, GraphError, Model, ModelFileError};
use selvedge_train::files;
use thiserror::Error;

use crate::assets;
use crate::machine::{Machine, Mover, StartError};
use crate::physics::{self, TimedRun};

/// A model with its name.
pub struct NamedModel {
    /// Its file, or the name of the shipped one.
    pub name: String,
    /// The model, ready to run.
    pub model: Arc<Model>,
}

/// A model that cannot be opened.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum OpenModelError {
    #[error(
        "{name}: there is no such file, and no shipped model of this name; there are: {}",
        assets::names(assets::MODELS)
    )]
    NotFound { name: String },
    #[error(
        "{name}: is a folder: name the model in it, {name}/{}{}",
        files::MODEL,
        of_the_shipped(.name)
    )]
    Folder { name: String },
    #[error("{name}: could not be read: {source}")]
    Read { name: String, source: io::Error },
    #[error("{name}: {source}")]
    Content {
        name: String,
        source: ModelFileError,
    },
}

/// The bytes of the shipped model of this name, if there is one.
fn shipped(name: &str) -> Option<&'static [u8]> {
    let mut known = assets::MODELS.iter();
    known.find(|model| model.0 == name).map(|model| model.1)
}

/// The remedy of one who meant the shipped model of this name, if there is one.
fn of_the_shipped(name: &str) -> &'static str {
    match shipped(name) {
        Some(_) => "; for the shipped model of this name, start from another folder",
        None => "",
    }
}

/// A scene whose parts make no graph.
#[derive(Debug, Error)]
#[error("the graph of scene {scene:?}: {source}")]
pub struct SceneGraphError {
    scene: String,
    source: GraphError,
}

/// A model that cannot be started on a cloth.
#[derive(Debug, Error)]
#[error("starting model {model}: {source}")]
pub struct StartModelError {
    model: String,
    source: StartError,
}

impl NamedModel {
    /// Opens the model in `file`, which may also be the name of a shipped one where no file has it;
    /// without `file` the first of those.
    ///
    /// A folder of that name is no such file, but one with a model in it could be meant.
    ///
    /// # Errors
    /// A file that cannot be read or is no model of this version; a folder with a model in it, or
    /// whose name no shipped model has.
    pub fn open(file: Option<&Path>) -> Result<Self, OpenModelError> {
        let Some(path) = file else {
            let (name, bytes) = assets::MODEL;
            return Self::from_bytes(name.to_owned(), bytes);
        };
        let name = path.display().to_string();
        let error = match selvedge_data::read_file(path) {
            Ok(bytes) => return Self::from_bytes(name, &bytes),
            Err(error) => error,
        };
        let is_absent = error.kind() == io::ErrorKind::NotFound;
        match shipped(&name) {
            Some(_) if path.join(files::MODEL).exists() => Err(OpenModelError::Folder { name }),
            Some(bytes) if is_absent || path.is_dir() => Self::from_bytes(name, bytes),
            None if is_absent => Err(OpenModelError::NotFound { name }),
            None if path.is_dir() => Err(OpenModelError::Folder { name }),
            _ => Err(OpenModelError::Read {
                name,
                source: error,
            }),
        }
    }

    fn from_bytes(name: String, bytes: &[u8]) -> Result<Self, OpenModelError> {
        match Model::from_bytes(bytes) {
            Ok(model) => Ok(Self {
                name,
                model: Arc::new(model),
            }),
            Err(source) => Err(OpenModelError::Content { name, source }),
        }
    }

    /// Starts the model at `start` `[m]`, `[vertices]`, at rest, on a machine; `scene` is that of
    /// `graph`.
    ///
    /// # Errors
    /// A start that does not fit the cloth, or a machine that cannot run it.
    pub fn start(
        &self,
        graph: ClothGraph,
        start: &[Vec3],
        machine: &Machine,
        scene: &Scene,
    ) -> Result<Mover, StartModelError> {
        let started = machine.start(&self.model, graph, &[start], Some(scene));
        started.map_err(|source| StartModelError {
            model: self.name.clone(),
            source,
        })
    }
}

/// Returns the graph of `cloth`, which knows its rest pose, in the environment of `scene`, for
/// `model`.
///
/// # Errors
/// Parts that do not fit; gusts, for a model that corrects no physics.
pub fn graph_of_scene(
    scene: &Scene,
    cloth: &Cloth,
    model: &Model,
) -> Result<ClothGraph, SceneGraphError> {
    let graph = match model.spec().base {
        None => ClothGraph::new(cloth, scene.environment, scene.frame_rate),
        Some(_) => cloth_graph(scene, cloth),
    };
    graph.map_err(|source| SceneGraphError {
        scene: scene.name.clone(),
        source,
    })
}

/// Substeps of the truth that a model of corrected physics is compared with: its teacher's.
const CONVERGED: u32 = 8;

/// The scene whose physics is the truth of `model`: the scene itself, or for a model that corrects
/// physics a finer one. Such a model is to be nearer to the motion than the scene's own substeps
/// are, and a comparison with those would show their error, not its own.
#[must_use]
pub fn truth_scene(scene: &Scene, model: &Model) -> Scene {
    let mut scene = scene.clone();
    if model.spec().base.is_some() {
        let physics = &mut scene.physics;
        physics.integrator = Integrator::SecondOrder;
        physics.substeps = physics.substeps.max(CONVERGED);
        physics.law = ElasticLaw::Measured;
        let damping = physics.damping(0.0);
        physics.least_damping.get_or_insert(damping);
    }
    scene
}

/// Steps `stepper` for `frames` along `path`, with one target per frame, and times it.
///
/// # Errors
/// A step that fails.
pub fn drive(
    stepper: &mut dyn Stepper,
    path: &HandlePath,
    frames: usize,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<TimedRun, StepError> {
    let vertices = stepper.positions().len();
    let drive = Drive {
        path,
        samples_per_frame: 1,
    };
    let started = Instant::now();
    let recording = record(stepper, drive, frames, &mut |_| on_frame());
    let (run, failure) = physics::timed(recording, vertices, started);
    failure.map_or(Ok(run), Err)
}

#[cfg(test)]
mod tests {
    use selvedge_data::open_scene;

    use super::*;

    #[test]
    fn the_truth_of_a_model_that_corrects_physics_is_finer_than_the_scene() {
        let scene = open_scene("default").unwrap().scene;
        let open = |name: &str| NamedModel::open(Some(Path::new(name))).unwrap().model;
        let mut of_scene = scene.clone();
        of_scene.physics.substeps = 3;
        of_scene.physics.integrator = Integrator::Linearised;
        let kept = truth_scene(&of_scene, &open("paper")).physics;
        assert_eq!(kept, of_scene.physics);
        let finer = truth_scene(&of_scene, &open("general")).physics;
        assert_eq!(
            (finer.integrator, finer.substeps),
            (Integrator::SecondOrder, CONVERGED)
        );
        assert!(finer.validate().is_ok());
        of_scene.physics.substeps = 20;
        let kept = truth_scene(&of_scene, &open("general")).physics;
        assert_eq!(kept.substeps, 20);
    }
}
