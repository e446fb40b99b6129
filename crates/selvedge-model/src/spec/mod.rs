//! The choices that make a model: the spec of its network and features.

mod model_spec;

pub use model_spec::{
    EdgeFeature, Encoder, Integration, ModelSpec, NodeFeature, OUTPUTS, SpecError,
};
