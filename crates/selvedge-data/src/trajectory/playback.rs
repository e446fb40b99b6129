//! A recording behind the [`Stepper`] seam: it plays what was recorded, whatever the targets are.

use glam::Vec3;
use selvedge_cloth::{HandleTargets, Handles, StepError, Stepper, Topology, check_target_count};

use crate::Trajectory;

/// Plays a trajectory frame by frame. Handle targets must be as many as there are handles, and
/// are otherwise ignored.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    trajectory: Trajectory,
    frame: usize,
}

impl Playback {
    /// Starts `trajectory` at frame 0.
    #[must_use]
    pub fn new(trajectory: Trajectory) -> Self {
        Self {
            trajectory,
            frame: 0,
        }
    }

    /// The trajectory that is played.
    #[must_use]
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
    }

    /// Goes back to frame 0.
    pub fn rewind(&mut self) {
        self.frame = 0;
    }
}

impl Stepper for Playback {
    fn topology(&self) -> &Topology {
        self.trajectory.topology()
    }

    fn handles(&self) -> &Handles {
        self.trajectory.handles()
    }

    fn positions(&self) -> &[Vec3] {
        self.trajectory.frame(self.frame)
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_target_count(self, targets)?;
        let (frame, frames) = (self.frame + 1, self.trajectory.frame_count());
        if frame >= frames {
            return Err(StepError::EndOfRecording { frame, frames });
        }
        self.frame = frame;
        Ok(())
    }
}
