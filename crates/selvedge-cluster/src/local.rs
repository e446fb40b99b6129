//! Ranks that are threads of this process, with delays of a network where these are asked for.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::time::{Duration, Instant};

use crate::error::ClusterError;
use crate::ranks::Ranks;
use crate::transport::{Letter, Transport};

/// Delays of a network between ranks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Delays {
    /// From the last byte sent to the first one read `[s]`.
    pub latency: f64,
    /// Time of a byte at the sender `[s]`: one message after the other leaves a rank.
    pub per_byte: f64,
}

impl Delays {
    /// As fast as memory is.
    pub const NONE: Self = Self {
        latency: 0.0,
        per_byte: 0.0,
    };
}

/// Ranks for so many threads of this process. A rank that is dropped has ended.
#[must_use]
pub fn threads(count: usize, delays: Delays) -> Vec<Ranks> {
    let transports = Threads::joined(count, delays).into_iter();
    transports.map(|one| Ranks::new(Box::new(one))).collect()
}

/// A letter and the time at which it can be read.
type Arrival = (Instant, Letter);

pub(crate) struct Threads {
    rank: usize,
    delays: Delays,
    senders: Vec<Sender<Arrival>>,
    /// The time from which the next message can leave.
    free: Mutex<Instant>,
    arrivals: Mutex<(Receiver<Arrival>, VecDeque<Arrival>)>,
    alive: Arc<[AtomicBool]>,
}

impl Threads {
    /// The transports of so many ranks.
    pub(crate) fn joined(count: usize, delays: Delays) -> Vec<Self> {
        let (senders, receivers): (Vec<_>, Vec<_>) = (0..count).map(|_| channel()).unzip();
        let alive: Arc<[AtomicBool]> = (0..count).map(|_| AtomicBool::new(true)).collect();
        let all = receivers
            .into_iter()
            .enumerate()
            .map(|(rank, receiver)| Self {
                rank,
                delays,
                senders: senders.clone(),
                free: Mutex::new(Instant::now()),
                arrivals: Mutex::new((receiver, VecDeque::new())),
                alive: Arc::clone(&alive),
            });
        all.collect()
    }
}

impl Transport for Threads {
    fn rank(&self) -> usize {
        self.rank
    }

    fn count(&self) -> usize {
        self.senders.len()
    }

    fn send(&self, to: usize, tag: u32, bytes: Vec<u8>) -> Result<(), ClusterError> {
        let Delays { latency, per_byte } = self.delays;
        let due = {
            let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
            let begin = (*free).max(Instant::now());
            *free = begin + Duration::from_secs_f64(per_byte * bytes.len() as f64);
            *free + Duration::from_secs_f64(latency)
        };
        let from = self.rank;
        // A rank that has ended reads nothing more.
        let _ = self.senders[to].send((due, Letter { from, tag, bytes }));
        Ok(())
    }

    fn poll(&self) -> Result<Option<Letter>, ClusterError> {
        let mut arrivals = self.arrivals.lock().unwrap_or_else(PoisonError::into_inner);
        let (receiver, waiting) = &mut *arrivals;
        waiting.extend(receiver.try_iter());
        let now = Instant::now();
        // Messages of one rank leave one after the other, and all take as long: in order.
        let place = waiting.iter().position(|(due, _)| *due <= now);
        Ok(place
            .and_then(|place| waiting.remove(place))
            .map(|(_, letter)| letter))
    }

    fn is_sending(&self) -> bool {
        false
    }

    fn is_alive(&self, rank: usize) -> bool {
        if self.alive[rank].load(Ordering::Acquire) {
            return true;
        }
        // What it sent before it ended may still be on its way.
        let mut arrivals = self.arrivals.lock().unwrap_or_else(PoisonError::into_inner);
        let (receiver, waiting) = &mut *arrivals;
        waiting.extend(receiver.try_iter());
        waiting.iter().any(|(_, letter)| letter.from == rank)
    }

    fn local_rank(&self) -> usize {
        self.rank
    }

    fn place(&self, rank: usize) -> String {
        format!("thread {rank} of this process")
    }

    fn close(&self) {}
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.alive[self.rank].store(false, Ordering::Release);
    }
}
