//! Passes and steps of learning on features that lie ready, for benches.

mod case;
pub mod inference;
pub mod learning;

pub use case::NetworkCase;
