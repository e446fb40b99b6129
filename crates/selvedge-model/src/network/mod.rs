//! The whole network (Encode-Process-Decode): encoders, processor and decoder, forward and backward
//! on one flat array of weights, in `f32` or `f64`.
//!
//! `reference.rs` is the readable twin of this engine: the equations as they are written, in `f64`,
//! without tiles, packing or threads. Read it first; the tests compare the engine with it.

pub(crate) mod arguments;
mod backward;
mod definition;
mod forward;
mod layers;
pub(crate) mod packed;
pub(crate) mod parameters;
mod passes;
pub mod reference;
mod saved;
pub(crate) mod workspace;

pub use arguments::{Gradients, Input, InputGradient, Pass, Stopped};
pub use definition::Network;
pub use passes::NetworkScalar;
