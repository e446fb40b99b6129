//! Reasons for a failed substep, or for a frame that ends strained beyond its bound.

use selvedge_cloth::StepError;

use crate::edges::Overstretched;
use crate::solver::SolveError;

/// Pairs that cannot be kept apart.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Unseparated {
    /// The pair in words.
    pub(crate) pair: String,
    /// Gap at its last safe place `[m]`.
    pub(crate) gap: f64,
    /// Names of the obstacles that squeeze it.
    pub(crate) squeezed_by: Vec<String>,
    /// True if the scene could let one of them through.
    pub(crate) may_yield: bool,
}

impl Unseparated {
    pub(crate) fn at(self, frame: usize) -> StepError {
        StepError::Contact {
            frame,
            pair: self.pair,
            gap: self.gap,
            squeezed_by: self.squeezed_by,
            may_yield: self.may_yield,
        }
    }
}

/// Reason for a failed substep, or for a frame that ends strained beyond its bound.
pub(crate) enum SubstepError {
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
