//! Text files and TOML, with the errors of scenes.

use std::path::Path;

use serde::de::DeserializeOwned;

use super::problem::SceneProblem;
use crate::formats::input;

pub(crate) fn parse_toml<T: DeserializeOwned>(text: &str) -> Result<T, SceneProblem> {
    toml::from_str(text).map_err(|error| SceneProblem::Toml(Box::new(error)))
}

pub(crate) fn read_text(path: &Path) -> Result<String, SceneProblem> {
    input::read_text(path).map_err(SceneProblem::Read)
}
