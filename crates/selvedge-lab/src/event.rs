//! Progress of long operations, and the request to stop them.
//!
//! An operation calls its listener for every [`Event`]. A listener that breaks ends the operation
//! in an orderly way: files under way are finished, and what is done is returned with
//! [`End::Interrupted`].

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

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
    /// A span of time, whatever the count is by then.
    Time(Duration),
}

/// The end of an operation that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum End {
    /// Everything was done.
    Complete,
    /// The listener asked to stop; what was written is whole.
    Interrupted,
}

/// A listener: hears every event of an operation, from whichever thread, and may break to stop it.
pub type OnEvent<'a> = dyn FnMut(Event<'_>) -> ControlFlow<()> + Send + 'a;

/// A listener shared by the threads of one operation.
pub(crate) struct Reporter<'a> {
    on_event: Mutex<&'a mut OnEvent<'a>>,
}

impl<'a> Reporter<'a> {
    pub(crate) fn new(on_event: &'a mut OnEvent<'_>) -> Self {
        Self {
            on_event: Mutex::new(on_event),
        }
    }

    fn tell(&self, event: Event<'_>) -> ControlFlow<()> {
        // A panic elsewhere does not make a listener wrong.
        let mut on_event = self.on_event.lock().unwrap_or_else(PoisonError::into_inner);
        (*on_event)(event)
    }

    /// Begins a task that ends when the answer is dropped.
    pub(crate) fn begin(&self, task: &str, goal: Goal, unit: &'static str) -> Task<'_, 'a> {
        // Whoever wants to stop says so again at the first unit.
        let _ = self.tell(Event::Begun { task, goal, unit });
        Task { reporter: self }
    }

    /// Begins a task of `count` units.
    pub(crate) fn count(&self, task: &str, count: usize, unit: &'static str) -> Task<'_, 'a> {
        self.begin(task, Goal::Count(count as u64), unit)
    }

    /// Says a line.
    pub(crate) fn remark(&self, line: &str) {
        // The next unit asks whether to go on.
        let _ = self.tell(Event::Remarked(line));
    }

    /// Returns `true` when the listener asks to stop.
    pub(crate) fn is_stopped(&self) -> bool {
        self.tell(Event::Asked).is_break()
    }

    /// A listener for an operation within this one.
    pub(crate) fn listener(&self) -> impl FnMut(Event<'_>) -> ControlFlow<()> + Send {
        |event| self.tell(event)
    }
}

/// A task under way.
pub(crate) struct Task<'r, 'a> {
    reporter: &'r Reporter<'a>,
}

impl Task<'_, '_> {
    /// Counts one more unit.
    pub(crate) fn advance(&self) -> ControlFlow<()> {
        self.reporter.tell(Event::Advanced)
    }

    /// Returns `true` when the listener asks to stop.
    pub(crate) fn is_stopped(&self) -> bool {
        self.reporter.is_stopped()
    }

    /// Remarks on the unit under way.
    pub(crate) fn note(&self, note: &str) {
        // The next unit asks whether to go on.
        let _ = self.reporter.tell(Event::Noted(note));
    }
}

impl Drop for Task<'_, '_> {
    fn drop(&mut self) {
        let _ = self.reporter.tell(Event::Ended);
    }
}
