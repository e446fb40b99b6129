//! The reference physics seen from outside.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod allocation;
mod book;
mod closed_forms;
mod conformance;
mod contact;
mod contact_always;
mod contact_edges;
mod contact_friction;
mod contact_random;
mod contact_resume;
mod dressed;
mod dynamics;
mod energy;
mod falls;
mod fit;
mod golden;
mod grip;
mod impact;
mod led;
mod lies_still;
mod overstretch;
mod releases;
mod rest;
mod rest_long;
mod robustness;
mod round;
mod scenes;
mod sewn;
mod sheets;
mod simulator;
mod solvers;
mod squeezed;
mod statics;
#[path = "../../../selvedge-cloth/tests/conformance/mod.rs"]
mod stepper_checks;
mod touching;
