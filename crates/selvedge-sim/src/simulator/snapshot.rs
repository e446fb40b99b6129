//! The state before a frame or a part of it, and frames that were divided.

use glam::DVec3;

use crate::contact::{Carried, Contact};
use crate::integrator::History;
use crate::solver::System;
use crate::state::State;

/// Part of a frame.
#[derive(Clone, Copy)]
pub(super) struct Part {
    pub(super) from: f64,
    pub(super) to: f64,
    /// True if contact may hold vertices back; else the frame is divided first.
    pub(super) may_hold: bool,
    /// True if an error in it is final.
    pub(super) is_last: bool,
}

/// The frames so far that took more substeps than the scene asks for: edges would have strained too
/// much, or contact was too much for fewer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct DividedFrames {
    /// Such frames.
    pub frames: u64,
    /// The most substeps that one would have taken, had all been as short as its shortest; 0 where
    /// there is none.
    pub most_substeps: u32,
}

impl DividedFrames {
    /// Those of this run and of another.
    #[must_use]
    pub fn and(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            most_substeps: self.most_substeps.max(other.most_substeps),
        }
    }
}

/// All that a substep changes, as it was at an earlier time.
pub(super) struct Snapshot {
    pub(super) state: State,
    history: History,
    /// Changes of velocity of the last solve `[m/s]`, `[vertices]`, and their time `[s]`.
    changes: (Vec<DVec3>, f64),
    contact: Carried,
}

impl Snapshot {
    /// Room for a cloth with this number of vertices.
    pub(super) fn new(vertices: usize) -> Self {
        Self {
            state: State::at_origin(vertices),
            history: History::none(vertices),
            changes: (vec![DVec3::ZERO; vertices], 0.0),
            contact: Carried::default(),
        }
    }

    pub(super) fn take(
        &mut self,
        state: &State,
        history: &History,
        system: &System,
        contact: Option<&Contact>,
    ) {
        self.state.copy_from(state);
        self.history.copy_from(history);
        let (changes, seconds) = system.changes();
        self.changes.0.copy_from_slice(changes);
        self.changes.1 = seconds;
        if let Some(contact) = contact {
            contact.carry(&mut self.contact);
        }
    }

    pub(super) fn put(
        &self,
        state: &mut State,
        history: &mut History,
        system: &mut System,
        contact: Option<&mut Contact>,
    ) {
        state.copy_from(&self.state);
        history.copy_from(&self.history);
        system.put_changes(&self.changes.0, self.changes.1);
        if let Some(contact) = contact {
            contact.put_back(&self.contact);
        }
    }
}
