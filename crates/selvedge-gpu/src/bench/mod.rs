//! Measurements and comparisons: passes and steps of learning on features that lie ready, the
//! device's own limits, the cost of each command, and trainings held against the processor's.

mod case;
pub mod conformance;
pub mod inference;
pub mod learning;
pub mod limits;
pub mod profile;

pub use case::NetworkCase;
