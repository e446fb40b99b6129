//! Start of a run: in the sagged rest pose, where the mesh has the vertices, from there moved apart
//! where it meets itself or relaxed into its pattern, or in a state that was saved.

use std::path::Path;

use serde::{Deserialize, Serialize};

use super::problem::{SceneProblem, field};
use crate::trajectory::state_file::{SavedState, StateChoice, StateSpec};

/// Start of a run, resolved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum StartSpec {
    /// In the sagged rest pose.
    #[default]
    Rest,
    /// At the vertices of the mesh, at rest.
    Mesh,
    /// At the vertices of the mesh, moved apart where the cloth meets itself.
    Untangle,
    /// Relaxed into its pattern from the vertices of the mesh, at rest.
    Fit,
    /// In a saved state.
    State(StateSpec),
}

impl StartSpec {
    /// Returns true for the default.
    pub(super) fn is_rest(&self) -> bool {
        *self == Self::Rest
    }
}

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
