//! Gradients of the solver against central differences of whole runs.
#![allow(clippy::unwrap_used, reason = "a test may panic")]
#![allow(clippy::print_stdout, reason = "the errors that were found")]

mod differences;
mod price;
mod rest;
#[allow(dead_code, reason = "other tests need the rest of them")]
#[path = "../physics/scenes.rs"]
mod scenes;
#[allow(dead_code, reason = "other tests need the rest of them")]
#[path = "../physics/sheets.rs"]
mod sheets;
mod third_derivatives;
mod touching;
