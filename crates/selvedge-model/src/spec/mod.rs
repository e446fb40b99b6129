//! The choices that make a model: the spec of its network and features.

pub(crate) mod base;
mod model_spec;

pub use base::{FrameTimes, MOST_DEVIATIONS, PhysicsBase};
pub use model_spec::{
    CurrentFrame, EdgeFeature, Encoder, Integration, ModelSpec, NodeFeature, SpecError,
};
