//! The choices that make a model: the spec of its network and features, the integration of its
//! output and the limits of its edges.

pub(crate) mod integration;
pub(crate) mod limits;
mod model_spec;

pub use integration::{Carries, Carry, Integration, LastFrames, ReferenceSlope};
pub use limits::EdgeLimits;
pub use model_spec::{
    CurrentFrame, EdgeFeature, Encoder, ModelSpec, NodeFeature, OUTPUTS, SpecError,
};
