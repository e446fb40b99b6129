//! A frame: as many substeps as the scene asks for, and more where they are too few.
//!
//! A substep in which contact is too much is halved, and halves of it again. A frame that fails
//! even so, or that ends strained beyond the bound, is computed again with twice as many substeps.
//! Neither goes beyond [`most_substeps`](selvedge_cloth::PhysicsSettings::most_substeps).

use glam::DVec3;
use selvedge_cloth::{HandleTargets, StepError};

use super::Simulator;
use crate::contact::{Advance, Kept, Shift};
use crate::edges::Overstretched;
use crate::integrator::History;
use crate::state::State;

/// Factor by which contact divides a frame before vertices are held back in it: a vertex that stays
/// while its neighbours go on is strained, and what is strained meets again.
const BEFORE_HOLDING: u32 = 8;

/// Pairs of features that contact may certify in a frame, for each point of cloth and obstacles. A frame beyond is
/// refused: what moves as far as that within a frame is to be set there, by
/// [`teleport`](selvedge_cloth::Stepper::teleport). In two hundred falls from 1 m the most is 129,604, of a sheet that
/// crumples in one substep a frame; a leap of a cape by 4 m takes 527,000.
const MOST_PAIRS: u64 = 250_000;

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
    pub fn and(self, other: Self) -> Self {
        Self {
            frames: self.frames + other.frames,
            most_substeps: self.most_substeps.max(other.most_substeps),
        }
    }
}

/// The start of the frame, and that of the part of it under way, among those that are kept.
pub(super) const FRAME: usize = 0;
const PART: usize = 1;

/// All that a substep changes, as it was at an earlier time.
pub(super) struct Snapshot {
    pub(super) state: State,
    history: History,
    /// Changes of velocity of the last solve `[m/s]`, `[vertices]`, and their time `[s]`.
    changes: (Vec<DVec3>, f64),
    contact: Kept,
    /// Motions of obstacles away from their own paths.
    shifts: Vec<Shift>,
}

impl Snapshot {
    /// Room for a cloth with this number of vertices.
    pub(super) fn new(vertices: usize) -> Self {
        Self {
            state: State::at_origin(vertices),
            history: History::none(vertices),
            changes: (vec![DVec3::ZERO; vertices], 0.0),
            contact: Kept::default(),
            shifts: Vec::new(),
        }
    }
}

/// A part of a frame, to be taken in one substep.
#[derive(Clone, Copy)]
pub(crate) struct Part {
    /// Length `[s]`.
    pub(crate) dt: f64,
    /// Start and end, as parts of the frame.
    pub(crate) way: [f64; 2],
    /// True if contact may hold vertices back.
    pub(crate) may_hold: bool,
    /// True if it may be taken in two halves.
    pub(crate) may_divide: bool,
    /// True if an error is final.
    pub(crate) is_last: bool,
}

impl Simulator {
    /// Keeps all that a substep changes as this start.
    pub(super) fn save(&mut self, start: usize) {
        let into = &mut self.starts[start];
        into.state.copy_from(&self.state);
        into.history.copy_from(&self.history);
        let (changes, seconds) = self.active.system.changes();
        into.changes.0.copy_from_slice(changes);
        into.changes.1 = seconds;
        if let Some(contact) = &self.contact {
            contact.carry(&mut into.contact);
            into.shifts.clone_from(&contact.bodies.shifts);
        }
    }

    /// Restores what [`Self::save`] kept.
    pub(super) fn put_back(&mut self, start: usize) {
        let from = &self.starts[start];
        self.state.copy_from(&from.state);
        self.history.copy_from(&from.history);
        let (changes, seconds) = &from.changes;
        self.active.system.put_changes(changes, *seconds);
        if let Some(contact) = &mut self.contact {
            contact.put_back(&from.contact);
            contact.bodies.shifts.clone_from(&from.shifts);
        }
    }

