//! The ways in which a file can say how handles move.

use std::path::{Path, PathBuf};

use selvedge_cloth::Motion;
use selvedge_cloth::motion::named;
use serde::Deserialize;

use super::file::{SceneProblem, field, parse_toml, read_text};
use super::recorded_csv::parse_recorded_csv;

/// One way to say how the handles move; paths are relative to the file that names them.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum MotionSource {
    /// A motion that has a name.
    Named(String),
    /// A motion written out.
    Inline(Motion),
    /// A TOML file with a motion written out.
    File(PathBuf),
    /// A CSV file with one position per handle and frame.
    Recorded(PathBuf),
}

impl MotionSource {
    pub(crate) fn resolve(&self, folder: &Path) -> Result<Motion, SceneProblem> {
        match self {
            Self::Named(name) => named::by_name(name).ok_or_else(|| {
                let known = named::names().join(", ");
                field(
                    "motion.named",
                    format!("no motion is called {name:?}; known are {known}"),
                )
            }),
            Self::Inline(motion) => Ok(motion.clone()),
            Self::File(path) => {
                let path = folder.join(path);
                let text = read_text(&path).map_err(|problem| {
                    field("motion.file", format!("{}: {problem}", path.display()))
                })?;
                parse_toml(&text).map_err(|problem| {
                    field("motion.file", format!("{}: {problem}", path.display()))
                })
            }
            Self::Recorded(path) => {
                let path = folder.join(path);
                let named = |problem: String| {
                    field("motion.recorded", format!("{}: {problem}", path.display()))
                };
                let text = read_text(&path).map_err(|error| named(error.to_string()))?;
                let motion = parse_recorded_csv(&text).map_err(|error| named(error.to_string()))?;
                Ok(Motion::Recorded(motion))
            }
        }
    }
}
