//! The features of nodes and arcs: the table of their columns, their gradient, the window of frames
//! that they are computed for, and their normalisation.

pub(crate) mod backward;
pub(crate) mod columns;
pub(crate) mod normalizer;
pub(crate) mod window;

pub use columns::{Column, edge_columns, edge_groups, node_columns, node_groups};
pub use normalizer::{Normalizer, RunningStatistics};
pub use window::{Frames, Place, Window};
