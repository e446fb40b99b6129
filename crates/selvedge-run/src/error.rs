//! Why a run cannot begin.

use selvedge_cloth::SceneError;
use selvedge_sim::{FitError, SagError, SimulatorError};
use thiserror::Error;

/// Reason why a scene, a model or a run cannot be had. The message names the file, field or scene,
/// and the remedy; that of its source, where it has one, says what was found.
#[derive(Debug, Error)]
#[non_exhaustive]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum Error {
    /// A file or a name that cannot be opened.
    #[cfg(feature = "files")]
    #[error(transparent)]
    File(#[from] selvedge_data::FileError<selvedge_data::Problem>),
    /// A part of a scene that cannot be used.
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error("the rest pose of scene {scene:?}")]
    Rest {
        scene: String,
        #[source]
        source: SagError,
    },
    #[error(
        "the run was to start in its rest pose, and can start where the mesh stands instead (start = \"mesh\" in the scene), or relaxed from there into its pattern (start = \"fit\")"
    )]
    NoRest(#[source] Box<Error>),
    #[error(
        "scene {scene:?} has no handles, so that nothing holds the cloth: let it fall (start = \"mesh\" in the scene)"
    )]
    Unheld { scene: String },
    /// A cloth that does not get onto a body, apart, or into its pattern.
    #[error(transparent)]
    Fit(#[from] FitError),
    /// A cloth that does not fit into its pattern.
    #[error("{0}")]
    Misfit(String),
    #[error("simulating scene {scene:?}")]
    Solver {
        scene: String,
        #[source]
        source: SimulatorError,
    },
    /// A model or a device that cannot be opened, or is not for such a scene.
    #[cfg(feature = "learned")]
    #[error("{0}")]
    Model(String),
    #[cfg(feature = "learned")]
    #[error("{what}")]
    Network {
        what: String,
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
    #[cfg(feature = "files")]
    #[error("the trajectory of scene {scene:?}")]
    Trajectory {
        scene: String,
        #[source]
        source: Box<dyn std::error::Error + Send + Sync>,
    },
}

impl Error {
    #[cfg(feature = "learned")]
    pub(crate) fn network(
        what: impl Into<String>,
        source: impl Into<Box<dyn std::error::Error + Send + Sync>>,
    ) -> Self {
        Self::Network {
            what: what.into(),
            source: source.into(),
        }
    }

    /// Returns true where the listener asked for the end.
    pub fn is_stopped(&self) -> bool {
        matches!(
            self,
            Self::Rest {
                source: SagError::Stopped { .. },
                ..
            } | Self::Fit(FitError::Stopped)
        )
    }
}
