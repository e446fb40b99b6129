//! The simulator as a [`Stepper`].

use glam::Vec3;
use selvedge_cloth::{
    HandleTargets, Handles, StepError, Stepper, Stop, Topology, check_target_count,
};

use super::{Simulator, Undo};

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
        self.undo = None;
        check_target_count(self, targets)?;
        let before = self.change_active(targets)?;
        self.update_wind();
        self.begin_frame();
        if before.is_some() {
            // The cloth was another one.
            self.history.forget();
        }
        if let Err(error) = self.advance(targets).and_then(|()| self.round_new()) {
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

    /// Heard between two substeps, and within the iterations of a solve.
    fn stop_by(&mut self, stop: Stop) {
        self.active.system.stop_by(stop.clone());
        self.stop = stop;
    }
}
