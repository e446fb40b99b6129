//! What ranks do together comes out the same on any number of them.

use std::collections::VecDeque;
use std::sync::Mutex;
use std::thread;

use super::*;
use crate::local::{Threads, threads};
use crate::transport::{Letter, Transport};

fn on_all<T: Send>(count: usize, work: impl Fn(&Ranks) -> T + Sync) -> Vec<T> {
    on_each(threads(count), work)
}

fn on_each<T: Send>(ranks: Vec<Ranks>, work: impl Fn(&Ranks) -> T + Sync) -> Vec<T> {
    thread::scope(|scope| {
        let (work, ranks) = (&work, ranks.into_iter());
        let all: Vec<_> = ranks.map(|r| scope.spawn(move || work(&r))).collect();
        all.into_iter().map(|rank| rank.join().unwrap()).collect()
    })
}

/// Numbers whose sum depends on its order.
fn piece(piece: usize, count: usize) -> Vec<f32> {
    let number = |k: usize| ((k * 7919 + piece * 104_729) % 1000) as f32 * 1.0e-3 - 0.37;
    let scale = 10_f32.powi(piece as i32 % 5 - 2);
    (0..count).map(|k| number(k) * scale).collect()
}

#[test]
fn gathers_reach_all_that_they_are_for() {
    for count in 1..10 {
        let expected: Vec<Vec<u8>> = (0..count).map(|r| vec![r as u8; 3 * r]).collect();
        let all = on_all(count, |ranks| {
            let own = vec![ranks.rank() as u8; 3 * ranks.rank()];
            (
                ranks.gather(own.clone()).unwrap(),
                ranks.gather_for_all(own).unwrap(),
            )
        });
        for (rank, (gathered, everywhere)) in all.into_iter().enumerate() {
            let at_first = if rank == 0 { &expected[..] } else { &[] };
            assert_eq!(gathered, at_first);
            assert_eq!(everywhere, expected);
        }
    }
}

#[test]
fn a_sum_has_the_same_bits_on_any_number_of_ranks() {
    let (pieces, numbers) = (11, 2 * CHUNK + 17);
    let all: Vec<Vec<f32>> = (0..pieces).map(|k| piece(k, numbers)).collect();
    let sum = |pieces: &mut dyn Iterator<Item = &Vec<f32>>| {
        pieces.fold(vec![0.0_f32; numbers], |mut sum, piece| {
            sum.iter_mut().zip(piece).for_each(|(sum, p)| *sum += p);
            sum
        })
    };
    let (expected, backwards) = (sum(&mut all.iter()), sum(&mut all.iter().rev()));
    assert_ne!(expected, backwards, "the order of the sum can be seen");
    for count in [1, 2, 3, 4, 7, 11, 13] {
        let sums = on_all(count, |ranks| {
            let own = share_of(pieces, ranks.rank(), ranks.count());
            let mut total = vec![f32::NAN; numbers];
            let add = &mut |range: Range<usize>, sum: &mut [f32]| {
                for piece in &all[own.clone()] {
                    let part = &piece[range.clone()];
                    sum.iter_mut().zip(part).for_each(|(sum, p)| *sum += p);
                }
                Ok::<_, ClusterError>(())
            };
            ranks.sum_in_order(&mut total, add).unwrap();
            (total, ranks.traffic().bytes)
        });
        for (sum, bytes) in sums {
            assert!(sum == expected, "{count} ranks");
            assert!(
                bytes <= 8 * numbers as u64,
                "each number leaves twice at most"
            );
        }
    }
}

/// A carrier whose messages stand still unless the sender looks for others, as large ones do in
/// MPI.
struct Lazy {
    carrier: Threads,
    waiting: Mutex<VecDeque<(usize, u32, Vec<u8>)>>,
}

impl Transport for Lazy {
    fn rank(&self) -> usize {
        self.carrier.rank()
    }

