//! The network on a GPU: a second engine beside `selvedge_model`'s, for the same weights and the
//! same files. [`rollout::stepper::GpuStepper`] moves one cloth as any `Stepper` does,
//! [`rollout::Rollout`] several at once, and [`training::OnDevice`] makes the engine of a training.
//!
//! # Terms
//!
//! - A **kernel** is a function in C that works on one element, one row or one block ([`kernels`]).
//!   Its source is both CUDA C and C99.
//! - A **plan** places named arrays in one **arena** of memory before anything is allocated
//!   ([`schedule::plan`]). A **region** is part of an array.
//! - A **schedule** is a list of commands as plain data: launches of kernels, matrix products,
//!   clears, copies ([`schedule`]). A **trace** follows it without running it and finds arguments
//!   that do not fit, regions that are too short, and values that are read before they are written.
//! - A **device** compiles a **program** of kernels, allocates an arena, and runs schedules
//!   ([`device`]). The *host* device is this machine's processor with its C compiler, for tests
//!   (feature `host`); the *CUDA* device is an NVIDIA GPU (feature `cuda`).
//! - A **union** is several cloths side by side as one graph ([`cloths`]).
//!
//! [`network`] lowers a network to schedules, forward and backward; [`cloths`] adds features,
//! integration and losses around it. So everything except the calls of a driver is tested where
//! there is no GPU: the host runs the same kernels under the same schedules, against the
//! processor's engine.
//!
//! # Example
//!
//! c = max(a b + bias, 0), then c += a, on the host device:
//!
//! ```
//! use selvedge_gpu::device::host::Host;
//! use selvedge_gpu::device::{Device, DeviceError, Precision};
//! use selvedge_gpu::kernels::{Program, Sizes, backward};
//! use selvedge_gpu::schedule::plan::Plan;
//! use selvedge_gpu::schedule::{Epilogue, Matrix, Onto, Product, Schedule};
//!
//! let mut plan = Plan::new();
//! let [a, b, c] = ["a", "b", "c"].map(|name| plan.floats(name, 4));
//! let bias = plan.floats("bias", 2);
//!
//! let mut schedule = Schedule::new("an example");
//! schedule.product(Product {
//!     size: [2, 2, 2],
//!     a: Matrix::new(a, 2),
//!     b: Matrix::new(b, 2),
//!     c: Matrix::new(c, 2),
//!     onto: Onto::Set,
//!     epilogue: Epilogue::BiasRelu(bias),
//! });
//! schedule.launch(&backward::ADD, 4, vec![("to", c.into()), ("what", a.into())]);
//!
//! let sizes = Sizes { latent: 2, node_width: 1, edge_width: 1 };
//! let mut program = Program::new(sizes);
//! program.add(&backward::PART);
//! let mut loaded = Host::new()?.load(&program, &plan, Precision::Full)?;
//! loaded.put(a, &[1.0, 2.0, 3.0, 4.0])?;
//! loaded.put(b, &[1.0, 0.0, 0.0, 1.0])?;
//! loaded.put(bias, &[-2.0, 1.0])?;
//! let prepared = loaded.prepare(&schedule)?;
//! loaded.run(prepared)?;
//! assert_eq!(loaded.get(c)?, [1.0, 5.0, 4.0, 9.0]);
//! # Ok::<(), DeviceError>(())
//! ```
//!
//! # Outside this crate
//!
//! It reads no files and knows no command line. Models, graphs and the arithmetic that results are
//! compared with belong to `selvedge_model`; the loop of a training and its random numbers belong
//! to `selvedge_train`. Sums never use atomics: they run over sorted arcs in a fixed order.

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
