//! The names of guards.

use clap::ValueEnum;
use selvedge_guard::Correction;

/// Correction of frames that no cloth could have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum GuardName {
    /// No correction.
    None,
    /// Edges are brought back within bounds; what is lost is replaced by the physics.
    Limit,
}

impl GuardName {
    /// The name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Limit => "limit",
        }
    }

    pub(crate) fn settings(self) -> Correction {
        match self {
            Self::None => Correction::None,
            Self::Limit => Correction::Limit,
        }
    }
}
