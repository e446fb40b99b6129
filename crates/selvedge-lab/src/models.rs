//! Models by their names: opened from a file or shipped, and started on a cloth.

use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::Vec3;
use selvedge_cloth::{Cloth, HandlePath, Scene, StepError, Stepper};
use selvedge_corrected::cloth_graph;
use selvedge_data::{Drive, record};
use selvedge_model::{ClothGraph, GraphError, Model, ModelFileError};
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
        assets::MODELS.map(|model| model.0).join(", ")
    )]
    NotFound { name: String },
    #[error("{name}: could not be read: {source}")]
    Read { name: String, source: io::Error },
    #[error("{name}: {source}")]
    Content {
        name: String,
        source: ModelFileError,
    },
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
    /// # Errors
    /// A file that cannot be read or is no model of this version.
    pub fn open(file: Option<&Path>) -> Result<Self, OpenModelError> {
        let (shipped, its_bytes) = assets::MODEL;
        let (name, bytes) = match file {
            Some(path) => (path.display().to_string(), selvedge_data::read_file(path)),
            None => (shipped.to_owned(), Ok(its_bytes.to_vec())),
        };
        let model = match bytes {
            Ok(bytes) => Model::from_bytes(&bytes),
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                let mut known = assets::MODELS.iter();
                match known.find(|model| model.0 == name) {
                    None => return Err(OpenModelError::NotFound { name }),
                    Some((_, bytes)) => Model::from_bytes(bytes),
                }
            }
            Err(source) => return Err(OpenModelError::Read { name, source }),
        };
        match model {
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
    physics::timed(recording, vertices, started)
}
