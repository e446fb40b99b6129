//! Ranks that are threads of this process.

use std::collections::VecDeque;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use crate::ranks::Ranks;
use crate::transport::{ClusterError, Letter, Transport};

/// Ranks for so many threads of this process. A rank that is dropped has ended.
pub fn threads(count: usize) -> Vec<Ranks> {
    let transports = Threads::joined(count).into_iter();
    transports.map(|one| Ranks::new(Box::new(one))).collect()
}

pub(crate) struct Threads {
    rank: usize,
    senders: Vec<Sender<Letter>>,
    arrivals: Mutex<(Receiver<Letter>, VecDeque<Letter>)>,
    alive: Arc<[AtomicBool]>,
}

impl Threads {
    /// The transports of so many ranks.
    pub(crate) fn joined(count: usize) -> Vec<Self> {
        let (senders, receivers): (Vec<_>, Vec<_>) = (0..count).map(|_| channel()).unzip();
        let alive: Arc<[AtomicBool]> = (0..count).map(|_| AtomicBool::new(true)).collect();
        let all = receivers
            .into_iter()
            .enumerate()
            .map(|(rank, receiver)| Self {
                rank,
                senders: senders.clone(),
                arrivals: Mutex::new((receiver, VecDeque::new())),
                alive: Arc::clone(&alive),
            });
        all.collect()
    }

    /// Reads the messages that have arrived and are not read yet.
    fn with_waiting<R>(&self, read: impl FnOnce(&mut VecDeque<Letter>) -> R) -> R {
        let mut arrivals = self.arrivals.lock().unwrap_or_else(PoisonError::into_inner);
        let (receiver, waiting) = &mut *arrivals;
        waiting.extend(receiver.try_iter());
        read(waiting)
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
        let from = self.rank;
        // A rank that has ended reads nothing more.
        let _ = self.senders[to].send(Letter { from, tag, bytes });
        Ok(())
    }

    fn poll(&self) -> Result<Option<Letter>, ClusterError> {
        Ok(self.with_waiting(VecDeque::pop_front))
    }

    fn is_alive(&self, rank: usize) -> bool {
        if self.alive[rank].load(Ordering::Acquire) {
            return true;
        }
        // What it sent before it ended may still be on its way.
        self.with_waiting(|waiting| waiting.iter().any(|letter| letter.from == rank))
    }

    fn local_rank(&self) -> usize {
        self.rank
    }

    fn place(&self, rank: usize) -> String {
        format!("thread {rank} of this process")
    }
}

impl Drop for Threads {
    fn drop(&mut self) {
        self.alive[self.rank].store(false, Ordering::Release);
    }
}
