//! The linear system of a time step and its solvers.
//!
//! [`elements`] evaluates the laws on every face and hinge. [`system`] assembles and solves the
//! equations of a [`stage`]. A small cloth is factorised completely ([`direct`], [`pattern`],
//! [`ordering`], [`blocks`], [`cholesky`]), a large one iterated ([`conjugate_gradients`],
//! [`incomplete`], [`woven`]). Touches are iterated ([`coupled`]), and where that fails factorised
//! ([`complete`]).

mod blocks;
mod cholesky;
mod complete;
mod conjugate_gradients;
mod coupled;
mod direct;
mod elements;
mod incomplete;
mod ordering;
mod pattern;
mod solve_error;
mod stage;
mod system;
mod woven;

pub(crate) use cholesky::FactorError;
pub(crate) use solve_error::SolveError;
pub(crate) use stage::{Stage, StageAir};
pub(crate) use system::System;
