//! Progress of long operations, and the request to stop them.
//!
//! An operation calls its listener for every [`Event`]. A listener that breaks ends the operation
//! in an orderly way: files under way are finished, and what is done is returned with
//! [`End::Interrupted`].

use std::ops::ControlFlow;

/// One step of progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event<'a> {
    /// A task begins. Tasks follow one another; they do not nest.
    Begun {
        /// The task, as "simulating".
        task: &'a str,
        /// Its end.
        goal: Goal,
        /// The unit of its count, in the plural.
        unit: &'static str,
    },
    /// One more unit of the task is done.
    Advanced,
    /// A remark on the unit under way.
    Noted(&'a str),
    /// The task has ended, early or not.
    Ended,
    /// A line that whoever waits is to see.
    Remarked(&'a str),
    /// Nothing has happened: the operation asks whether to go on.
    Asked,
}

/// The end of a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Goal {
    /// Unknown.
    Open,
    /// A number of units.
    Count(u64),
}

/// The end of an operation that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Everything was done.
    Complete,
    /// The listener asked to stop; what was written is whole.
    Interrupted,
}

/// A listener: hears every event of an operation, on the thread that called it, and may break to
/// stop it.
pub type Listener<'a> = dyn FnMut(Event<'_>) -> ControlFlow<()> + 'a;
