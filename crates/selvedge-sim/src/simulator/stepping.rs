//! The simulator as a [`Stepper`].

use glam::{DVec3, Vec3};
use selvedge_cloth::{
    HandleTargets, Handles, Impulse, Rigid, Snapshot, StepError, Stepper, Stop, Topology, VertexId,
    check_target_count,
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
        self.reached.copy_from_slice(targets.end());
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
}
