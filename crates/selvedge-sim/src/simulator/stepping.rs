//! The simulator as a [`Stepper`].

use glam::{DVec3, Vec3};
use selvedge_cloth::{
    HandleTargets, Handles, StepError, Stepper, Stop, Topology, check_target_count,
};

use super::{Simulator, Undo};

impl Simulator {
    /// A step in the scene's number of substeps, after each of which `after` may move the cloth: it
    /// gets positions `[m]` and velocities `[m/s]`, `[vertices]`. For free flight, which knows no
    /// contact and divides no substep.
    ///
    /// # Errors
    /// As for [`Stepper::step`], and those of `after`; the cloth is left as it was.
    pub fn step_with(
        &mut self,
        targets: &HandleTargets,
        after: &mut dyn FnMut(&mut [DVec3], &mut [DVec3]) -> Result<(), StepError>,
    ) -> Result<(), StepError> {
        self.step_by(targets, |simulator| {
            let moved = simulator.fly(targets, after);
            if moved.is_err() {
                simulator.restore();
            }
            moved
        })
    }

    /// A step by `advance`, which moves the state by a frame, or leaves it as it was and says why.
    fn step_by(
        &mut self,
        targets: &HandleTargets,
        advance: impl FnOnce(&mut Self) -> Result<(), StepError>,
    ) -> Result<(), StepError> {
        self.undo = None;
        check_target_count(self, targets)?;
        let before = self.change_active(targets)?;
        self.update_wind();
        self.save();
        if before.is_some() {
            // The cloth was another one.
            self.history.forget();
        }
        if let Err(error) = advance(self).and_then(|()| self.round_new()) {
            if let Some(before) = before {
                self.active = before;
            }
            return Err(error);
        }
        self.reached_before.copy_from_slice(&self.reached);
        self.reached.copy_from_slice(targets.end());
        self.undo = Some(Undo { active: before });
        self.frame += 1;
        self.arrive();
        Ok(())
    }
}

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

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.step_by(targets, |simulator| simulator.divided(targets))
    }

    /// Heard between two substeps, and within the iterations of a solve.
    fn stop_by(&mut self, stop: Stop) {
        self.active.system.stop_by(stop.clone());
        self.stop = stop;
    }
}
