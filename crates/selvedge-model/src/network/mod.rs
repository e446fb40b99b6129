//! The whole network (Encode-Process-Decode): encoders, processor and decoder, forward and backward
//! on one flat array of weights, in `f32` or `f64`.
//!
//! `tests/model/reference.rs` is the readable twin of this engine: the equations as they are written,
//! in `f64`, without tiles, packing or threads. Read it first; the tests compare the engine with it.

mod backward;
mod definition;
mod forward;
pub(crate) mod kept;
mod layers;
pub(crate) mod packed;
pub(crate) mod parameters;
pub(crate) mod passes;
pub(crate) mod workspace;

pub use definition::Network;
pub use passes::{Gradients, Input, InputGradient, NetworkScalar, Pass, Stopped};
