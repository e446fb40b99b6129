//! A simulator from a checkpoint, and a checkpoint of a simulator.

use selvedge_cloth::{ContactMemory, Scene};

use super::Simulator;
use super::checkpoint::{Checkpoint, PreviousSubstep};
use super::error::SimulatorError;
use crate::active_handles::ActiveHandles;
use crate::contact::Memory;

impl Simulator {
    /// A simulator of `scene` that goes on from `checkpoint`. All handles count as on their paths;
    /// for a run along the scene's own motion see [`Self::taken_up_at`].
    ///
    /// # Errors
    /// A scene that does not validate, or a system that does not fit in memory; a count that does
    /// not match, a value that is not finite in f32, or a cloth that meets itself or an obstacle.
    pub fn from_checkpoint(scene: &Scene, checkpoint: &Checkpoint) -> Result<Self, SimulatorError> {
        scene.validate()?;
        checkpoint.check(scene.mesh.topology().vertex_count())?;
        let mut simulator = Self::starting(scene, checkpoint)?;
        simulator.shift_obstacles(&checkpoint.obstacles);
        simulator.put_memory(checkpoint);
        simulator.check_contact()?;
        simulator.update_wind();
        Ok(simulator)
    }

    /// The state now.
    #[must_use]
    pub fn checkpoint(&self) -> Checkpoint {
        let changes = self.active.system.last_changes();
        let contact = self.contact.as_ref();
        let memory = contact.map(|contact| contact.memory().saved());
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
        checkpoint.check(vertices)?;
        let all = match self.active.holds_all() {
            true => None,
            false => Some(ActiveHandles::all(&self.scene).map_err(|cause| {
                let cause = cause.to_string();
                SimulatorError::Analysis { vertices, cause }
            })?),
        };
        let contact = self.contact.as_ref();
        let before = contact.map(|contact| (contact.shifts.clone(), contact.memory().clone()));
        self.shift_obstacles(&checkpoint.obstacles);
        self.put_contact(checkpoint);
        if let Err(error) = self.check_meeting(checkpoint.frame, &checkpoint.positions) {
            if let (Some(contact), Some((shifts, memory))) = (&mut self.contact, before) {
                contact.shifts = shifts;
                contact.remember_saved(memory);
            }
            return Err(error);
        }
        if let Some(all) = all {
            self.active = all;
        }
        for (reached, vertex) in self.reached.iter_mut().zip(self.scene.handles.vertices()) {
            *reached = checkpoint.positions[vertex.index()];
        }
        self.frame = checkpoint.frame;
        self.update_wind();
        self.state.positions.copy_from_slice(&checkpoint.positions);
        self.state
            .velocities
            .copy_from_slice(&checkpoint.velocities);
        self.active.system.forget_changes();
        self.history.forget();
        self.undo = None;
        self.round();
        self.put_memory(checkpoint);
        Ok(())
    }

    /// Takes what a checked checkpoint has beside positions and velocities.
    fn put_memory(&mut self, checkpoint: &Checkpoint) {
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
        if let Some((changes, seconds)) = &checkpoint.changes {
            self.active.system.put_changes(changes, *seconds);
        }
    }
    /// Takes what contact left before a checked checkpoint.
    fn put_contact(&mut self, checkpoint: &Checkpoint) {
        if let Some(contact) = &mut self.contact {
            let memory = checkpoint.contact.as_ref().map(Memory::of_saved);
            contact.remember_saved(memory.unwrap_or_default());
        }
    }
}
