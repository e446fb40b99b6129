//! The linear system of a time step and its solvers.

mod blocks;
mod cholesky;
mod conjugate_gradients;
mod elements;
mod incomplete;
mod newton;
mod ordering;
mod pattern;
mod system;

pub(crate) use cholesky::FactorError;
pub(crate) use newton::Newton;
pub(crate) use system::{SolveError, System};
