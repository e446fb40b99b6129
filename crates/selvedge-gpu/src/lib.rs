//! The network on a GPU: a second engine beside `selvedge_model`'s, for the same weights and the same
//! files.
//!
//! Bottom to top: `source` has the kernels with a table of each, `plan` the memory, `schedule` what is
//! done with both, as plain data; a `device` runs that. `network` lowers a network to schedules. So
//! everything but the calls of a driver is proven where there is no GPU, on the `host`: the same kernels,
//! compiled by the C compiler, under the same schedules, against the CPU engine.

pub mod bench;
pub mod cloths;
pub mod device;
pub mod kernels;
pub mod network;
pub mod rollout;
pub mod schedule;
pub mod training;

#[cfg(test)]
mod test_graphs;
