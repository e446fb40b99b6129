//! Everything that can be wrong with a scene, and the error that names it.

use std::path::Path;

use serde::de::DeserializeOwned;
use thiserror::Error;

use super::mesh_spec::MeshSpecError;
use super::spec::SceneSpecError;
use crate::formats::input;

/// A scene that cannot be used.
#[derive(Debug, Error)]
#[error("{origin}: {problem}")]
pub struct SceneFileError {
    /// The file, or the name of a shipped scene.
    pub origin: String,
    /// The problem.
    #[source]
    pub problem: SceneProblem,
}

impl SceneFileError {
    /// A problem of what `origin` names, for `map_err`.
    pub(crate) fn at(origin: impl Into<String>) -> impl FnOnce(SceneProblem) -> Self {
        let origin = origin.into();
        |problem| Self { origin, problem }
    }
}

/// A problem of a scene.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SceneProblem {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("is neither a file nor a shipped {what}; shipped are {known}")]
    Unknown { what: &'static str, known: String },
    #[error("{}", .0.to_string().trim_end())]
    Toml(#[source] Box<toml::de::Error>),
    #[error("{0}")]
    Kind(String),
    #[error("is no JSON: {0}")]
    Json(#[source] serde_json::Error),
    #[error("{key}: {problem}")]
    Key { key: String, problem: String },
    #[error(transparent)]
    Mesh(#[from] MeshSpecError),
    #[error(transparent)]
    Spec(#[from] SceneSpecError),
}

/// A name that is neither a file's nor one of what is shipped.
pub(crate) fn unknown(what: &'static str, shipped: &[(&str, &str)]) -> SceneProblem {
    let known: Vec<&str> = shipped.iter().map(|entry| entry.0).collect();
    let known = known.join(", ");
    SceneProblem::Unknown { what, known }
}

pub(crate) fn field(key: impl Into<String>, problem: impl Into<String>) -> SceneProblem {
    SceneProblem::Key {
        key: key.into(),
        problem: problem.into(),
    }
}

pub(crate) fn parse_toml<T: DeserializeOwned>(text: &str) -> Result<T, SceneProblem> {
    toml::from_str(text).map_err(|error| SceneProblem::Toml(Box::new(error)))
}

pub(crate) fn read_text(path: &Path) -> Result<String, SceneProblem> {
    input::read_text(path).map_err(SceneProblem::Read)
}
