//! What is wrong with a scene, in the words of the parts that found it.

use std::path::Path;

use selvedge_cloth::{HandleError, MeshError, SceneError, TopologyError};
use serde::de::DeserializeOwned;

use crate::formats::atomic::WriteError;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input;

/// Errors of parts of a scene, with the key that they are of.
macro_rules! problems {
    ($($error:ty $(= $key:literal)?),+) => {
        $(impl From<$error> for Problem {
            fn from(error: $error) -> Self {
                Self(format!(concat!($($key, ": ",)? "{}"), error))
            }
        })+
    };
}
problems!(
    SceneError,
    TopologyError,
    WriteError,
    HandleError = "handles",
    MeshError = "mesh"
);

impl<E: std::error::Error> From<FileError<E>> for Problem {
    fn from(error: FileError<E>) -> Self {
        Self(error.to_string())
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
