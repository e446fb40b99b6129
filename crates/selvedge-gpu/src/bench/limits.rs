//! The limits of a device, measured: the speed of products of large matrices, and the bandwidth of
//! its memory. Benches compare the time of a network with these, not with a data sheet.

use std::time::Instant;

use crate::device::{Device, DeviceError, Loaded, Precision, Prepared};
use crate::kernels::{Program, Sizes};
use crate::schedule::plan::Plan;
use crate::schedule::{Epilogue, Matrix, Onto, Product, Schedule};

/// Measured runs, of which the fastest counts.
pub(crate) const RUNS: usize = 5;

/// Products or copies in a run.
pub(crate) const REPEATS: usize = 8;

/// The measured limits of a device.
#[derive(Clone, Copy, Debug)]
pub struct Limits {
    /// Floating-point operations per second of square products, two for each multiplication with
    /// its addition: full, tensor and half. Half has bf16 factors in memory, where the device can
    /// do so.
    pub products: [f64; 3],
    /// Bytes read and written per second by a copy.
    pub bandwidth: f64,
}

/// Measures a device by square matrices of `side` rows.
///
/// # Errors
/// When the device fails, or has too little memory.
pub fn limits(device: &dyn Device, side: usize) -> Result<Limits, DeviceError> {
    let mut products = [0.0; 3];
    let precisions = [Precision::Full, Precision::Tensor, Precision::Half];
    for (limit, precision) in products.iter_mut().zip(precisions) {
        let seconds = measure(device, precision, side, |[a, b, c]| {
            let mut schedule = Schedule::new("products");
            for _ in 0..REPEATS {
                schedule.product(Product {
                    size: [side; 3],
                    a: Matrix::new(a, side),
                    b: Matrix::new(b, side),
                    c: Matrix::new(c, side),
                    onto: Onto::Set,
                    epilogue: Epilogue::Nothing,
                });
            }
            schedule
        })?;
        *limit = (REPEATS * 2 * side * side * side) as f64 / seconds;
    }
    if let Some(narrow) = device.narrow_products(side)? {
        products[2] = narrow;
    }
    let seconds = measure(device, Precision::Full, side, |[a, _, c]| {
        let mut schedule = Schedule::new("copies");
        (0..REPEATS).for_each(|_| schedule.copy(a, c));
        schedule
    })?;
    let bandwidth = (REPEATS * 2 * 4 * side * side) as f64 / seconds;
    Ok(Limits {
        products,
        bandwidth,
    })
}

/// Numbers between -1 and 1. A card takes less power, and is faster, where it multiplies zeros.
pub(crate) fn drawn(count: usize) -> impl Iterator<Item = f32> {
    // Weyl's sequence of the golden ratio.
    (0..count).map(|i| (i as u32).wrapping_mul(0x9e37_79b9) as i32 as f32 / 2_147_483_648.0)
}

/// Seconds of the fastest run of a schedule on three matrices, of which two hold drawn numbers.
fn measure(
    device: &dyn Device,
    precision: Precision,
    side: usize,
    schedule: impl FnOnce([crate::schedule::plan::Region; 3]) -> Schedule,
) -> Result<f64, DeviceError> {
    let mut plan = Plan::new();
    let matrices = ["a", "b", "c"].map(|name| plan.floats(name, side * side));
    let program = Program::new(Sizes {
        latent: 1,
        node_width: 1,
        edge_width: 1,
    });
    let mut loaded = device.load(&program, &plan, precision)?;
    let numbers: Vec<f32> = drawn(side * side).collect();
    for matrix in &matrices[..2] {
        loaded.put(*matrix, &numbers)?;
    }
    let prepared = loaded.prepare(&schedule(matrices))?;
    // The first two runs load libraries and may be recorded.
    let times = (0..RUNS + 2).map(|_| time(&mut *loaded, prepared));
    let times = times.collect::<Result<Vec<f64>, _>>()?;
    Ok(times.into_iter().skip(2).fold(f64::INFINITY, f64::min))
}

fn time(loaded: &mut dyn Loaded, prepared: Prepared) -> Result<f64, DeviceError> {
    loaded.wait()?;
    let begin = Instant::now();
    loaded.run(prepared)?;
    loaded.wait()?;
    Ok(begin.elapsed().as_secs_f64())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_graphs::device;

    #[test]
    fn limits_are_those_of_something_that_computes() {
        let device = device();
        let found = limits(device, 64).expect("a measurement");
        // Bounds that any machine keeps at matrices as small: they only check the counts.
        for limit in found.products.into_iter().chain([found.bandwidth]) {
            assert!((1e6..1e13).contains(&limit), "{limit}");
        }
    }

    #[test]
    fn drawn_numbers_are_spread_evenly() {
        let numbers: Vec<f32> = drawn(4096).collect();
        let mean = |of: &dyn Fn(f32) -> f32| numbers.iter().map(|&x| of(x)).sum::<f32>() / 4096.0;
        // Of an even spread over (-1, 1) 0 and 1/3; the sequence strays from it by less than 1 /
        // count.
        assert!(mean(&|x| x).abs() < 2e-3);
        assert!((mean(&|x| x * x) - 1.0 / 3.0).abs() < 2e-3);
    }
}
