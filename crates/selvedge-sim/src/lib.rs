//! Reference cloth physics: measured stiffness (Wang, O'Brien and Ramamoorthi 2011) under a
//! linearly implicit integrator (Baraff and Witkin 1998), in the form in which ARCSim (Narain et
//! al. 2012, 2013) solves it, without remeshing.
//!
//! [`Simulator`] is a [`selvedge_cloth::Stepper`]; [`sag`] finds the static equilibrium from which
//! motions start. Everything that decides a result is in the [`selvedge_cloth::Scene`]. Units are SI
//! throughout; the state is f64.

mod anderson;
pub mod bend;
mod blocks;
mod cholesky;
mod conjugate_gradients;
mod elements;
pub mod external;
mod fall;
mod grip;
mod incomplete;
mod last_step;
mod lists;
mod newton;
mod ordering;
mod pattern;
mod sag;
mod settle;
mod simulator;
mod strain_limit;
mod strain_watch;
pub mod stretch;
pub mod stretch_table;
mod system;
mod threads;

pub use sag::{SagError, SagProgress, SaggedRest, sag, sag_with_progress};
pub use simulator::{Simulator, SimulatorError};
pub use threads::Threads;
