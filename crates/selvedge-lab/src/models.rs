//! Models by their names: opened from a file or shipped.

use std::io;
use std::path::Path;
use std::sync::Arc;

use anyhow::{Context, Result, anyhow};
use selvedge_model::Model;
use selvedge_train::files;

use crate::assets;

/// A model with its name.
pub struct NamedModel {
    /// Its file, or the name of the shipped one.
    pub name: String,
    /// The model, ready to run.
    pub model: Arc<Model>,
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
    pub fn open(file: Option<&Path>) -> Result<Self> {
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
        let is_folder = || {
            let (file, shipped) = (files::MODEL, of_the_shipped(&name));
            anyhow!("{name}: is a folder: name the model in it, {name}/{file}{shipped}")
        };
        match shipped(&name) {
            Some(_) if path.join(files::MODEL).exists() => Err(is_folder()),
            Some(bytes) if is_absent || path.is_dir() => Self::from_bytes(name, bytes),
            None if is_absent => {
                let known = assets::names(assets::MODELS);
                Err(anyhow!(
                    "{name}: there is no such file, and no shipped model of this name; there are: {known}"
                ))
            }
            None if path.is_dir() => Err(is_folder()),
            _ => Err(error).with_context(|| format!("{name}: could not be read")),
        }
    }

    fn from_bytes(name: String, bytes: &[u8]) -> Result<Self> {
        let model = Model::from_bytes(bytes).with_context(|| name.clone())?;
        let model = Arc::new(model);
        Ok(Self { name, model })
    }
}
