//! The network on a GPU of any vendor: a second engine beside `selvedge_model`'s, for the same
//! weights and the same files. [`rollout::OnGpu`] is the network of a `LearnedStepper`, and
//! [`training::OnGpu`] makes the engine of a training.
//!
//! `wgpu` reaches the GPU by Vulkan, Metal or Direct3D 12; the kernels are WGSL, in the folder
//! `kernels`. A driver that calculates on the processor, Mesa's lavapipe, is a GPU too: the tests
//! run on it where there is no other.
//!
//! # Terms
//!
//! - A **plan** places all arrays of a session in two buffers, one of numbers and one of indices,
//!   before anything is allocated ([`gpu::Plan`]).
//! - A **launch** is a kernel with its parameters, among them the places of its arrays; a
//!   **schedule** is a list of them, recorded once ([`gpu::Schedule`]).
//! - A **union** is several cloths side by side as one graph.
//! - **Passes** are the network on a union, forward and backward ([`passes::Passes`]). Features,
//!   losses and the integration around them are the processor's.
//!
//! # Determinism
//!
//! Sums run in a fixed order and never use atomics: the same GPU with the same driver gives the same
//! bytes, and a cloth in a union those that it gives alone.

#[cfg(test)]
#[path = "../../selvedge-cloth/tests/conformance/mod.rs"]
mod conformance;
pub mod gpu;
mod kernels;
mod network;
pub mod passes;
pub mod rollout;
pub mod training;

#[cfg(test)]
mod test_graphs;
#[cfg(test)]
mod tests;
