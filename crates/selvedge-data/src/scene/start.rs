//! Where a run starts: in the sagged rest pose, where the mesh has the vertices, or in a state that
//! was saved.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::file::{SceneProblem, field};
use crate::trajectory::state_file::{SavedState, StateChoice, StateSpec};

/// Where a run starts, resolved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum StartSpec {
    /// In the sagged rest pose.
    #[default]
    Rest,
    /// Where the mesh has its vertices, at rest.
    Mesh,
    /// In a saved state.
    State(StateSpec),
}

/// As files have it.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub(super) enum StartFile {
    #[default]
    Rest,
    Mesh,
    State {
        /// Relative to the scene's folder.
        file: String,
        frame: Option<usize>,
        positions: Option<String>,
        velocities: Option<String>,
    },
}

impl StartSpec {
    /// Whether it is the default.
    pub(super) fn is_rest(&self) -> bool {
        *self == Self::Rest
    }
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
