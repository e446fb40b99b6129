//! Errors of exports, the pulse by which a caller can stop one, and the largest size of a file.

use std::fmt::Display;
use std::io;
use std::ops::ControlFlow;

use thiserror::Error;

use crate::formats::atomic::WriteError;
use crate::formats::file_error::Problem;

/// A trajectory that was not exported; what was there before still is.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message says all")]
pub enum ExportError {
    #[error(transparent)]
    Refused(#[from] Problem),
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl ExportError {
    pub(super) fn refused(problem: impl Display) -> Self {
        Self::Refused(Problem(problem.to_string()))
    }
}

/// The most bytes that a file can have whose lengths have 32 bits.
pub(super) const LARGEST: u64 = u32::MAX as u64;

/// Tells the observer of each frame.
pub(super) struct Pulse<'a>(pub(super) &'a mut dyn FnMut() -> ControlFlow<()>);

/// The observer asked to stop.
#[derive(Debug, Error)]
#[error("stopped")]
pub(super) struct Stop;

impl Pulse<'_> {
    /// Reports that one more frame is written.
    pub(super) fn beat(&mut self) -> io::Result<()> {
        match (self.0)() {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(io::Error::other(Stop)),
        }
    }
}

pub(super) fn is_stop(error: &io::Error) -> bool {
    error.get_ref().is_some_and(|inner| inner.is::<Stop>())
}

/// An error where `bytes`, of every `every`th frame, are more than lengths of 32 bits can say, with
/// the thinning that helps.
pub(super) fn check_size(format: &str, bytes: u64, every: usize) -> Result<(), ExportError> {
    if bytes <= LARGEST {
        return Ok(());
    }
    let every = every as u64 * bytes.div_ceil(LARGEST);
    Err(ExportError::refused(format!(
        "{format} would have {bytes} bytes, more than the 4 GiB that the format can hold: take every {every}th frame, or fewer frames, or .usda, which has no limit"
    )))
}
