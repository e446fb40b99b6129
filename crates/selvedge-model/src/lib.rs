//! The learned simulator without the learning: what a network is made of, the features it sees,
//! its arithmetic forward and backward, its weights on disk, and the rollout as a
//! [`selvedge_cloth::Stepper`].

mod spec;

pub use spec::{EdgeFeature, Encoder, ModelSpec, NodeFeature, SpecError};
