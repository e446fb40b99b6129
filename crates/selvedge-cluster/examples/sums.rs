//! Times of sums over the ranks of an MPI job: the part of a training step that is no work on
//! gradients.
//!
//! `mpirun -n 2 target/release/examples/sums 2605955`, with the number of weights, after
//! `cargo build --release -p selvedge-cluster --features mpi --example sums`.
#![allow(clippy::print_stdout, reason = "a table for people")]

use std::error::Error;
use std::time::Instant;

use selvedge_cluster::{ClusterError, open_mpi};

const ROUNDS: usize = 21;

fn main() -> Result<(), Box<dyn Error>> {
    let ranks = open_mpi()?;
    let weights = std::env::args().nth(1).unwrap_or_default().parse()?;
    let (own, mut total) = (vec![1.0; weights], vec![0.0; weights]);
    let mut times = Vec::with_capacity(ROUNDS);
    for _ in 0..ROUNDS {
        // All begin together.
        ranks.gather_for_all(Vec::new())?;
        let started = Instant::now();
        ranks.sum_in_order(&mut total, &mut |range, sum| {
            sum.iter_mut()
                .zip(&own[range])
                .for_each(|(s, own)| *s += own);
            Ok::<_, ClusterError>(())
        })?;
        times.push(1e3 * started.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    if ranks.is_first() {
        let count = ranks.count();
        let (median, most) = (times[ROUNDS / 2], times[ROUNDS - 1]);
        println!("{weights} numbers on {count} ranks: median {median:.2} ms, most {most:.2} ms");
    }
    Ok(ranks.leave()?)
}
