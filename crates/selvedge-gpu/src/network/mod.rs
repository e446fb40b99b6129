//! A [`selvedge_model::Network`] as schedules: the kernels and products from normalised features to
//! accelerations ([`forward()`]), and the way back ([`backward()`]).
//!
//! It is the network of `selvedge_model`, with the same split of the first edge layer and the same
//! weights in the same order; only the grouping of operations differs. Rows are vertices or arcs of
//! a disjoint union of cloths.

mod arrays;
mod backward;
mod dropout;
mod forward;
mod linear;
mod record;
mod weights;

pub use arrays::{GraphArrays, InputArrays};
pub use backward::{BackwardPass, backward};
pub use dropout::{Dropout, DropoutSizes};
pub use forward::{ForwardPass, Keep, forward};
pub use record::{BlockRecord, EncoderRecord, GruRecord, MlpRecord, Record};
pub use weights::WeightArrays;

/// Columns of the output of a network that learns here: an acceleration.
pub const OUTPUTS: usize = 3;
