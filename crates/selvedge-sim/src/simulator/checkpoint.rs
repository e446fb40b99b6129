//! All that a run needs to go on bit for bit.

use glam::DVec3;
use selvedge_cloth::{Checkpoint, ContactMemory, PreviousSubstep, Scene, VertexId};

use super::Simulator;
use super::error::SimulatorError;
use crate::contact::of_saved;

/// Checks that all values are finite in f32, and as many as the cloth has `vertices`.
fn check(of: &Checkpoint, vertices: usize) -> Result<(), SimulatorError> {
    check_state("positions", "position", &of.positions, vertices)?;
    check_state("velocities", "velocity", &of.velocities, vertices)?;
    if let Some(before) = &of.previous {
        let (what, one) = ("previous positions", "previous position");
        check_state(what, one, &before.positions, vertices)?;
        let (what, one) = ("previous velocities", "previous velocity");
        check_state(what, one, &before.velocities, vertices)?;
        check_seconds(before.seconds)?;
    }
    if let Some((changes, seconds)) = &of.changes {
        check_state("changes", "change", changes, vertices)?;
        check_seconds(*seconds)?;
    }
    for anchor in of.contact.iter().flat_map(|memory| &memory.anchors) {
        let vertex = VertexId(anchor.of.numbers()[1]);
        check_finite("direction of an anchor", vertex, anchor.normal)?;
        check_finite("pull of an anchor", vertex, anchor.pull)?;
    }
    Ok(())
}
fn check_seconds(seconds: f64) -> Result<(), SimulatorError> {
    if seconds.is_finite() && seconds > 0.0 {
        Ok(())
    } else {
        Err(SimulatorError::PreviousSubstep { seconds })
    }
}

/// Checks that there is one of `values` per vertex, finite in single precision.
fn check_state(
    what: &'static str,
    one: &'static str,
    values: &[DVec3],
    expected: usize,
) -> Result<(), SimulatorError> {
    let found = values.len();
    if found != expected {
        return Err(SimulatorError::Count {
            what,
            expected,
            found,
        });
    }
    let mut numbered = (0..).zip(values);
    numbered.try_for_each(|(vertex, value)| check_finite(one, VertexId(vertex), *value))
}

fn check_finite(what: &'static str, vertex: VertexId, value: DVec3) -> Result<(), SimulatorError> {
    if value.as_vec3().is_finite() {
        Ok(())
    } else {
        Err(SimulatorError::NonFinite {
            what,
            vertex,
            value,
        })
    }
}

impl Simulator {
    /// A simulator of `scene` that goes on from `checkpoint`. All handles count as on their paths;
    /// for a run along the scene's own motion see [`Self::taken_up_at`].
    ///
    /// # Errors
    /// A scene that does not validate, or a system that does not fit in memory; a count that does
    /// not match, a value that is not finite in f32, or a cloth that meets itself or an obstacle.
    pub fn from_checkpoint(scene: &Scene, checkpoint: &Checkpoint) -> Result<Self, SimulatorError> {
        scene.validate()?;
        check(checkpoint, scene.mesh.topology().vertex_count())?;
        let mut simulator = Self::of_mesh(scene)?;
        simulator.shift_obstacles(&checkpoint.obstacles);
        simulator.put(checkpoint);
        simulator.check_contact()?;
        Ok(simulator)
    }

    /// The state now.
    pub fn checkpoint(&self) -> Checkpoint {
        let changes = self.active.system.last_changes();
        let contact = self.contact.as_ref();
        let memory = contact.map(|contact| contact.memory.clone());
        Checkpoint {
            frame: self.frame,
            positions: self.state.positions.clone(),
            velocities: self.state.velocities.clone(),
            previous: self.history.last_substep().map(|seconds| PreviousSubstep {
                positions: self.history.before.positions.clone(),
                velocities: self.history.before.velocities.clone(),
                seconds,
            }),
            changes: changes.map(|(changes, seconds)| (changes.to_vec(), seconds)),
            contact: memory.filter(|memory| *memory != ContactMemory::default()),
            obstacles: self.obstacle_offsets(),
        }
    }

    /// Goes on from `checkpoint`. All handles hold and count as on their paths.
    ///
    /// # Errors
    /// As for [`Self::from_checkpoint`]; the cloth is left as it was.
    pub fn restore(&mut self, checkpoint: &Checkpoint) -> Result<(), SimulatorError> {
        let vertices = self.rounded.len();
        check(checkpoint, vertices)?;
        let all = if self.active.holds().contains(&false) {
            let all = self.holding(vec![true; self.reached.len()], &None);
            Some(all.map_err(|cause| SimulatorError::analysis(vertices, &cause))?)
        } else {
            None
        };
        let contact = self.contact.as_ref();
        let before = contact.map(|contact| (contact.bodies.shifts.clone(), contact.memory.clone()));
        self.shift_obstacles(&checkpoint.obstacles);
        self.put_contact(checkpoint);
        if let Err(error) = self.check_meeting(checkpoint.frame, &checkpoint.positions) {
            if let (Some(contact), Some((shifts, memory))) = (&mut self.contact, before) {
                contact.bodies.shifts = shifts;
                contact.remember_saved(memory);
            }
            return Err(error);
        }
        if let Some(all) = all {
            self.active = all;
        }
        self.put(checkpoint);
        Ok(())
    }

    /// Takes all but the obstacles from a checked checkpoint.
    fn put(&mut self, checkpoint: &Checkpoint) {
        self.frame = checkpoint.frame;
        self.end_recording("going back to a state");
        self.update_wind();
        self.state.positions.copy_from_slice(&checkpoint.positions);
        self.state
            .velocities
            .copy_from_slice(&checkpoint.velocities);
        self.reached = self.scene.handles.select(&self.state.positions);
        self.round();
        self.history.forget();
        if let Some(previous) = &checkpoint.previous {
            let before = &mut self.history.before;
            before.positions.copy_from_slice(&previous.positions);
            before.velocities.copy_from_slice(&previous.velocities);
            self.history.set_last_substep(previous.seconds);
        }
        self.put_contact(checkpoint);
        if let Some(contact) = &mut self.contact {
            contact.note_released(checkpoint.frame);
        }
        self.active.system.forget_changes();
        if let Some((changes, seconds)) = &checkpoint.changes {
            self.active.system.put_changes(changes, *seconds);
        }
    }

    /// Takes what contact left before a checked checkpoint.
    fn put_contact(&mut self, checkpoint: &Checkpoint) {
        if let Some(contact) = &mut self.contact {
            let memory = checkpoint.contact.clone();
            contact.remember_saved(of_saved(memory.unwrap_or_default()));
        }
    }
}
