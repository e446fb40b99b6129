//! The features of nodes and arcs: the table of their columns, their gradient, the window of frames
//! that they are computed for, and their normalisation.

pub(crate) mod backward;
pub(crate) mod columns;
pub(crate) mod normalizer;
pub(crate) mod window;

pub use backward::{PoseGradient, edge_features_backward, node_features_backward};
pub use columns::{
    Column, Pose, edge_columns, edge_features, edge_groups, node_columns, node_features,
    node_groups,
};
pub use normalizer::{Normalizer, NormalizerError, RunningStatistics};
pub use window::{Frames, Place, Window};
