//! The speed of products of bf16 matrices, the limit against which `half` is measured. The factors
//! of `half` are f32 in memory and rounded on the way.

use std::time::Instant;

use cudarc::driver::result;

use super::context::failed;
use super::owned::{Memory, Stream};
use super::product::{Blas, Gemm, Kind, WORKSPACE};
use crate::bench::limits::{REPEATS, RUNS, drawn};
use crate::device::{DeviceError, Precision};

/// The best speed of several runs of products of two matrices of `side` rows
/// `[floating-point operations per second]`.
pub(super) fn products(side: usize) -> Result<f64, DeviceError> {
    let stream = Stream::new()?;
    let memory = |bytes: usize| Memory::new(bytes).map_err(failed("cuMemAlloc"));
    let (matrices, workspace) = (memory(3 * 2 * side * side)?, memory(WORKSPACE)?);
    // The upper half of an f32 is its value as bf16, rounded towards zero.
    let numbers: Vec<u16> = drawn(2 * side * side)
        .map(|x| (x.to_bits() >> 16) as u16)
        .collect();
    // SAFETY: there is room for three matrices, of which two are written before they are read. The
    // stream is waited for before the numbers are dropped.
    unsafe { result::memcpy_htod_async(matrices.0, &numbers, stream.0) }
        .map_err(failed("cuMemcpyHtoDAsync"))?;
    stream.wait()?;
    let blas = Blas::new(stream.0, workspace.0, Precision::Full)?;
    let gemm = Gemm::square(side).ok_or_else(|| DeviceError::Call {
        call: "cublasGemmEx",
        reason: format!("a product of {side} rows is too large"),
    })?;
    let mut fastest = f64::INFINITY;
    for _ in 0..RUNS {
        stream.wait()?;
        let begin = Instant::now();
        for _ in 0..REPEATS {
            blas.multiply_kind(&gemm, matrices.0, Kind::Bf16)?;
        }
        stream.wait()?;
        fastest = fastest.min(begin.elapsed().as_secs_f64());
    }
    Ok((REPEATS * 2 * side * side * side) as f64 / fastest)
}
