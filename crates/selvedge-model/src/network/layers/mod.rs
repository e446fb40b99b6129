//! The layers of the network, each with its backward pass beside its forward pass.
//!
//! All work on chunks of at most [`crate::graph::partition::CHUNK`] rows, so that the inputs and
//! outputs of a layer stay in cache.

pub(crate) mod block;
pub(crate) mod encoder;
pub(crate) mod gru;
pub(crate) mod mlp;
