//! A cloth that lies still costs nothing: where contact is on, every vertex has stayed within [`STILL`] of a
//! place for [`WHILE`] and nothing that acts on it changes, frames are not solved.

use glam::DVec3;
use selvedge_cloth::{HandleTargets, StepError, Still};

use super::Simulator;
use super::frame::FRAME;

/// Way from its place within which a vertex is still `[m]`.
const STILL: f64 = 5e-5;
/// Time for which all vertices have to be still `[s]`: what creeps by less than 0.05 mm/s rests.
const WHILE: f64 = 1.0;

impl Simulator {
    /// Returns true if the cloth rests during the step to `targets`, which others hold if `is_changed`. What
    /// changes wakes it.
    pub(super) fn rests(&mut self, targets: &HandleTargets, is_changed: bool) -> bool {
        let (frame, rate) = (self.frame, self.scene.frame_rate);
        let environment = |frame| self.scene.environment.during_step(frame, rate);
        let is_same_air = environment(frame) == environment(frame.saturating_sub(1));
        let Some(contact) = &mut self.contact else {
            return false;
        };
        if contact.memory.still.is_empty() {
            return false;
        }
        contact.enter_frame(frame, rate);
        let stays = targets.stay_at(&self.reached) && contact.bodies.stand_still();
        if is_changed || !is_same_air || !stays || self.recording.is_some() {
            contact.memory.still.clear();
            return false;
        }
        let still = contact.memory.still.iter().zip(&self.state.positions);
        let frames = (WHILE * rate).ceil();
        let mut still = still.map(|(still, place)| {
            let frames_ago = frame as f64 - f64::from(still.since);
            frames_ago >= frames && still.place.distance(*place) <= STILL
        });
        still.all(|rests| rests)
    }

    /// A frame in which the cloth rests.
    pub(super) fn rest(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let received = |simulator: &Self| simulator.contact.as_ref().map(|c| c.received.clone());
        if received(self).is_some_and(|received| !received.are_known) {
            // What bodies bear is that of a frame that is solved.
            self.advance(targets)?;
            let solved = received(self);
            self.put_back(FRAME);
            if let (Some(contact), Some(solved)) = (&mut self.contact, solved) {
                contact.received = solved;
            }
        }
        self.state.velocities.fill(DVec3::ZERO);
        self.history.forget();
        self.active.system.forget_changes();
        if let Some(contact) = &mut self.contact {
            contact.counts.resting += 1;
        }
        Ok(())
    }

    /// Notes which vertices have stayed where they were in the frame that is done.
    pub(super) fn note_still(&mut self) {
        let Some(contact) = &mut self.contact else {
            return;
        };
        let (now, before) = (&self.state.positions, &self.starts[FRAME].state.positions);
        let memory = &mut contact.memory;
        let moves = |(from, to): (&DVec3, &DVec3)| from.distance(*to) > STILL;
        if !memory.released.is_empty() || before.iter().zip(now).any(moves) {
            memory.still.clear();
            return;
        }
        let since = self.frame as u32;
        if memory.still.is_empty() {
            let places = now.iter();
            memory.still.extend(places.map(|place| Still {
                since,
                place: *place,
            }));
        }
        for (still, place) in memory.still.iter_mut().zip(now) {
            if moves((&still.place, place)) {
                *still = Still {
                    since,
                    place: *place,
                };
            }
        }
    }

    /// The cloth, or a body, is put elsewhere.
    pub(super) fn wake(&mut self) {
        if let Some(contact) = &mut self.contact {
            contact.memory.still.clear();
        }
    }
}
