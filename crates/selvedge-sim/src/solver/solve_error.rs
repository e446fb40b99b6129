//! The reason for a failed solve.

use selvedge_cloth::VertexId;
use thiserror::Error;

use super::cholesky::FactorError;
use super::conjugate_gradients::IterationError;

/// Reason for a failed solve.
#[derive(Clone, Debug, Error, PartialEq)]
pub(crate) enum SolveError {
    /// A force or a result is not finite.
    #[error("the motion of vertex {vertex} is no longer finite")]
    NonFinite {
        /// The first such vertex.
        vertex: VertexId,
    },
    /// The linear system could not be factorised.
    #[error(transparent)]
    Factor(#[from] FactorError),
    /// Conjugate gradients did not converge.
    #[error(transparent)]
    Iteration(#[from] IterationError),
}