    fn count(&self) -> usize {
        self.carrier.count()
    }

    fn send(&self, to: usize, tag: u32, bytes: Vec<u8>) -> Result<(), ClusterError> {
        self.waiting.lock().unwrap().push_back((to, tag, bytes));
        Ok(())
    }

    fn poll(&self) -> Result<Option<Letter>, ClusterError> {
        if let Some((to, tag, bytes)) = self.waiting.lock().unwrap().pop_front() {
            self.carrier.send(to, tag, bytes)?;
        }
        self.carrier.poll()
    }

    fn is_sending(&self) -> bool {
        !self.waiting.lock().unwrap().is_empty()
    }

    fn is_alive(&self, rank: usize) -> bool {
        self.carrier.is_alive(rank)
    }

    fn local_rank(&self) -> usize {
        self.carrier.local_rank()
    }

    fn place(&self, rank: usize) -> String {
        self.carrier.place(rank)
    }
}

#[test]
fn a_sum_ends_when_all_that_a_rank_sent_has_left_it() {
    for count in 1..5 {
        let lazy = Threads::joined(count).into_iter().map(|one| {
            let waiting = Mutex::default();
            Ranks::new(Box::new(Lazy {
                carrier: one,
                waiting,
            }))
        });
        // A rank that is done is gone, with all that it has not sent.
        let sums = on_each(lazy.collect(), |ranks| {
            let mut total = vec![0.0; 3 * CHUNK];
            let add = &mut |_, sum: &mut [f32]| {
                sum.iter_mut().for_each(|sum| *sum += 1.0);
                Ok::<_, ClusterError>(())
            };
            ranks.sum_in_order(&mut total, add).map(|()| total)
        });
        for sum in sums {
            assert!(
                sum.unwrap().iter().all(|sum| *sum == count as f32),
                "{count}"
            );
        }
    }
}

#[test]
fn shares_are_even_and_in_a_row() {
    for count in 0..20 {
        for ranks in 1..8 {
            let shares: Vec<Range<usize>> = (0..ranks).map(|r| share_of(count, r, ranks)).collect();
            let joined: Vec<usize> = shares.iter().cloned().flatten().collect();
            assert_eq!(joined, (0..count).collect::<Vec<_>>());
            let sizes = shares.iter().map(Range::len);
            assert!(sizes.clone().max().unwrap() - sizes.min().unwrap() <= 1);
        }
    }
}

#[test]
fn a_failure_reaches_whoever_waits() {
    let errors = on_all(4, |ranks| {
        if ranks.rank() == 2 {
            ranks.fail("the disk is full");
            return None;
        }
        ranks.gather_for_all(Vec::new()).err()
    });
    for (rank, error) in errors
        .into_iter()
        .enumerate()
        .filter(|(rank, _)| *rank != 2)
    {
        let message = error.expect("an error").to_string();
        assert_eq!(
            message, "rank 2 has failed: the disk is full",
            "on rank {rank}"
        );
    }
}

#[test]
fn a_rank_that_has_ended_is_named_by_whoever_waits_for_it() {
    let errors = on_all(2, |ranks| match ranks.rank() {
        0 => ranks.receive(1, Tag::GATHER).err(),
        _ => None,
    });
    let Some(ClusterError::Gone { rank: 1, place }) = &errors[0] else {
        panic!("{errors:?}");
    };
    assert!(place.contains("thread 1"), "{place}");
}

#[test]
fn numbers_that_do_not_fit_are_an_error() {
    let errors = on_all(2, |ranks| {
        let mut numbers = vec![0.0; 5 + ranks.rank()];
        ranks.sum_in_order(&mut numbers, &mut |_, _| Ok::<_, ClusterError>(()))
    });
    let error = errors[1].clone().unwrap_err().to_string();
    assert!(
        error.contains("rank 0 sent 20 bytes where 24 belong"),
        "{error}"
    );
}
