//! The simulator as a [`Stepper`], and as a [`Correctable`]: frames that were made elsewhere, and steps
//! that are undone.

use glam::{DVec3, Vec3};
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, Impulse, Rigid, Snapshot, StepError, Stepper, Stop,
    Topology, VertexId, check_target_count,
};

use super::frame::FRAME;
use super::{Checkpoint, Simulator, SimulatorError};

impl Stepper for Simulator {
    fn topology(&self) -> &Topology {
        self.scene.mesh.topology()
    }

    fn handles(&self) -> &Handles {
        &self.scene.handles
    }

    fn positions(&self) -> &[Vec3] {
        &self.rounded
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn handle_places(&self) -> Vec<DVec3> {
        self.scene.handles.select(&self.state.positions)
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.undo = None;
        check_target_count(self, targets)?;
        let begun = self.begin_recorded();
        let before = self.change_active(targets)?;
        self.update_wind();
        self.save(FRAME);
        if before.is_some() {
            // The cloth was another one.
            self.history.forget();
        }
        let rests = self.rests(targets, before.is_some());
        let moved = if rests {
            self.rest(targets)
        } else {
            self.advance(targets).and_then(|()| self.round_new())
        };
        if let Err(error) = moved {
            if let Some(before) = before {
                self.active = before;
            }
            return Err(error);
        }
        self.reached_before.copy_from_slice(&self.reached);
        self.reached.copy_from_slice(targets.end());
        self.undo = Some(before);
        self.frame += 1;
        if !rests {
            self.note_still();
        }
        if let Some(contact) = &mut self.contact {
            contact.arrive();
            contact.note_released(self.frame);
        }
        self.end_recorded(begun, targets);
        Ok(())
    }

    /// Heard between two substeps, and within the iterations of a solve.
    fn stop_by(&mut self, stop: Stop) {
        self.active.system.stop_by(stop.clone());
        self.stop = stop;
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(Snapshot::of(self.led()))
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let (frame, handles) = (self.frame, self.reached.len());
        let led: &Led = snapshot.get(frame, |led: &Led| {
            led.reached.len() == handles && led.checkpoint.positions.len() == self.rounded.len()
        })?;
        self.go_to(led, |_| StepError::Snapshot { frame })
    }

    fn teleport(&mut self, to: Rigid, along: &[usize]) -> Result<(), StepError> {
        let frame = self.frame;
        let turn = to.turn.normalize();
        let to = Rigid { turn, ..to };
        let mut led = self.led();
        led.carried.clear();
        let state = &mut led.checkpoint;
        let previous = state.previous.as_mut();
        let (before, pace) = previous
            .map(|p| (&mut p.positions, &mut p.velocities))
            .unzip();
        let places = [Some(&mut state.positions), before, Some(&mut led.reached)];
        for place in places.into_iter().flatten().flatten() {
            *place = to.of(*place);
        }
        let changes = state.changes.as_mut().map(|(changes, _)| changes);
        let paces = [Some(&mut state.velocities), pace, changes];
        for pace in paces.into_iter().flatten().flatten() {
            *pace = to.turn * *pace;
        }
        // Friction takes hold anew where it is.
        if let Some(contact) = &mut state.contact {
            contact.anchors.clear();
            contact.still.clear();
        }
        for number in along {
            let count = state.obstacles.len();
            let place = state.obstacles.get_mut(*number);
            let place = place.ok_or(StepError::Obstacle {
                frame,
                number: *number,
                count,
            })?;
            *place = to.after(place);
        }
        let was_recorded = self.recording.is_some();
        self.go_to(&led, |error| match error {
            SimulatorError::Intersections { count, pairs, .. } => StepError::Intersections {
                frame,
                count,
                pairs,
            },
            _ => StepError::NonFinite {
                frame,
                vertex: VertexId(0),
            },
        })?;
        if was_recorded {
            self.recording_ended_by = Some("`teleport`");
        }
        Ok(())
    }
}

/// A state, and where and how its handles were led.
struct Led {
    checkpoint: Checkpoint,
    /// What obstacles have of the change of velocity that is looked back to.
    carried: Vec<Impulse>,
    reached: Vec<DVec3>,
    holds: Vec<bool>,
}

impl Simulator {
    fn led(&self) -> Led {
        Led {
            checkpoint: self.checkpoint(),
            carried: self
                .contact
                .as_ref()
                .map_or_else(Vec::new, |c| c.received.carried.clone()),
            reached: self.reached.clone(),
            holds: self.active.holds().to_vec(),
        }
    }

