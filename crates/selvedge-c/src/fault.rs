//! A call that failed: its code and its words, and where a thread keeps the last ones.

use std::any::Any;
use std::cell::RefCell;
use std::error::Error;
use std::ffi::{CStr, CString};

use selvedge::cause;
use selvedge_cloth::{HandleError, StepError};

use crate::status::SelvedgeStatus;

/// A call that failed.
#[derive(Debug)]
pub(crate) struct Fault {
    pub(crate) status: SelvedgeStatus,
    text: String,
}

thread_local! {
    static LAST: RefCell<CString> = RefCell::default();
}

impl Fault {
    pub(crate) fn new(status: SelvedgeStatus, text: impl Into<String>) -> Self {
        let text = text.into();
        Self { status, text }
    }

    pub(crate) fn argument(text: impl Into<String>) -> Self {
        Self::new(SelvedgeStatus::Argument, text)
    }

    /// An array of `name` with so many `unit` where the cloth has others.
    pub(crate) fn count(name: &str, unit: &str, wanted: usize, found: usize) -> Self {
        let text = format!("{name}: expected {wanted} {unit}, found {found}");
        Self::new(SelvedgeStatus::Count, text)
    }

    /// An error of a library, with its causes.
    pub(crate) fn of(
        status: SelvedgeStatus,
        error: impl Into<Box<dyn Error + Send + Sync>>,
    ) -> Self {
        Self::new(status, cause::chain(&*error.into()))
    }

    pub(crate) fn step(error: StepError) -> Self {
        let status = match &error {
            StepError::Stopped { .. } => SelvedgeStatus::Stopped,
            StepError::Handles { source, .. } => of_targets(source),
            StepError::Snapshot { .. } | StepError::Obstacle { .. } => SelvedgeStatus::Argument,
            _ => SelvedgeStatus::Step,
        };
        Self::of(status, error)
    }

    pub(crate) fn targets(error: HandleError) -> Self {
        Self::of(of_targets(&error), error)
    }

    /// A panic, by its message.
    pub(crate) fn panic(payload: &(dyn Any + Send)) -> Self {
        let message = match (
            payload.downcast_ref::<&str>(),
            payload.downcast_ref::<String>(),
        ) {
            (Some(message), _) => message,
            (None, Some(message)) => message.as_str(),
            (None, None) => "without a message",
        };
        let text = format!("a defect of Selvedge: a call panicked ({message}); free the handle");
        Self::new(SelvedgeStatus::Panic, text)
    }

    /// Keeps the words for this thread and returns the code.
    pub(crate) fn keep(self) -> SelvedgeStatus {
        let text = self.text.replace('\0', " ");
        // A thread that ends may have no place for them any more; the code is answered anyway.
        let _ = LAST.try_with(|last| {
            if let Ok(mut last) = last.try_borrow_mut() {
                *last = CString::new(text).unwrap_or_default();
            }
        });
        self.status
    }
}

fn of_targets(error: &HandleError) -> SelvedgeStatus {
    match error {
        HandleError::Count { .. } => SelvedgeStatus::Count,
        _ => SelvedgeStatus::Argument,
    }
}

/// The words for the last call of this thread that failed; they stay until the next one does.
pub(crate) fn last() -> *const std::ffi::c_char {
    let empty: &'static CStr = c"";
    LAST.try_with(|last| last.borrow().as_ptr())
        .unwrap_or(empty.as_ptr())
}
