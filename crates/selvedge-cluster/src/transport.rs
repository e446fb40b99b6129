//! The seam to what carries messages between ranks, and why ranks cannot go on together.

use thiserror::Error;

/// A message that has arrived.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Letter {
    /// The rank that sent it.
    pub(crate) from: usize,
    /// Its tag.
    pub(crate) tag: u32,
    /// Its contents.
    pub(crate) bytes: Vec<u8>,
}

/// A carrier of messages. Messages of one rank to another arrive in the order in which they were
/// sent.
pub(crate) trait Transport: Send + Sync {
    /// This rank, from 0.
    fn rank(&self) -> usize;

    /// The number of ranks.
    fn count(&self) -> usize;

    /// Hands over a message to another rank and returns at once.
    fn send(&self, to: usize, tag: u32, bytes: Vec<u8>) -> Result<(), ClusterError>;

    /// The next message that has arrived, if there is one.
    fn poll(&self) -> Result<Option<Letter>, ClusterError>;

    /// Returns true while a message that was handed over is on its way and needs this rank to call
    /// [`Self::poll`] before it gets there.
    fn is_sending(&self) -> bool {
        false
    }

    /// Returns `false` where a rank is known to have ended.
    fn is_alive(&self, rank: usize) -> bool;

    /// The number of this rank, from 0, among those of its machine.
    fn local_rank(&self) -> usize;

    /// Process and machine of a rank, in words.
    fn place(&self, rank: usize) -> String;

    /// Waits until what was sent has gone, and takes leave of the other ranks. Nothing can be sent
    /// afterwards.
    fn close(&self) {}
}

/// Ranks that cannot go on together.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ClusterError {
    #[error("rank {rank} has failed: {message}")]
    Failed { rank: usize, message: String },
    #[error(
        "rank {rank} ({place}) has ended without a word: it was killed, or its machine has failed"
    )]
    Gone { rank: usize, place: String },
    #[error("rank {rank} has not answered for {seconds} s: its machine or the network has failed")]
    Silent { rank: usize, seconds: u64 },
    #[error(
        "rank {rank} sent {found} bytes where {expected} belong: start the same program with the same arguments on every rank"
    )]
    Size {
        rank: usize,
        expected: usize,
        found: usize,
    },
    #[error("MPI: {doing}: {problem}")]
    Mpi {
        doing: &'static str,
        problem: String,
    },
}
