//! The laboratory: runs that are timed and guarded, evaluations of models beside naive rivals,
//! reports, and studies that train, measure and compare.
//!
//! Long operations report to an [`OnEvent`] and stop when it says so. Nothing here prints or parses
//! a command line.

pub mod assets;
pub mod cause;
pub mod evaluation;
pub mod event;
pub mod folder;
pub mod generation;
pub mod machine;
pub mod models;
pub mod numbers;
pub mod physics;
pub mod report;
pub mod rigid;
pub mod span;
mod state_log;
pub mod stress;
pub mod study;
pub mod training;
pub mod watched;
pub mod workers;

pub use event::{End, Event, Goal, OnEvent};
