//! The calls that fail: those that write, those that read, and those that take memory.

use clap::ValueEnum;

/// A side of the program's calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Side {
    Writes,
    Reads,
    Memory,
}

impl Side {
    /// As the library and the command line call it.
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Writes => "writes",
            Self::Reads => "reads",
            Self::Memory => "memory",
        }
    }

    /// Kinds of faults, as the library calls them.
    pub(super) fn kinds(self) -> &'static [&'static str] {
        match self {
            Self::Writes => &["enospc", "eio", "eintr", "eacces", "short", "cut", "drop"],
            Self::Reads => &["eio", "eintr", "short"],
            Self::Memory => &["enomem"],
        }
    }
}
