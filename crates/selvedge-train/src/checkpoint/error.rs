//! Errors of resuming a training.

use thiserror::Error;

use crate::trainer::TrainError;

/// A training that cannot be resumed.
#[derive(Debug, Error)]
pub enum ResumeError {
    /// The file is no checkpoint of this training; the message names it and says why.
    #[error("{0}")]
    File(String),
    /// The training cannot start.
    #[error(transparent)]
    Train(#[from] TrainError),
}
