//! The start of a run as scene files have it, and the state that it names.

use std::path::Path;

use serde::Deserialize;

use super::problem::{SceneProblem, field};
use super::start::StartSpec;
use crate::trajectory::state_file::{SavedState, StateChoice};

/// Start of a run, as files have it.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(crate) enum StartFile {
    #[default]
    Rest,
    Mesh,
    Untangle,
    Fit,
    State {
        /// Path of the file, relative to the scene's folder.
        file: String,
        frame: Option<usize>,
        positions: Option<String>,
        velocities: Option<String>,
    },
}

impl StartFile {
    /// Reads the state, if one is named, of a cloth of `vertices` that is run at `frame_rate`.
    pub(super) fn resolve(
        self,
        folder: &Path,
        vertices: usize,
        frame_rate: f64,
    ) -> Result<(StartSpec, Option<SavedState>), SceneProblem> {
        match self {
            Self::Rest => Ok((StartSpec::Rest, None)),
            Self::Mesh => Ok((StartSpec::Mesh, None)),
            Self::Untangle => Ok((StartSpec::Untangle, None)),
            Self::Fit => Ok((StartSpec::Fit, None)),
            Self::State {
                file,
                frame,
                positions,
                velocities,
            } => {
                let choice = StateChoice {
                    frame,
                    positions,
                    velocities,
                    frame_rate: Some(frame_rate),
                };
                let (state, spec) = SavedState::read(folder, &file, &choice, vertices)
                    .map_err(|error| field("start.state", error.to_string()))?;
                Ok((StartSpec::State(spec), Some(state)))
            }
        }
    }
}
