//! Errors of convergence studies.

use std::path::PathBuf;

use selvedge_data::{SceneSpecError, WriteError};
use thiserror::Error;

use crate::fitting::FittingError;

use crate::folder::FolderError;
use crate::physics::{RestPoseError, SimulationError};
use crate::workers::WorkerError;

/// A study that makes no sense as it is asked for; the message names the field and the remedy.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct ChoiceError(String);

/// A study that failed as a whole.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum ConvergenceError {
    Folder(#[from] FolderError),
    RestPose(#[from] RestPoseError),
    Fit(#[from] FittingError),
    #[error("the reference run: {0}")]
    Reference(#[from] SimulationError),
    #[error("the resolved scene as JSON: {0}")]
    Scene(#[from] SceneSpecError),
    #[error("{}: the kept reference has vanished or changed: run it again", path.display())]
    Vanished {
        path: PathBuf,
    },
    Write(#[from] WriteError),
    Threads(#[from] WorkerError),
}

impl ChoiceError {
    /// Says what is wrong, and what would be right.
    pub(super) fn new(problem: impl Into<String>) -> Self {
        Self(problem.into())
    }
}
