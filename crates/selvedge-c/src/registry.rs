//! Handles: numbers for what the library keeps.
//!
//! A handle has a kind (8 bits) and a number (56 bits), which counts up and is not used again, so that
//! a handle that was freed is known as such.

use std::collections::BTreeMap;
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use crate::fault::Fault;
use crate::status::SelvedgeStatus;

/// A thing that a handle can be of. No kind is 0, so that 0 is never a handle.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub(crate) enum Kind {
    Scene = 0x5c,
    Model = 0x4d,
    Stepper = 0x57,
    Snapshot = 0x53,
}

const KINDS: [Kind; 4] = [Kind::Scene, Kind::Model, Kind::Stepper, Kind::Snapshot];
/// Place of the kind in a handle.
const KIND: u32 = 56;

/// All that handles of one kind stand for.
pub(crate) struct Registry<T> {
    kind: Kind,
    kept: Mutex<Kept<T>>,
}

struct Kept<T> {
    /// Number of the newest handle; 0 before the first.
    newest: u64,
    all: BTreeMap<u64, Arc<T>>,
}

impl Kind {
    fn name(self) -> &'static str {
        match self {
            Self::Scene => "a scene",
            Self::Model => "a model",
            Self::Stepper => "a stepper",
            Self::Snapshot => "a snapshot",
        }
    }
}

impl<T> Registry<T> {
    pub(crate) const fn new(kind: Kind) -> Self {
        let kept = Mutex::new(Kept {
            newest: 0,
            all: BTreeMap::new(),
        });
        Self { kind, kept }
    }

    /// Keeps `value` and returns its handle.
    pub(crate) fn keep(&self, value: T) -> u64 {
        let mut kept = self.kept();
        kept.newest += 1;
        let handle = (self.kind as u64) << KIND | kept.newest;
        kept.all.insert(handle, Arc::new(value));
        handle
    }

    /// The value that `handle` stands for.
    pub(crate) fn get(&self, handle: u64) -> Result<Arc<T>, Fault> {
        let kept = self.kept();
        let value = kept.all.get(&handle).map(Arc::clone);
        value.ok_or_else(|| self.unknown(handle, kept.newest))
    }

    /// Ends `handle`. A call that is under way with it in another thread comes to its end before
    /// what it stands for is given up.
    pub(crate) fn free(&self, handle: u64) -> Result<(), Fault> {
        let mut kept = self.kept();
        let (value, newest) = (kept.all.remove(&handle), kept.newest);
        // What it stands for may take a while to end.
        drop(kept);
        value.map(drop).ok_or_else(|| self.unknown(handle, newest))
    }

    /// Why nothing is kept for `handle`, of handles with numbers up to `newest`.
    fn unknown(&self, handle: u64, newest: u64) -> Fault {
        let wanted = self.kind.name();
        let number = handle & ((1 << KIND) - 1);
        let found = match KINDS.iter().find(|kind| **kind as u64 == handle >> KIND) {
            None => "no handle",
            Some(kind) if *kind != self.kind => kind.name(),
            Some(_) if (1..=newest).contains(&number) => {
                let text = format!("{handle:#x}: the handle of {wanted} that was freed");
                return Fault::new(SelvedgeStatus::Freed, text);
            }
            Some(_) => "no handle that was given out",
        };
        let text = format!("{handle:#x}: expected the handle of {wanted}, found {found}");
        Fault::new(SelvedgeStatus::Handle, text)
    }

    fn kept(&self) -> MutexGuard<'_, Kept<T>> {
        // Nothing in here is left half done by a panic.
        self.kept.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Locks what a handle stands for, after whoever has it.
pub(crate) fn lock<T>(kept: &Mutex<T>) -> Result<MutexGuard<'_, T>, Fault> {
    kept.lock().map_err(|_| {
        let text = "an earlier call with this handle panicked, so that what it stands for may be half done: free it";
        Fault::new(SelvedgeStatus::Poisoned, text)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status<T>(outcome: Result<T, Fault>) -> SelvedgeStatus {
        outcome.map_or_else(|fault| fault.status, |_| SelvedgeStatus::Ok)
    }

    #[test]
    fn a_handle_is_known_until_it_is_freed_and_as_freed_from_then_on() {
        let all = Registry::new(Kind::Model);
        let first = all.keep("first");
        assert_eq!(*all.get(first).unwrap(), "first");
        all.free(first).unwrap();
        for _ in 0..3 {
            assert_eq!(status(all.get(first)), SelvedgeStatus::Freed);
            assert_eq!(status(all.free(first)), SelvedgeStatus::Freed);
            let second = all.keep("second");
            assert_ne!(first, second);
            assert_eq!(status(all.get(first)), SelvedgeStatus::Freed);
            assert_eq!(*all.get(second).unwrap(), "second");
            all.free(second).unwrap();
        }
        assert!(all.kept().all.is_empty());
    }

    #[test]
    fn numbers_that_are_no_handles_are_told_from_those_of_another_kind() {
        let (models, scenes) = (Registry::new(Kind::Model), Registry::new(Kind::Scene));
        let model = models.keep(());
        scenes.keep(());
        let other = scenes.get(model).err().unwrap();
        assert_eq!(other.status, SelvedgeStatus::Handle);
        let never = model >> KIND << KIND;
        let near = [model + 1, model + (1 << 32), model ^ 1 << 60, never];
        for number in [0, 1, u64::MAX].into_iter().chain(near) {
            let found = status(models.get(number));
            assert_eq!(found, SelvedgeStatus::Handle, "{number:#x}");
        }
    }

    #[test]
    fn handles_that_are_made_and_freed_by_many_threads_stay_apart() {
        let all = Registry::new(Kind::Scene);
        std::thread::scope(|scope| {
            for thread in 0..8_u32 {
                let all = &all;
                scope.spawn(move || {
                    for round in 0..200 {
                        let handle = all.keep((thread, round));
                        assert_eq!(*all.get(handle).unwrap(), (thread, round));
                        all.free(handle).unwrap();
                        assert_eq!(status(all.get(handle)), SelvedgeStatus::Freed);
                    }
                });
            }
        });
    }
}
