//! The model against ranks whose network is slow on purpose.

use std::sync::Barrier;
use std::thread;
use std::time::{Duration, Instant};

use super::*;
use crate::error::ClusterError;
use crate::local::{Delays, threads};

/// Time of a step on ranks that sleep instead of learning, over a network that is as slow as
/// `link`; the least of `rounds`.
fn simulated(pieces: StepPieces, ranks: usize, link: Link, rounds: usize) -> f64 {
    let delays = Delays {
        latency: link.latency,
        per_byte: 1.0 / link.bandwidth,
    };
    // All begin at once: a message of the network would reach one after the other.
    let begin = Barrier::new(ranks);
    let begin = &begin;
    let spans = thread::scope(|scope| {
        let all = threads(ranks, delays).into_iter().map(|ranks| {
            scope.spawn(move || {
                let own = share_of(pieces.pieces, ranks.rank(), ranks.count()).len();
                let mut total = vec![0.0; pieces.parameters];
                let mut spans = Vec::new();
                for _ in 0..rounds {
                    begin.wait();
                    let started = Instant::now();
                    thread::sleep(Duration::from_secs_f64(own as f64 * pieces.piece));
                    ranks.gather_for_all(vec![0; 100]).unwrap();
                    let add = &mut |_, _: &mut [f32]| Ok::<_, ClusterError>(());
                    ranks.sum_in_order(&mut total, add).unwrap();
                    ranks.gather_for_all(vec![0]).unwrap();
                    spans.push(started.elapsed().as_secs_f64());
                }
                spans
            })
        });
        let all: Vec<_> = all.collect();
        all.into_iter()
            .map(|rank| rank.join().unwrap())
            .collect::<Vec<_>>()
    });
    // A step ends when the last rank is done.
    let ends = (0..rounds).map(|round| spans.iter().map(|s| s[round]).fold(0.0, f64::max));
    ends.fold(f64::INFINITY, f64::min)
}

#[test]
#[ignore = "times threads that sleep, which needs a machine with nothing else to do"]
fn the_model_is_right_about_a_slow_network() {
    let pieces = StepPieces {
        pieces: 12,
        piece: 0.01,
        parameters: 12 * CHUNK,
        adding: 0.0,
        update: 0.0,
    };
    // A chunk takes 8 ms or 1.3 ms to leave: long against the sleep of threads.
    for (bandwidth, latency) in [(16.0e6, 0.0005), (100.0e6, 0.01)] {
        let link = Link { latency, bandwidth };
        for ranks in [2, 3, 4, 6] {
            let expected = pieces.step(ranks, link);
            let found = simulated(pieces, ranks, link, 3);
            let ratio = found / expected;
            assert!(
                (0.85..1.25).contains(&ratio),
                "{ranks} ranks, {bandwidth} B/s: {found} s, the model says {expected} s"
            );
        }
    }
}

#[test]
fn a_step_is_never_faster_than_its_share_or_its_bytes() {
    let pieces = StepPieces {
        pieces: 64,
        piece: 0.1,
        parameters: 1_000_000,
        adding: 1e-10,
        update: 0.001,
    };
    let link = Link {
        latency: 2e-6,
        bandwidth: 1e9,
    };
    assert!((pieces.efficiency(1, link) - 1.0).abs() < 1e-12);
    for ranks in [2, 8, 64, 512] {
        let step = pieces.step(ranks, link);
        let share = 0.1 * (64_f64 / ranks as f64).ceil();
        assert!(step > share + 4e6 / 1e9, "{ranks}");
        assert!(pieces.efficiency(ranks, link) < 1.0);
    }
    // More ranks than pieces gain nothing.
    assert!(pieces.step(512, link) > pieces.step(64, link));
}
