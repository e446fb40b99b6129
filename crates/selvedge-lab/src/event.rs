//! A listener of a long operation, shared by its threads.

use std::ops::ControlFlow;
use std::sync::{Mutex, PoisonError};

pub use selvedge::{End, Event, Goal};

/// A listener: hears every event of an operation, from whichever thread, and may break to stop it.
pub type OnEvent<'a> = dyn FnMut(Event<'_>) -> ControlFlow<()> + Send + 'a;

/// A listener shared by the threads of one operation.
pub(crate) struct Reporter<'a> {
    on_event: Mutex<&'a mut OnEvent<'a>>,
}

impl<'a> Reporter<'a> {
    /// A listener for the threads of an operation.
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

    /// Begins a task of `count` units, which ends when the answer is dropped.
    pub(crate) fn count(&self, task: &str, count: usize, unit: &'static str) -> Task<'_, 'a> {
        let goal = Goal::Count(count as u64);
        // Whoever wants to stop says so again at the first unit.
        let _ = self.tell(Event::Begun { task, goal, unit });
        Task { reporter: self }
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
