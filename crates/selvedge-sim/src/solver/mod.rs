//! The linear system of a time step and its solvers.
//!
//! [`elements`] evaluates the laws on every face and hinge ([`faces`], [`hinges`], [`even`]). [`system`] assembles and solves the
//! equations of an implicit stage: by [`conjugate_gradients`] with the preconditioners [`gauss_seidel`], or
//! where contact couples vertices [`woven`]; or by a complete factor ([`direct`], [`pattern`],
//! [`ordering`], [`blocks`], [`cholesky`]).

mod blocks;
mod cholesky;
mod conjugate_gradients;
mod direct;
mod elements;
mod even;
mod faces;
mod gauss_seidel;
mod groups;
mod hinges;
mod ordering;
mod pattern;
mod system;
mod woven;

use selvedge_cloth::{StepError, VertexId};
use thiserror::Error;

#[cfg(test)]
pub(crate) use elements::Elements;
pub use elements::backward::MaterialGradient;
pub(crate) use elements::backward::{ElementSums, Residual};
pub(crate) use system::System;

#[derive(Clone, Debug, Error, PartialEq)]
pub(crate) enum SolveError {
    /// A force or a result is not finite.
    #[error("the motion of vertex {vertex} is no longer finite")]
    NonFinite { vertex: VertexId },
    /// Someone wanted to stop.
    #[error("stopped, as was asked, after {iterations} iterations")]
    Stopped { iterations: u32 },
    /// The system could not be factorised, or conjugate gradients did not converge.
    #[error("{0}")]
    Failed(String),
}

impl SolveError {
    /// The error of the step to this frame.
    pub(crate) fn at(self, frame: usize) -> StepError {
        match self {
            Self::NonFinite { vertex } => StepError::NonFinite { frame, vertex },
            other => StepError::Solve {
                frame,
                cause: other.to_string(),
            },
        }
    }
}
