//! Errors of rigs.

use thiserror::Error;

/// A file that is no rig, or a node of it that cannot be followed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum RigError {
    #[error("{0}")]
    Content(String),
    #[error("has several animations: choose one by `animation`, of [{known}]")]
    Animations { known: String },
    #[error("has no mesh{}", .0.iter().map(|left| format!("; {left}")).collect::<String>())]
    NoMesh(Vec<String>),
}

impl RigError {
    pub(super) fn node(name: &str, problem: impl std::fmt::Display) -> Self {
        Self::Content(format!("node {name:?}: {problem}"))
    }

    /// There is no animation of this name, but the `known` ones.
    pub(super) fn no_animation(name: &str, known: &str) -> Self {
        Self::Content(format!(
            "has no animation called {name:?}; there are [{known}]"
        ))
    }
}