    /// Goes to a state of this cloth; one that cannot be is `wrong`, and nothing changes.
    fn go_to(
        &mut self,
        led: &Led,
        wrong: impl FnOnce(SimulatorError) -> StepError,
    ) -> Result<(), StepError> {
        let frame = self.frame;
        let some = led.holds.contains(&false).then(|| {
            let active = self.holding(led.holds.clone(), &led.checkpoint.changes);
            active.map_err(|error| error.at(frame))
        });
        let some = some.transpose()?;
        self.restore(&led.checkpoint).map_err(wrong)?;
        if let Some(active) = some {
            self.active = active;
            self.update_wind();
        }
        self.reached.copy_from_slice(&led.reached);
        if let Some(contact) = &mut self.contact {
            contact.received.carried.clone_from(&led.carried);
        }
        Ok(())
    }

    /// Checks the number of positions, that all of them are finite, and that nothing meets.
    fn check_frame(&self, frame: usize, positions: &[Vec3]) -> Result<(), StepError> {
        assert_eq!(positions.len(), self.rounded.len(), "positions");
        match positions.iter().position(|p| !p.is_finite()) {
            Some(vertex) => Err(StepError::NonFinite {
                frame,
                vertex: VertexId(vertex as u32),
            }),
            None => self.check_apart(frame, positions),
        }
    }
}

/// A frame that is replaced moves at the velocities of before, plus that of the way from the old
/// places to the new ones in one frame; the state one substep
/// ago takes its part of that way. One that is taken moves as it came from the frame before.
/// Where the scene has contact, a frame in which something meets is refused.
impl Correctable for Simulator {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.check_frame(self.frame, positions)?;
        self.end_recording("`replace_frame`");
        self.wake();
        let rate = self.scene.frame_rate;
        // Part of the frame that had passed before the last substep.
        let passed = 1.0 - self.history.last_substep().unwrap_or(0.0) * rate;
        let ([x, v], before) = (self.state.both_mut(), &mut self.history.before);
        for (k, to) in positions.iter().enumerate() {
            let way = to.as_dvec3() - x[k];
            let velocity = v[k] + rate * way;
            // As if the cloth had come to the new places at the new velocities.
            before.positions[k] += passed * way;
            before.velocities[k] += velocity - v[k];
            x[k] = to.as_dvec3();
            v[k] = velocity;
        }
        self.round();
        Ok(())
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.check_frame(self.frame + 1, positions)?;
        self.end_recording("`take_frame`");
        self.undo = None;
        let rate = self.scene.frame_rate;
        let [x, v] = self.state.both_mut();
        for ((x, v), to) in x.iter_mut().zip(v).zip(positions) {
            let to = to.as_dvec3();
            *v = rate * (to - *x);
            *x = to;
        }
        self.reached = self.handle_places();
        self.active.system.forget_changes();
        self.history.forget();
        if let Some(contact) = &mut self.contact {
            contact.forget();
        }
        self.frame += 1;
        self.update_wind();
        self.round();
        Ok(())
    }

    fn undo_step(&mut self) {
        let Some(active) = self.undo.take() else {
            return;
        };
        self.end_recording("`undo_step`");
        self.put_back(FRAME);
        if let Some(active) = active {
            self.active = active;
        }
        self.reached.copy_from_slice(&self.reached_before);
        self.frame -= 1;
        self.update_wind();
        self.round();
    }
}
