//! The arithmetic of the network on plain slices, compiled once per instruction set. No kernel
//! knows the network.

pub(crate) mod aligned;
pub(crate) mod dropout;
pub(crate) mod gates;
pub(crate) mod gemm;
pub(crate) mod norm;
pub(crate) mod outer;
pub(crate) mod real;
pub(crate) mod rows;
pub(crate) mod simd;
