//! A broken promise: the place, the fault and the remedy, on one line.

use std::fmt;

/// A broken promise.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Violation {
    pub(crate) path: String,
    /// Counted from 1; 0 when the file as a whole is meant.
    pub(crate) line: usize,
    /// Fault.
    pub(crate) what: String,
    pub(crate) remedy: String,
}

impl Violation {
    pub(crate) fn new(
        path: &str,
        line: usize,
        what: impl Into<String>,
        remedy: impl Into<String>,
    ) -> Self {
        Self {
            path: path.to_owned(),
            line,
            what: what.into(),
            remedy: remedy.into(),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            path,
            line,
            what,
            remedy,
        } = self;
        match line {
            0 => write!(f, "{path}: {what}: {remedy}"),
            _ => write!(f, "{path}:{line}: {what}: {remedy}"),
        }
    }
}
