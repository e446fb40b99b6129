//! Work that may take long: a wish to stop it, and a word on work that has no listener of its own, the
//! making of large meshes. For that a program sets one observer at its start, who shows what he hears and may ask for an end. Where
//! none is set, as in tests, nothing is said.

use std::ops::ControlFlow;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, OnceLock};

/// One step of such work.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LongWork<'a> {
    /// It begins.
    Begun {
        /// The work, as "making a mesh".
        what: &'a str,
        /// Steps at most.
        most: usize,
    },
    /// One more step is done.
    Advanced,
    /// It has ended, early or not.
    Ended,
}

/// An observer, called on the thread that works. A break asks for an end.
pub type LongWorkObserver = fn(LongWork<'_>) -> ControlFlow<()>;

static OBSERVER: OnceLock<LongWorkObserver> = OnceLock::new();

/// Sets the observer of this process; the first one stays.
pub fn observe_long_work(observer: LongWorkObserver) {
    // A second one is not heard of: that is no error of whoever works.
    let _ = OBSERVER.set(observer);
}

fn tell(word: LongWork<'_>) -> ControlFlow<()> {
    OBSERVER
        .get()
        .map_or(ControlFlow::Continue(()), |observer| observer(word))
}

/// Work under way; it has ended when this is dropped.
pub(crate) struct Underway(());

impl Underway {
    /// Begins work of `most` steps.
    pub(crate) fn begin(what: &str, most: usize) -> Self {
        // Whoever wants an end says so again at the first step.
        let _ = tell(LongWork::Begun { what, most });
        Self(())
    }

    /// Counts one more step.
    pub(crate) fn advance(&self) -> ControlFlow<()> {
        tell(LongWork::Advanced)
    }
}

impl Drop for Underway {
    fn drop(&mut self) {
        let _ = tell(LongWork::Ended);
    }
}

/// A flag that is set where someone wants long work to end. Clones share it.
#[derive(Clone, Debug, Default)]
pub struct Stop(Arc<AtomicBool>);

impl From<Arc<AtomicBool>> for Stop {
    fn from(flag: Arc<AtomicBool>) -> Self {
        Self(flag)
    }
}

impl Stop {
    /// Sets the flag.
    pub fn ask(&self) {
        self.0.store(true, Ordering::Relaxed);
    }

    /// Returns true from when the flag was set.
    pub fn is_wanted(&self) -> bool {
        self.0.load(Ordering::Relaxed)
    }
}
