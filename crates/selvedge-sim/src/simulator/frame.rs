//! A frame: as many substeps as the scene asks for, and more where they are too few.
//!
//! A substep in which contact is too much is halved, and halves of it again. A frame that fails
//! even so, or that ends strained beyond the bound, is computed again with twice as many substeps.
//! Neither goes beyond [`most_substeps`](selvedge_cloth::PhysicsSettings::most_substeps).

use glam::DVec3;
use selvedge_cloth::{HandleTargets, StepError};

use super::Simulator;
use crate::contact::Carried;
use crate::integrator::History;
use crate::state::State;
use crate::substep_error::SubstepError;

/// Factor by which contact divides a frame before vertices are held back in it: a vertex that stays
/// while its neighbours go on is strained, and what is strained meets again.
const BEFORE_HOLDING: u32 = 8;

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
#[derive(Default)]
pub(super) struct Snapshot {
    state: State,
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
}

impl Simulator {
    /// Keeps all that a substep changes.
    fn save(&self, into: &mut Snapshot) {
        into.state.copy_from(&self.state);
        into.history.copy_from(&self.history);
        let (changes, seconds) = self.active.system.changes();
        into.changes.0.copy_from_slice(changes);
        into.changes.1 = seconds;
        if let Some(contact) = &self.contact {
            contact.carry(&mut into.contact);
        }
    }

    /// Restores what [`Self::save`] kept.
    fn put_back(&mut self, from: &Snapshot) {
        self.state.copy_from(&from.state);
        self.history.copy_from(&from.history);
        let (changes, seconds) = &from.changes;
        self.active.system.put_changes(changes, *seconds);
        if let Some(contact) = &mut self.contact {
            contact.put_back(&from.contact);
        }
    }

    /// Keeps the start of a frame for [`Self::undo_frame`].
    pub(super) fn begin_frame(&mut self) {
        let mut start = std::mem::take(&mut self.frame_start);
        self.save(&mut start);
        self.frame_start = start;
    }

    /// Takes the cloth back to the start of the frame.
    pub(super) fn undo_frame(&mut self) {
        let start = std::mem::take(&mut self.frame_start);
        self.put_back(&start);
        self.frame_start = start;
    }

    /// Moves the state by a frame. On an error it is as before.
    pub(super) fn advance(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let threads = self.enter();
        self.enter_frame();
        let asked = self.scene.physics.substeps;
        let most = self.scene.physics.most_substeps();
        let mut substeps = asked;
        let finest = loop {
            let mut error = match threads.run(|| self.advance_in(substeps, most, targets)) {
                Ok(finest) => break finest,
                Err(error) => error,
            };
            let more_would_do = matches!(error, SubstepError::Stretch(_)) || self.contact.is_some();
            let is_stopped = self.stop.is_wanted();
            if is_stopped {
                error = SubstepError::Stopped;
            }
            let error = self.step_error(error, substeps);
            self.undo_frame();
            if is_stopped || !more_would_do || 2 * substeps > most {
                return Err(error);
            }
            substeps *= 2;
        };
        if finest > asked {
            self.divided = self.divided.and(DividedFrames {
                frames: 1,
                most_substeps: finest,
            });
        }
        Ok(())
    }

    /// Moves the state by a frame in `substeps` substeps, of which one is halved, and halves of it
    /// again, where contact is too much for it. Returns how many of the shortest make a frame. On
    /// an error the state is unusable.
    fn advance_in(
        &mut self,
        substeps: u32,
        most: u32,
        targets: &HandleTargets,
    ) -> Result<u32, SubstepError> {
        self.forget_received();
        if let Some(contact) = &mut self.contact {
            contact.take_back(&self.state.positions);
        }
        let mut finest = substeps;
        // Parts of the frame that are done, and how many of their length it has.
        let (mut done, mut parts) = (0, substeps);
        while done < parts {
            if self.stop.is_wanted() {
                return Err(SubstepError::Stopped);
            }
            let dt = 1.0 / self.scene.frame_rate / f64::from(parts);
            let fraction = f64::from(done + 1) / f64::from(parts);
            let reached = &self.reached;
            let path = |h: usize| targets.at(h, fraction, reached[h]);
            self.active.put_targets(&mut self.targets, path);
            let way = [f64::from(done) / f64::from(parts), fraction];
            let may_hold =
                parts >= self.scene.physics.substeps * BEFORE_HOLDING || 2 * parts > most;
            if self.contact.is_some() {
                let mut start = std::mem::take(&mut self.part_start);
                self.save(&mut start);
                self.part_start = start;
            }
            match self.solve(dt, way, may_hold, 2 * substeps > most) {
                Ok(()) => {
                    done += 1;
                    while parts > substeps && done % 2 == 0 {
                        (done, parts) = (done / 2, parts / 2);
                    }
                }
                Err(SubstepError::Contact(_)) if 2 * parts <= most => {
                    let start = std::mem::take(&mut self.part_start);
                    self.put_back(&start);
                    self.part_start = start;
                    self.active.system.forget_changes();
                    (done, parts) = (2 * done, 2 * parts);
                    finest = finest.max(parts);
                }
                Err(error) => return Err(error),
            }
        }
        let bound = self.scene.physics.max_strain;
        let began = &self.frame_start.state.positions;
        let checked = self
            .edges
            .check_stretch(began, &self.state.positions, bound);
        checked.map_err(SubstepError::Stretch)?;
        Ok(finest)
    }
}
