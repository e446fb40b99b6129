//! What ranks do together comes out the same on any number of them.

use std::sync::mpsc::{Receiver, SyncSender, sync_channel};
use std::sync::{Mutex, mpsc};
use std::thread;

use super::*;

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
            total
        });
        for sum in sums {
            assert!(sum == expected, "{count} ranks");
        }
    }
}

/// A carrier that does not go on before what it sends is read, as MPI with large messages.
#[derive(Default)]
struct Meeting {
    to: Vec<SyncSender<Vec<u8>>>,
    from: Vec<Mutex<Receiver<Vec<u8>>>>,
}

impl Transport for Meeting {
    fn send(&self, to: usize, bytes: &[u8]) -> Result<(), ClusterError> {
        let sent = self.to[to].send(bytes.to_vec());
        sent.map_err(|_| ClusterError::Gone { rank: to })
    }

    fn receive(&self, from: usize) -> Result<Vec<u8>, ClusterError> {
        let bytes = self.from[from]
            .lock()
            .unwrap()
            .recv_timeout(Duration::from_secs(20));
        assert_ne!(
            bytes,
            Err(mpsc::RecvTimeoutError::Timeout),
            "ranks wait for each other"
        );
        bytes.map_err(|_| ClusterError::Gone { rank: from })
    }

    fn end(&self, _failure: Option<u8>) {}
}

#[test]
fn no_two_ranks_wait_for_each_other() {
    for count in 1..5 {
        let mut all: Vec<Meeting> = (0..count).map(|_| Meeting::default()).collect();
        for from in 0..count {
            for to in 0..count {
                let (sender, receiver) = sync_channel(0);
                all[from].to.push(sender);
                all[to].from.push(Mutex::new(receiver));
            }
        }
        let all = all.into_iter().enumerate();
        let all = all.map(|(rank, one)| Ranks::new([rank, count, rank], Arc::new(one)));
        let sums = on_each(all.collect(), |ranks| {
            let mut total = vec![0.0; 3 * CHUNK];
            let add = &mut |_, sum: &mut [f32]| {
                sum.iter_mut().for_each(|sum| *sum += 1.0);
                Ok::<_, ClusterError>(())
            };
            let own = vec![ranks.rank() as u8; 5];
            assert_eq!(ranks.gather_for_all(own).unwrap().len(), count);
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
fn a_rank_that_has_ended_is_named_by_whoever_waits_for_it() {
    let gathered = on_all(2, |ranks| match ranks.rank() {
        0 => ranks.gather(Vec::new()),
        _ => Ok(Vec::new()),
    });
    assert_eq!(gathered[0], Err(ClusterError::Gone { rank: 1 }));
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
