//! The physics as a [`Correctable`]: frames that were made elsewhere, and steps that are undone.

use glam::Vec3;
use selvedge_cloth::{Correctable, StepError, VertexId};

use super::{Simulator, Undo};
use crate::state::State;

impl Simulator {
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
        let rate = self.scene.frame_rate;
        // Part of the frame that had passed before the last substep.
        let passed = 1.0 - self.history.last_substep().unwrap_or(0.0) * rate;
        let (
            State {
                positions: x,
                velocities: v,
            },
            before,
        ) = (&mut self.state, &mut self.history.before);
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
        self.undo = None;
        let rate = self.scene.frame_rate;
        let State {
            positions: x,
            velocities: v,
        } = &mut self.state;
        for ((x, v), to) in x.iter_mut().zip(v).zip(positions) {
            let to = to.as_dvec3();
            *v = rate * (to - *x);
            *x = to;
        }
        for (reached, vertex) in self.reached.iter_mut().zip(self.scene.handles.vertices()) {
            *reached = self.state.positions[vertex.index()];
        }
        self.active.system.forget_changes();
        self.history.forget();
        self.forget_touches();
        self.frame += 1;
        self.update_wind();
        self.round();
        Ok(())
    }

    fn undo_step(&mut self) {
        let Some(Undo { active }) = self.undo.take() else {
            return;
        };
        self.undo_frame();
        if let Some(active) = active {
            self.active = active;
        }
        self.reached.copy_from_slice(&self.reached_before);
        self.frame -= 1;
        self.update_wind();
        self.round();
    }
}