    /// Moves the state by a frame. On an error it is as before.
    pub(super) fn advance(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let threads = self.enter();
        self.enter_frame();
        let asked = self.scene.physics.substeps;
        let most = self.scene.physics.most_substeps();
        let points = self.contact.as_ref().map_or(0, |c| c.point_count() as u64);
        let most_pairs = self.pairs() + MOST_PAIRS * points;
        let limits = (most, most_pairs);
        let mut substeps = asked;
        let finest = loop {
            let error = match threads.run(|| self.advance_in(substeps, limits, targets)) {
                Ok(finest) => break finest,
                Err(error) => error,
            };
            self.put_back(FRAME);
            self.check_stop()?;
            let is_strained = matches!(error, StepError::Overstretched { .. });
            let can_help = is_strained || self.contact.is_some();
            if !can_help || 2 * substeps > most || self.pairs() > most_pairs {
                return Err(error);
            }
            substeps = if is_strained {
                2 * substeps
            } else {
                // Substeps have been halved as far as this where they had to be. What can help is to
                // halve all of them, and to release contact.
                substeps << (most / substeps).ilog2()
            };
        };
        if finest > asked {
            self.divided = self.divided.and(DividedFrames {
                frames: 1,
                most_substeps: finest,
            });
        }
        Ok(())
    }

    /// Pairs that contact has certified since the start, or tried to.
    fn pairs(&self) -> u64 {
        let counts = self.contact.as_ref().map(|contact| contact.counts);
        counts.map_or(0, |c| c.certified + c.halved + c.uncertified)
    }

    /// Fails if someone wants to stop.
    fn check_stop(&self) -> Result<(), StepError> {
        let frame = self.frame + 1;
        if self.stop.is_wanted() { Err(StepError::Stopped { frame }) } else { Ok(()) }
    }

    /// Moves the state by a frame in `substeps` substeps, of which one is halved, and halves of it
    /// again, where contact is too much for it, to `most` a frame, while contact has certified fewer
    /// than `most_pairs`. Returns how many of the shortest make a frame. On an error the state is
    /// unusable.
    fn advance_in(
        &mut self,
        substeps: u32,
        (most, most_pairs): (u32, u64),
        targets: &HandleTargets,
    ) -> Result<u32, StepError> {
        if let Some(contact) = &mut self.contact {
            contact.forget_received();
            contact.take_back(&self.state.positions);
        }
        if let Some(tape) = &mut self.active.system.tape {
            tape.truncate(0);
        }
        let mut finest = substeps;
        // Parts of the frame that are done, and how many of their length it has.
        let (mut done, mut parts) = (0, substeps);
        while done < parts {
            self.check_stop()?;
            if let Some(contact) = self.contact.as_ref().filter(|_| self.pairs() > most_pairs) {
                return Err(contact.unseparated());
            }
            let dt = 1.0 / self.scene.frame_rate / f64::from(parts);
            let fraction = f64::from(done + 1) / f64::from(parts);
            let reached = &self.reached;
            let path = |h: usize| targets.at(h, fraction, reached[h]);
            self.active.put_targets(&mut self.targets, path);
            let part = Part {
                dt,
                way: [f64::from(done) / f64::from(parts), fraction],
                may_hold: parts >= self.scene.physics.substeps * BEFORE_HOLDING || 2 * parts > most,
                may_divide: 2 * parts <= most,
                is_last: 2 * substeps > most,
            };
            if self.contact.is_some() {
                self.save(PART);
            }
            let settled = self.active.system.tape.as_ref().map(|tape| tape.settled());
            match self.solve(part) {
                Ok(Advance::TooLong) | Err(StepError::Contact { .. }) if part.may_divide => {
                    self.put_back(PART);
                    if let (Some(tape), Some(settled)) = (&mut self.active.system.tape, settled) {
                        tape.truncate(settled);
                    }
                    self.active.system.forget_changes();
                    (done, parts) = (2 * done, 2 * parts);
                    finest = finest.max(parts);
                }
                Ok(_) => {
                    if let Some(tape) = &mut self.active.system.tape {
                        tape.settle(fraction);
                    }
                    done += 1;
                    while parts > substeps && done % 2 == 0 {
                        (done, parts) = (done / 2, parts / 2);
                    }
                }
                Err(error) => return Err(error),
            }
        }
        let bound = self.scene.physics.max_strain;
        let began = &self.starts[FRAME].state.positions;
        let checked = self
            .edges
            .check_stretch(began, &self.state.positions, bound);
        match checked {
            Ok(()) => Ok(finest),
            Err(Overstretched { vertices, strain }) => Err(StepError::Overstretched {
                frame: self.frame + 1,
                substeps,
                from: vertices[0],
                to: vertices[1],
                strain,
                bound,
                pushed_by: self.contact.as_ref().map_or_else(Vec::new, |c| c.pushers()),
            }),
        }
    }
}
