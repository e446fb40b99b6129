//! The learned simulator without the learning: what a network is made of, the features it sees,
//! its arithmetic forward and backward, its weights on disk, and the rollout as a
//! [`selvedge_cloth::Stepper`].

mod connectivity;
mod kernels;
mod layers;
mod network;
mod parameters;
mod product;
mod real;
pub mod reference;
mod spec;

pub use connectivity::Connectivity;
pub use network::{Dropout, Input, Network, Pass, Workspace};
pub use parameters::{Parameter, Start};
pub use real::Real;
pub use spec::{EdgeFeature, Encoder, ModelSpec, NodeFeature, SpecError};
