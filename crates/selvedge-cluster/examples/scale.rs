//! The model of a training step as a table: time per step, and the part of it that is work, for
//! numbers of ranks.
//!
//! `cargo run -p selvedge-cluster --example scale -- PIECES PIECE_MS PARAMETERS UPDATE_MS`: pieces
//! of the gradient per step, time of one `[ms]`, weights, time of what every rank does `[ms]`.
#![allow(clippy::print_stdout, reason = "a table for people")]

use selvedge_cluster::{Link, StepPieces};

fn main() {
    let mut numbers = std::env::args().skip(1).map(|word| word.parse::<f64>());
    let mut next = || numbers.next().and_then(Result::ok).unwrap_or(0.0);
    let pieces = StepPieces {
        pieces: next() as usize,
        piece: 1e-3 * next(),
        parameters: next() as usize,
        // Reading two numbers and writing one, at 10 GB/s.
        adding: 1.2e-9,
        update: 1e-3 * next(),
    };
    let links = [("10 Gbit/s", 30e-6, 1.2e9), ("100 Gbit/s", 2e-6, 12e9)];
    println!("| ranks | network | step | sums | speed-up | efficiency |");
    println!("|---|---|---|---|---|---|");
    for ranks in [1, 2, 4, 8, 16, 64, 512] {
        for (name, latency, bandwidth) in links {
            let link = Link { latency, bandwidth };
            let (step, talk) = (pieces.step(ranks, link), pieces.talk(ranks, link));
            let speed_up = pieces.step(1, link) / step;
            let efficiency = 100.0 * pieces.efficiency(ranks, link);
            println!(
                "| {ranks} | {name} | {:.1} ms | {:.1} ms | {speed_up:.1} | {efficiency:.0} % |",
                1e3 * step,
                1e3 * talk
            );
        }
    }
}
