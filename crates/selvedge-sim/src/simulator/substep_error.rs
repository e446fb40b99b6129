//! Reasons for a failed substep, or for a frame that ends strained beyond its bound.

use crate::contact::{ContactError, Unseparated};
use crate::solver::SolveError;
use crate::watched_edges::Overstretched;

/// Reason for a failed substep.
pub(super) enum SubstepError {
    Solve(SolveError),
    Contact(Unseparated),
    Stretch(Overstretched),
    /// Someone wanted to stop.
    Stopped,
}

impl From<SolveError> for SubstepError {
    fn from(error: SolveError) -> Self {
        Self::Solve(error)
    }
}

impl From<ContactError> for SubstepError {
    fn from(error: ContactError) -> Self {
        match error {
            ContactError::Solve(error) => Self::Solve(error),
            ContactError::Unseparated(pair) => Self::Contact(pair),
        }
    }
}

impl From<Overstretched> for SubstepError {
    fn from(error: Overstretched) -> Self {
        Self::Stretch(error)
    }
}
