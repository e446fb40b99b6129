//! What is wrong with a scene, and the error that names it.

use std::path::Path;

use selvedge_cloth::{HandleError, MeshError, SceneError};
use serde::de::DeserializeOwned;
use thiserror::Error;

use crate::formats::file_error::Problem;
use crate::formats::input;
use crate::formats::polygons::ReadMeshError;

/// A scene that cannot be used.
#[derive(Debug, Error)]
#[error("{origin}: {problem}")]
pub struct SceneFileError {
    /// The file, or the name of a shipped scene.
    pub origin: String,
    /// The problem.
    pub problem: Problem,
}

impl SceneFileError {
    /// A problem of what `origin` names, for `map_err`.
    pub(crate) fn at(origin: impl Into<String>) -> impl FnOnce(Problem) -> Self {
        let origin = origin.into();
        |problem| Self { origin, problem }
    }
}

impl From<SceneError> for Problem {
    fn from(error: SceneError) -> Self {
        Self(error.to_string())
    }
}

impl From<HandleError> for Problem {
    fn from(error: HandleError) -> Self {
        field("handles", error.to_string())
    }
}

impl From<MeshError> for Problem {
    fn from(error: MeshError) -> Self {
        field("mesh", error.to_string())
    }
}

impl From<ReadMeshError> for Problem {
    fn from(error: ReadMeshError) -> Self {
        field("mesh.obj", error.to_string())
    }
}

/// A name that is neither a file's nor one of what is shipped.
pub(crate) fn unknown(what: &str, shipped: &[(&str, &str)]) -> Problem {
    let known: Vec<&str> = shipped.iter().map(|entry| entry.0).collect();
    let known = known.join(", ");
    Problem(format!(
        "is neither a file nor a shipped {what}; shipped are {known}"
    ))
}

pub(crate) fn field(key: impl std::fmt::Display, problem: impl std::fmt::Display) -> Problem {
    Problem(format!("{key}: {problem}"))
}

pub(crate) fn parse_toml<T: DeserializeOwned>(text: &str) -> Result<T, Problem> {
    toml::from_str(text).map_err(|error| Problem(error.to_string().trim_end().to_owned()))
}

pub(crate) fn read_text(path: &Path) -> Result<String, Problem> {
    input::read_text(path).map_err(|error| Problem(format!("could not be read: {error}")))
}

pub(crate) fn not_understood(error: serde_json::Error) -> Problem {
    Problem(format!("the scene cannot be understood: {error}"))
}
