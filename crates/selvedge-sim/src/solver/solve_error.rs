//! The reason for a failed solve.

use selvedge_cloth::VertexId;
use thiserror::Error;

/// Reason for a failed solve.
#[derive(Clone, Debug, Error, PartialEq)]
pub(crate) enum SolveError {
    /// A force or a result is not finite.
    #[error("the motion of vertex {vertex} is no longer finite")]
    NonFinite {
        /// The first such vertex.
        vertex: VertexId,
    },
    /// Someone wanted to stop.
    #[error("stopped, as was asked, after {iterations} iterations")]
    Stopped {
        /// Iterations done.
        iterations: u32,
    },
    /// The system could not be factorised, or conjugate gradients did not converge.
    #[error("{0}")]
    Failed(String),
}

impl SolveError {
    /// No memory, or more entries than an index can count, in a matrix of so many `unknowns`.
    pub(super) fn resources(unknowns: usize, cause: &str) -> Self {
        let text = format!("the factorisation of {unknowns} unknowns failed: {cause}");
        Self::Failed(text)
    }
}
