//! The codes that calls answer with.

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

impl SelvedgeStatus {
    /// Returns the words for the code alone.
    pub(crate) fn words(self) -> &'static std::ffi::CStr {
        match self {
            Self::Ok => c"done",
            Self::Argument => c"an argument cannot be used",
            Self::Count => c"an array has the wrong length",
            Self::Handle => c"not a handle, or one of another kind",
            Self::Freed => c"the handle was freed",
            Self::Poisoned => c"an earlier call with the handle panicked: free it",
            Self::Open => c"a scene or a model cannot be opened",
            Self::Start => c"the scene cannot be made ready to move",
            Self::Step => c"the step failed",
            Self::Stopped => c"stopped, as was asked",
            Self::Panic => c"a defect of Selvedge: a call panicked",
        }
    }

    /// Returns the code of this number.
    pub(crate) fn of(number: i32) -> Option<Self> {
        const ALL: [SelvedgeStatus; 11] = [
            SelvedgeStatus::Ok,
            SelvedgeStatus::Argument,
            SelvedgeStatus::Count,
            SelvedgeStatus::Handle,
            SelvedgeStatus::Freed,
            SelvedgeStatus::Poisoned,
            SelvedgeStatus::Open,
            SelvedgeStatus::Start,
            SelvedgeStatus::Step,
            SelvedgeStatus::Stopped,
            SelvedgeStatus::Panic,
        ];
        ALL.into_iter().find(|status| *status as i32 == number)
    }
}
