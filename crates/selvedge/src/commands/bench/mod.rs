//! `selvedge bench`: how fast this machine runs the product.

#[cfg(feature = "gpu")]
mod cloths;
#[cfg(feature = "gpu")]
mod conformance;
pub(crate) mod engine;
#[cfg(feature = "gpu")]
mod gpu;
mod peer;
mod products;
pub(crate) mod scale;
mod variants;

/// Runs a command of a program that was built for GPUs, or says that it was not.
macro_rules! on_gpu {
    ($command:ident, $args:expr) => {{
        #[cfg(feature = "gpu")]
        {
            $command::run($args)
        }
        #[cfg(not(feature = "gpu"))]
        {
            let machine = $args.machine.open()?;
            anyhow::bail!("{} is no GPU: take --device cuda", machine.name())
        }
    }};
}

use std::time::Instant;

use anyhow::Context;
use rayon::ThreadPool;

use crate::cli::{ConformanceArgs, GpuArgs};
use crate::output::Answer;

/// `selvedge bench gpu`.
///
/// # Errors
/// A device that is not there, or fails.
pub(crate) fn gpu(args: &GpuArgs) -> anyhow::Result<Answer> {
    on_gpu!(gpu, args)
}

/// `selvedge bench conformance`.
///
/// # Errors
/// A device that is not there, or fails, or computes something else than the processor.
pub(crate) fn conformance(args: &ConformanceArgs) -> anyhow::Result<Answer> {
    on_gpu!(conformance, args)
}

/// The middle of some numbers, or the mean of the middle two; 0 of none.
fn median(mut numbers: Vec<f64>) -> f64 {
    numbers.sort_by(f64::total_cmp);
    let count = numbers.len();
    match count {
        0 => 0.0,
        _ => 0.5 * (numbers[(count - 1) / 2] + numbers[count / 2]),
    }
}

/// The median of the quotients of runs beside each other.
fn median_ratio(above: &[f64], below: &[f64]) -> f64 {
    median(above.iter().zip(below).map(|(a, b)| a / b).collect())
}

/// The time of some work `[ms]`.
fn time(work: impl FnOnce()) -> f64 {
    let begin = Instant::now();
    work();
    1e3 * begin.elapsed().as_secs_f64()
}

/// Threads to measure with, and how many they are.
fn threads(wanted: Option<u16>) -> anyhow::Result<(ThreadPool, usize)> {
    let count = wanted.map_or_else(rayon::current_num_threads, usize::from);
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(count)
        .build()
        .context("starting threads")?;
    Ok((pool, count))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn medians_are_the_middle_and_ratios_those_of_pairs() {
        assert_eq!(median(vec![3.0, 1.0, 2.0]), 2.0);
        assert_eq!(median(vec![4.0, 1.0, 2.0, 3.0]), 2.5);
        assert_eq!(median(Vec::new()), 0.0);
        // 2, 3, 1: not the quotient of the medians.
        assert_eq!(median_ratio(&[2.0, 6.0, 5.0], &[1.0, 2.0, 5.0]), 2.0);
    }
}
