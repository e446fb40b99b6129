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

/// The words for each code alone, in the order of the codes.
const WORDS: [&CStr; SelvedgeStatus::Panic as usize + 1] = [
    c"done",
    c"an argument cannot be used",
    c"an array has the wrong length",
    c"not a handle, or one of another kind",
    c"the handle was freed",
    c"an earlier call with the handle panicked: free it",
    c"a scene or a model cannot be opened",
    c"the scene cannot be made ready to move",
    c"the step failed",
    c"stopped, as was asked",
    c"a defect of Selvedge: a call panicked",
];

/// The words for the code of this number.
pub(crate) fn words(number: i32) -> Option<&'static CStr> {
    WORDS.get(usize::try_from(number).ok()?).copied()
}
