//! Gradients of whole steps: of micro-batches, and through several frames of a rollout.

mod gradient;
mod rollout;
