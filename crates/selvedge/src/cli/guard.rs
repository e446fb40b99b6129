//! The names of guards.

use clap::ValueEnum;
use selvedge_guard::{Correction, GuardSettings};

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

    pub(crate) fn settings(self) -> GuardSettings {
        match self {
            Self::None => GuardSettings::with(Correction::None),
            Self::Limit => GuardSettings::with(Correction::Limit),
        }
    }
}
