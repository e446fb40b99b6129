//! Corrected physics: a [`Stepper`](selvedge_cloth::Stepper) whose frames cheap physics predicts
//! and a network corrects.
//!
//! One or two implicit substeps lead to the next frame. They know gravity, air, handles, materials
//! and meshes, but such long substeps lose something: the **truncation error**. It is systematic,
//! and a small network that was taught by converged physics adds most of it back
//! ([`CorrectedStepper`]).
//!
//! This crate alone joins `selvedge-sim` and `selvedge-model`, which do not know each other.

mod base;
mod stepper;

pub use base::{base_scene, cloth_graph, face_stiffness};
pub use stepper::{CorrectedError, CorrectedStepper, FrameState, goes_without};
