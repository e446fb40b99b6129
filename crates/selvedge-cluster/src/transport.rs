//! What carries bytes from one rank to another: threads of this process; MPI is in `mpi.rs`.

use std::sync::mpsc::{Receiver, Sender, channel};
use std::sync::{Arc, Mutex, PoisonError};

use thiserror::Error;

use crate::ranks::Ranks;

/// A carrier of bytes. What one rank sends to another arrives in the order in which it was sent.
/// One thread of a rank talks at a time.
pub(crate) trait Transport: Send + Sync {
    /// Sends bytes to another rank; may wait until they are read.
    fn send(&self, to: usize, bytes: &[u8]) -> Result<(), ClusterError>;

    /// Waits for the next bytes from another rank.
    fn receive(&self, from: usize) -> Result<Vec<u8>, ClusterError>;

    /// Ends this rank's part in the job: as done, or all other ranks with it, with the exit code of
    /// a failure.
    fn end(&self, failure: Option<u8>);
}

/// Ranks that cannot go on together.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ClusterError {
    #[error("rank {rank} has ended")]
    Gone { rank: usize },
    #[error(
        "rank {rank} sent {found} bytes where {expected} belong: start the same program with the same arguments on every rank"
    )]
    Size {
        rank: usize,
        expected: usize,
        found: usize,
    },
    #[error("MPI cannot start: it was started before, or was built for one thread")]
    Mpi,
}

/// Ranks for so many threads of this process. A rank that is dropped has ended.
pub fn threads(count: usize) -> Vec<Ranks> {
    let mut all: Vec<Threads> = (0..count).map(|_| Threads::default()).collect();
    for from in 0..count {
        for to in 0..count {
            let (sender, receiver) = channel();
            all[from].to.push(sender);
            all[to].from.push(Mutex::new(receiver));
        }
    }
    let all = all.into_iter().enumerate();
    all.map(|(rank, one)| Ranks::new([rank, count, rank], Arc::new(one)))
        .collect()
}

/// A rank that is a thread: its ways to each rank and from it.
#[derive(Default)]
struct Threads {
    to: Vec<Sender<Vec<u8>>>,
    from: Vec<Mutex<Receiver<Vec<u8>>>>,
}

impl Transport for Threads {
    fn send(&self, to: usize, bytes: &[u8]) -> Result<(), ClusterError> {
        let sent = self.to[to].send(bytes.to_vec());
        sent.map_err(|_| ClusterError::Gone { rank: to })
    }

    fn receive(&self, from: usize) -> Result<Vec<u8>, ClusterError> {
        let receiver = self.from[from]
            .lock()
            .unwrap_or_else(PoisonError::into_inner);
        receiver
            .recv()
            .map_err(|_| ClusterError::Gone { rank: from })
    }

    fn end(&self, _failure: Option<u8>) {}
}
