//! Reference cloth physics: measured stiffness (Wang, O'Brien and Ramamoorthi 2011) under a
//! linearly implicit integrator (Baraff and Witkin 1998), in the form in which ARCSim (Narain et
//! al. 2012, 2013) solves it, without remeshing.
//!
//! [`Simulator`] is a [`selvedge_cloth::Stepper`]; [`sag`] finds the static equilibrium from which
//! motions start. Everything that decides a result is in the [`selvedge_cloth::Scene`]. Units are SI
//! throughout; the state is f64.

mod active_handles;
pub mod laws;
mod lists;
mod rest_pose;
mod simulator;
mod solver;
mod state;
mod strain_watch;
mod threads;

pub use rest_pose::{SagError, SagProgress, SaggedRest, sag, sag_with_progress};
pub use simulator::{Simulator, SimulatorError};
pub use threads::Threads;
