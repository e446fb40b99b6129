//! The linear system of a time step and its solvers.
//!
//! [`elements`] evaluates the laws on every face and hinge ([`faces`], [`hinges`]). [`system`] assembles and solves the
//! equations of an implicit stage: by [`conjugate_gradients`] with the preconditioners [`gauss_seidel`], or
//! where contact couples vertices [`woven`]; or by a complete factor ([`direct`], [`pattern`],
//! [`ordering`], [`blocks`], [`cholesky`]).

mod blocks;
mod cholesky;
mod conjugate_gradients;
mod direct;
mod elements;
mod faces;
mod gauss_seidel;
mod hinges;
mod ordering;
mod pattern;
mod solve_error;
mod system;
mod woven;

pub(crate) use solve_error::SolveError;
pub(crate) use system::System;
