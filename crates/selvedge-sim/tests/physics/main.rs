//! What the reference physics must do, seen from outside.
#![allow(clippy::unwrap_used, reason = "a test may panic")]

mod allocation;
mod golden;
mod reference;
mod rest;
mod scenes;
mod simulator;
