//! Handles: numbers for what the library keeps.
//!
//! A handle has a kind (8 bits), a generation (24 bits) and a place (32 bits). A place that is used
//! again has another generation, so that a handle that was freed is known as such; a place whose
//! generations are used up is not used again.

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
const LAST_GENERATION: u32 = (1 << 24) - 1;

/// All that handles of one kind stand for.
pub(crate) struct Registry<T> {
    kind: Kind,
    slots: Mutex<Vec<Slot<T>>>,
}

struct Slot<T> {
    /// Of the newest handle of this place.
    generation: u32,
    kept: Option<Arc<T>>,
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
        Self {
            kind,
            slots: Mutex::new(Vec::new()),
        }
    }

    /// Keeps `value` and returns its handle.
    pub(crate) fn keep(&self, value: T) -> Result<u64, Fault> {
        let mut slots = self.slots();
        let free = |slot: &Slot<T>| slot.kept.is_none() && slot.generation < LAST_GENERATION;
        let place = match slots.iter().position(free) {
            Some(place) => place,
            None => {
                slots.push(Slot {
                    generation: 0,
                    kept: None,
                });
                slots.len() - 1
            }
        };
        let number = u32::try_from(place)
            .map_err(|_| Fault::argument("there are too many handles: free some"))?;
        let slot = &mut slots[place];
        slot.generation += 1;
        slot.kept = Some(Arc::new(value));
        let kind = u64::from(self.kind as u8) << 56;
        Ok(kind | u64::from(slot.generation) << 32 | u64::from(number))
    }

    /// The value that `handle` stands for.
    pub(crate) fn get(&self, handle: u64) -> Result<Arc<T>, Fault> {
        let slots = self.slots();
        let kept = slots[self.place(&slots, handle)?].kept.as_ref();
        kept.map(Arc::clone).ok_or_else(|| self.freed(handle))
    }

    /// Ends `handle`. A call that is under way with it in another thread comes to its end before
    /// what it stands for is given up.
    pub(crate) fn free(&self, handle: u64) -> Result<(), Fault> {
        let mut slots = self.slots();
        let place = self.place(&slots, handle)?;
        let kept = slots[place].kept.take();
        drop(slots);
        match kept {
            Some(_) => Ok(()),
            None => Err(self.freed(handle)),
        }
    }

    /// The place of a handle that was given out, and not long ago.
    fn place(&self, slots: &[Slot<T>], handle: u64) -> Result<usize, Fault> {
        let kind = KINDS.iter().find(|kind| **kind as u64 == handle >> 56);
        if kind != Some(&self.kind) {
            let found = kind.map_or("no handle", |kind| kind.name());
            return Err(self.foreign(handle, found));
        }
        let place = (handle & u64::from(u32::MAX)) as usize;
        let generation = (handle >> 32) as u32 & LAST_GENERATION;
        match slots.get(place) {
            Some(slot) if generation == slot.generation => Ok(place),
            Some(slot) if (1..slot.generation).contains(&generation) => Err(self.freed(handle)),
            _ => Err(self.foreign(handle, "no handle that was given out")),
        }
    }

    fn foreign(&self, handle: u64, found: &str) -> Fault {
        let wanted = self.kind.name();
        let text = format!("{handle:#x}: expected the handle of {wanted}, found {found}");
        Fault::new(SelvedgeStatus::Handle, text)
    }

    fn freed(&self, handle: u64) -> Fault {
        let name = self.kind.name();
        let text = format!("{handle:#x}: the handle of {name} that was freed");
        Fault::new(SelvedgeStatus::Freed, text)
    }

    fn slots(&self) -> MutexGuard<'_, Vec<Slot<T>>> {
        // Nothing in here is left half done by a panic.
        self.slots.lock().unwrap_or_else(PoisonError::into_inner)
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
        let first = all.keep("first").unwrap();
        assert_eq!(*all.get(first).unwrap(), "first");
        all.free(first).unwrap();
        for _ in 0..3 {
            assert_eq!(status(all.get(first)), SelvedgeStatus::Freed);
            assert_eq!(status(all.free(first)), SelvedgeStatus::Freed);
            let second = all.keep("second").unwrap();
            assert_ne!(first, second);
            assert_eq!(status(all.get(first)), SelvedgeStatus::Freed);
            assert_eq!(*all.get(second).unwrap(), "second");
            all.free(second).unwrap();
        }
        assert_eq!(all.slots().len(), 1, "places are used again");
    }

    #[test]
    fn numbers_that_are_no_handles_are_told_from_those_of_another_kind() {
        let (models, scenes) = (Registry::new(Kind::Model), Registry::new(Kind::Scene));
        let model = models.keep(()).unwrap();
        scenes.keep(()).unwrap();
        let other = scenes.get(model).err().unwrap();
        assert_eq!(other.status, SelvedgeStatus::Handle);
        let never = model & !(u64::from(LAST_GENERATION) << 32);
        let near = [model + 1, model + (1 << 32), model ^ 1 << 60, never];
        for number in [0, 1, u64::MAX].into_iter().chain(near) {
            let found = status(models.get(number));
            assert_eq!(found, SelvedgeStatus::Handle, "{number:#x}");
        }
    }

    #[test]
    fn a_place_without_generations_left_is_not_used_again() {
        let all = Registry::new(Kind::Stepper);
        let first = all.keep(1).unwrap();
        all.slots()[0].generation = LAST_GENERATION;
        all.slots()[0].kept = None;
        let next = all.keep(2).unwrap();
        assert_eq!(next & u64::from(u32::MAX), 1);
        assert_eq!(status(all.get(first)), SelvedgeStatus::Freed);
    }

    #[test]
    fn handles_that_are_made_and_freed_by_many_threads_stay_apart() {
        let all = Registry::new(Kind::Scene);
        std::thread::scope(|scope| {
            for thread in 0..8_u32 {
                let all = &all;
                scope.spawn(move || {
                    for round in 0..200 {
                        let handle = all.keep((thread, round)).unwrap();
                        assert_eq!(*all.get(handle).unwrap(), (thread, round));
                        all.free(handle).unwrap();
                        assert_eq!(status(all.get(handle)), SelvedgeStatus::Freed);
                    }
                });
            }
        });
    }
}
