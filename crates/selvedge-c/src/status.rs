//! The codes that calls answer with.

use std::ffi::CStr;

/// Outcome of a call; `selvedge_last_error` has the words where it is not `SELVEDGE_STATUS_OK`.
#[repr(i32)]
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SelvedgeStatus {
    /// Done.
    Ok = 0,
    /// An argument that cannot be used: a null pointer, a text that is not UTF-8, a number that
    /// means nothing.
    Argument = 1,
    /// An array of another length than the cloth has, or a text that does not fit.
    Count = 2,
    /// A number that is no handle, or the handle of something else.
    Handle = 3,
    /// A handle that was freed.
    Freed = 4,
    /// A handle whose last call panicked: it can only be freed.
    Poisoned = 5,
    /// A scene or a model that cannot be opened.
    Open = 6,
    /// A scene that cannot be made ready to move, or not by this model.
    Start = 7,
    /// A step that failed; the cloth is where it was before it.
    Step = 8,
    /// A listener, or `selvedge_stepper_stop`, asked to stop.
    Stopped = 9,
    /// A defect of Selvedge: a call panicked.
    Panic = 10,
}

/// The words for each code alone.
const WORDS: [(SelvedgeStatus, &CStr); 11] = [
    (SelvedgeStatus::Ok, c"done"),
    (SelvedgeStatus::Argument, c"an argument cannot be used"),
    (SelvedgeStatus::Count, c"an array has the wrong length"),
    (
        SelvedgeStatus::Handle,
        c"not a handle, or one of another kind",
    ),
    (SelvedgeStatus::Freed, c"the handle was freed"),
    (
        SelvedgeStatus::Poisoned,
        c"an earlier call with the handle panicked: free it",
    ),
    (SelvedgeStatus::Open, c"a scene or a model cannot be opened"),
    (
        SelvedgeStatus::Start,
        c"the scene cannot be made ready to move",
    ),
    (SelvedgeStatus::Step, c"the step failed"),
    (SelvedgeStatus::Stopped, c"stopped, as was asked"),
    (
        SelvedgeStatus::Panic,
        c"a defect of Selvedge: a call panicked",
    ),
];

/// The words for the code of this number.
pub(crate) fn words(number: i32) -> Option<&'static CStr> {
    let row = WORDS.iter().find(|(status, _)| *status as i32 == number);
    row.map(|row| row.1)
}
