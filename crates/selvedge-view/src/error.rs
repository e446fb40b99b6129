//! The reasons why a picture could not be made.

use std::fmt::Display;

use thiserror::Error;

/// The reason why a picture could not be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ViewError {
    #[error("{0}")]
    Invalid(String),
    #[error("the PNG image could not be written: {0}")]
    Png(#[from] png::EncodingError),
    #[error("the GIF clip could not be written: {0}")]
    Gif(#[from] gif::EncodingError),
}

impl ViewError {
    /// Nothing to show.
    pub(crate) fn empty_run() -> Self {
        Self::Invalid("the run has no frames: there is nothing to show".to_owned())
    }

    /// A setting that is not as `expected`.
    pub(crate) fn setting(field: &str, expected: &str, found: impl Display) -> Self {
        Self::Invalid(format!("{field} must be {expected}, found {found}"))
    }

    /// No run to show.
    pub(crate) fn no_panels() -> Self {
        Self::Invalid("no panels were given: a picture needs at least one run".to_owned())
    }

    /// A frame that a run of `frames` does not have.
    pub fn no_frame(frame: usize, frames: usize) -> Self {
        Self::Invalid(format!(
            "frame {frame} was asked for, but the run has only {frames} frames"
        ))
    }
}
