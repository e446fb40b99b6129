//! Models by their names: opened from a file or shipped, and driven along a path.

use std::io;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use web_time::Instant;

use selvedge_cloth::{HandlePath, StepError, Stepper};
use selvedge_data::{Drive, record};
use selvedge_model::{Model, ModelFileError};
use selvedge_train::files;
use thiserror::Error;

use crate::assets;
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

impl NamedModel {
    /// Opens the model in `file`, which may also be the name of a shipped one where no file has it;
    /// without `file` the first of those.
    ///
    /// A folder of that name is no such file, but one with a model in it could be meant.
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
        // A browser has no files at all.
        let absent = [io::ErrorKind::NotFound, io::ErrorKind::Unsupported];
        let is_absent = absent.contains(&error.kind());
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
}

/// Steps `stepper` for `frames` along `path`, with one target per frame, and times it.
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
