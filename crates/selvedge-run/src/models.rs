//! Networks with their names: opened from a file or shipped.

use std::io;
use std::path::Path;
use std::sync::Arc;

use selvedge_assets::MODELS;

use crate::Error;

/// Name of the file of a model in the folder of its training.
const FILE: &str = "model.safetensors";

/// A network with its name.
#[derive(Clone)]
pub struct Model {
    /// Its file, or the name of the shipped one.
    pub name: String,
    /// The model, ready to run.
    pub model: Arc<selvedge_model::Model>,
}

/// The bytes of the shipped model of this name, if there is one.
fn shipped(name: &str) -> Option<&'static [u8]> {
    let mut known = MODELS.iter();
    known.find(|model| model.0 == name).map(|model| model.1)
}

/// The remedy of one who meant the shipped model of this name, if there is one.
fn of_the_shipped(name: &str) -> &'static str {
    match shipped(name) {
        Some(_) => "; for the shipped model of this name, start from another folder",
        None => "",
    }
}

impl Model {
    /// Opens the model in `file`, which may also be the name of a shipped one where no file has it;
    /// without `file` the first of those.
    ///
    /// A folder of that name is no such file, but one with a model in it could be meant.
    pub fn open(file: Option<&Path>) -> Result<Self, Error> {
        let Some(path) = file else {
            let (name, bytes) = MODELS[0];
            return Self::from_bytes(name.to_owned(), bytes);
        };
        let name = selvedge_data::readable_path(path);
        let error = match selvedge_data::read_file(path) {
            Ok(bytes) => return Self::from_bytes(name, &bytes),
            Err(error) => error,
        };
        // A browser has no files at all.
        let absent = [io::ErrorKind::NotFound, io::ErrorKind::Unsupported];
        let is_absent = absent.contains(&error.kind());
        let is_folder = || {
            let shipped = of_the_shipped(&name);
            Error::Model(format!(
                "{name}: is a folder: name the model in it, {name}/{FILE}{shipped}"
            ))
        };
        match shipped(&name) {
            Some(_) if path.join(FILE).exists() => Err(is_folder()),
            Some(bytes) if is_absent || path.is_dir() => Self::from_bytes(name, bytes),
            None if is_absent => {
                let known: Vec<&str> = MODELS.iter().map(|model| model.0).collect();
                let known = known.join(", ");
                Err(Error::Model(format!(
                    "{name}: there is no such file, and no shipped model of this name; there are: {known}"
                )))
            }
            None if path.is_dir() => Err(is_folder()),
            _ => Err(Error::network(format!("{name}: could not be read"), error)),
        }
    }

    fn from_bytes(name: String, bytes: &[u8]) -> Result<Self, Error> {
        let model = selvedge_model::Model::from_bytes(bytes);
        let model = model.map_err(|error| Error::network(name.clone(), error))?;
        let model = Arc::new(model);
        Ok(Self { name, model })
    }
}
