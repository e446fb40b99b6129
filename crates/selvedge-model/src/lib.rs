//! The learned simulator without the learning: what a network is made of, the features it sees,
//! its arithmetic forward and backward, its weights on disk, and the rollout as a
//! [`selvedge_cloth::Stepper`].

mod aligned;
mod connectivity;
mod cost;
mod features;
mod frame;
pub mod geometry;
mod graph;
mod half;
mod integration;
mod kernels;
mod lanes;
mod layers;
mod leaves;
mod levels;
mod limits;
mod model;
mod model_file;
mod network;
mod normalizer;
mod packed;
mod parameters;
mod product;
mod real;
pub mod reference;
mod rollout;
pub mod roofline;
mod spec;
#[cfg(test)]
mod test_cloth;
mod window;
mod workspace;

pub use connectivity::Connectivity;
pub use cost::{Activations, FirstEdgeLayer, Flops, activations, flops};
pub use features::backward::{PoseGradient, edge_features_backward, node_features_backward};
pub use features::{
    Column, Pose, edge_columns, edge_features, edge_groups, node_columns, node_features,
    node_groups,
};
pub use frame::{LocalFrame, Yaw};
pub use graph::{ClothGraph, ClothParts, GraphError, Hinge};
pub use half::WeightType;
pub use integration::{Carries, Carry, Integration, ReferenceSlope};
pub use lanes::Instructions;
pub use levels::Link;
pub use limits::EdgeLimits;
pub use model::{Model, ModelError, Normalizers};
pub use model_file::{MODEL_FORMAT, ModelFileError};
pub use network::{Dropout, Gradients, Input, InputGradient, Network, Pass, StateGradients};
pub use normalizer::{Normalizer, NormalizerError, RunningStatistics};
pub use packed::{PackedWeights, Purpose};
pub use parameters::{Parameter, Start};
pub use real::Real;
pub use rollout::{LearnedStepper, RolloutError, integrate, opening_frames};
pub use spec::{EdgeFeature, Encoder, ModelSpec, NodeFeature, SpecError};
pub use window::{Extent, Frames, Place, Window};
pub use workspace::{EncoderState, Workspace};
