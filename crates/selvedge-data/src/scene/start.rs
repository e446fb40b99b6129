//! Start of a run: in the sagged rest pose, where the mesh has the vertices, from there moved apart
//! where it meets itself or relaxed into its pattern, or in a state that was saved.

use crate::trajectory::state_file::StateSpec;
use serde::{Deserialize, Serialize};

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
