//! Reasons why ranks cannot go on together, each with the rank that it is about.

use thiserror::Error;

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
