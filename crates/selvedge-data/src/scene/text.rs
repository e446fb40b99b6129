//! Text files and TOML, with the errors of scenes.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::problem::SceneProblem;

pub(crate) fn parse_toml<T: DeserializeOwned>(text: &str) -> Result<T, SceneProblem> {
    toml::from_str(text).map_err(|error| SceneProblem::Toml(Box::new(error)))
}

pub(crate) fn read_text(path: &Path) -> Result<String, SceneProblem> {
    std::fs::read_to_string(path).map_err(SceneProblem::Read)
}
