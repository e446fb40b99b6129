//! The calls that fail: those that write, those that read, and those that take memory.

use anyhow::{Result, bail};

/// A side of the program's calls.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Side {
    Writes,
    Reads,
    Memory,
}

/// All sides.
const ALL: [Side; 3] = [Side::Writes, Side::Reads, Side::Memory];

impl Side {
    /// The sides called so, or all where none is named.
    ///
    /// # Errors
    /// A name that no side has.
    pub(super) fn named(names: &[&str]) -> Result<Vec<Self>> {
        if names.is_empty() {
            return Ok(ALL.to_vec());
        }
        let find = |name: &&str| match ALL.iter().find(|side| side.name() == *name) {
            Some(side) => Ok(*side),
            None => bail!("there is no {name:?}: writes, reads or memory"),
        };
        names.iter().map(find).collect()
    }

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
