//! The network on a GPU: a second engine beside `selvedge_model`'s, for the same weights and the same
//! files.
//!
//! Bottom to top: `source` has the kernels with a table of each, `plan` the memory, `schedule` what is
//! done with both, as plain data; a `device` runs that. `network` lowers a network to schedules. So
//! everything but the calls of a driver is proven where there is no GPU, on the `host`: the same kernels,
//! compiled by the C compiler, under the same schedules, against the CPU engine.

pub mod adam;
pub mod backward;
pub mod cloths;
pub mod conformance;
#[cfg(feature = "cuda")]
pub mod cuda;
pub mod device;
pub mod features;
pub mod features_backward;
pub mod frames;
#[cfg(feature = "host")]
pub mod host;
pub mod inference;
pub mod layers;
pub mod learning;
pub mod limits;
pub mod losses;
pub mod motion;
pub mod network;
pub mod plan;
pub mod profile;
pub mod rollout;
pub mod schedule;
pub mod source;
pub mod stepper;
pub mod training;

#[cfg(test)]
mod test_graphs;
