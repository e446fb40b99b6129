//! The learned simulator without the learning: what a network is made of, the features it sees,
//! its arithmetic forward and backward, its weights on disk, and the rollout as a
//! [`selvedge_cloth::Stepper`].

mod features;
mod graph;
mod kernels;
mod network;
mod rollout;
mod spec;
#[cfg(test)]
mod test_cloth;

pub use features::{
    Column, Extent, Frames, Normalizer, NormalizerError, Place, Pose, PoseGradient,
    RunningStatistics, Window, edge_columns, edge_features, edge_features_backward, edge_groups,
    node_columns, node_features, node_features_backward, node_groups,
};
pub use graph::{
    ClothGraph, ClothSize, Connectivity, GraphError, Hinge, Link, LocalFrame, Yaw, geometry,
};
pub use kernels::dropout::Dropout;
pub use kernels::gates::{Gate, GateLayout};
pub use kernels::real::Real;
pub use kernels::simd::Instructions;
pub use network::cost::{Activations, FirstEdgeLayer, Flops, activations, flops};
pub use network::packed::{PackedWeights, Purpose};
pub use network::parameters::{Parameter, Start};
pub use network::workspace::Workspace;
pub use network::{
    Carried, EncoderState, Gradients, Input, InputGradient, Network, NetworkScalar, Pass,
    StateGradients,
};
pub use network::{reference, roofline};
pub use rollout::{
    LearnedStepper, LocalAcceleration, MODEL_FORMAT, Model, ModelError, ModelFileError, NonFinite,
    Normalizers, RolloutError, TwoFrames, WeightType, advance, advance_backward, opening_frames,
    target_acceleration,
};
pub use spec::{
    Carries, Carry, EdgeFeature, EdgeLimits, Encoder, Integration, LastFrames, ModelSpec,
    NodeFeature, ReferenceSlope, SpecError,
};
