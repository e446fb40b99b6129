//! The cloth as the network sees it: the graph of its vertices and arcs, its partition among
//! threads, and the local frame that its vectors are turned into.

pub(crate) mod cloth_graph;
pub(crate) mod connectivity;
pub(crate) mod frame;
pub mod geometry;
pub(crate) mod partition;
pub(crate) mod surroundings;
pub(crate) mod weave;

pub use cloth_graph::{ClothGraph, GraphError, Hinge};
pub use connectivity::{ClothSize, Connectivity};
pub use frame::{LocalFrame, Yaw};
