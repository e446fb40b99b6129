//! Listeners of long calls, in C.
#![allow(
    unsafe_code,
    reason = "a function of the caller is called with the caller's pointer"
)]

use std::ffi::{CString, c_char, c_void};
use std::ops::ControlFlow;

use selvedge::{Event, Goal};

/// A listener of a long call: hears what is done and may stop it.
///
/// `hear` is called with `context`, the task in words ("sagging to rest"; only during the call),
/// the units that are done and those that there are, 0 where that is not known. It returns 0 to go
/// on and anything else to stop. It may be called from other threads than the caller's, one call
/// at a time, must not call with the handle that the long call has, and must not throw or jump
/// out.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct SelvedgeListener {
    /// The function; null hears nothing.
    pub hear: Option<
        unsafe extern "C" fn(
            context: *mut c_void,
            task: *const c_char,
            done: u64,
            goal: u64,
        ) -> i32,
    >,
    /// Whatever the function is to have.
    pub context: *mut c_void,
}

/// A listener of ours around one of C.
pub(crate) struct Progress {
    listener: Option<SelvedgeListener>,
    task: CString,
    done: u64,
    goal: u64,
}

// SAFETY: the caller agrees that the function is called from other threads with its pointer, one
// call at a time.
unsafe impl Send for Progress {}

impl Progress {
    /// A listener of ours for `listener`, which may be null.
    ///
    /// # Safety
    /// `listener` is null or that of a listener whose function may be called with its context for
    /// as long as this one is in use.
    pub(crate) unsafe fn of(listener: *const SelvedgeListener) -> Self {
        // SAFETY: the caller vouches for the pointer; a listener of it is copied.
        let listener = unsafe { listener.as_ref() }.copied();
        Self {
            listener,
            task: CString::default(),
            done: 0,
            goal: 0,
        }
    }

    /// Tells the caller of `event`.
    pub(crate) fn tell(&mut self, event: Event<'_>) -> ControlFlow<()> {
        match event {
            Event::Begun { task, goal, .. } => {
                self.task = CString::new(task).unwrap_or_default();
                self.done = 0;
                self.goal = match goal {
                    Goal::Count(count) => count,
                    Goal::Open => 0,
                };
            }
            Event::Advanced => self.done += 1,
            Event::Asked => {}
            Event::Noted(_) | Event::Ended | Event::Remarked(_) => return ControlFlow::Continue(()),
        }
        let Some(SelvedgeListener {
            hear: Some(hear),
            context,
        }) = self.listener
        else {
            return ControlFlow::Continue(());
        };
        // SAFETY: the caller gave the function to be called so; the text outlives the call.
        let answer = unsafe { hear(context, self.task.as_ptr(), self.done, self.goal) };
        match answer {
            0 => ControlFlow::Continue(()),
            _ => ControlFlow::Break(()),
        }
    }
}
