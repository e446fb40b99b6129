//! The whole network (Encode-Process-Decode): encoders, processor and decoder, forward and backward
//! on one flat array of weights, in `f32` or `f64`.
//!
//! `reference.rs` is the readable twin of this engine: the equations as they are written, in `f64`,
//! without tiles, packing or threads. Read it first; the tests compare the engine with it.

pub(crate) mod arguments;
mod backward;
mod definition;
pub(crate) mod encoder_state;
mod forward;
mod layers;
pub(crate) mod packed;
pub(crate) mod parameters;
mod passes;
pub mod reference;
mod saved;
pub(crate) mod workspace;

pub use arguments::{Carried, Gradients, Input, InputGradient, Pass, StateGradients, Stopped};
pub use definition::Network;
pub use encoder_state::EncoderState;
pub use passes::NetworkScalar;
