//! Recording a [`Stepper`]: its positions, frame by frame, while the handles follow their path. And
//! a recording behind the same seam: it plays what was recorded, whatever the targets are.

use std::ops::ControlFlow;

use glam::Vec3;
use selvedge_cloth::{
    HandlePath, HandleTargets, Handles, Snapshot, StepError, Stepper, Topology, check_target_count,
};

use crate::Trajectory;

/// Positions for which there is room from the start, 192 MiB: a recording may be stopped long
/// before its end, and a day of a large cloth fills no machine's memory in advance.
const MOST_RESERVED: usize = 1 << 24;

/// A recording, complete or not.
#[derive(Clone, Debug, PartialEq)]
pub struct Recording {
    /// Positions `[m]`, `[frames * vertices]`, the start first.
    pub positions: Vec<Vec3>,
    /// End of the recording.
    pub end: RecordingEnd,
}

/// End of a recording.
#[derive(Clone, Debug, PartialEq)]
pub enum RecordingEnd {
    /// All frames were stepped.
    Complete,
    /// `on_frame` stopped it.
    Stopped,
    /// A step failed; the positions are those before it.
    Failed(StepError),
}

/// The handles' path, and how finely a stepper sees it.
#[derive(Clone, Copy, Debug)]
pub struct Drive<'a> {
    /// Positions of the handles at any time.
    pub path: &'a HandlePath,
    /// Targets per frame at equally spaced times; the physics takes one per substep.
    pub samples_per_frame: usize,
}

/// Steps `stepper` `frames` times from where it is and collects its positions, `frames + 1` frames
/// with the start. `on_frame` sees the stepper after each step, and may stop.
pub fn record<S: Stepper + ?Sized>(
    stepper: &mut S,
    drive: Drive<'_>,
    frames: usize,
    on_frame: &mut dyn FnMut(&S) -> ControlFlow<()>,
) -> Recording {
    let mut path = drive.path.clone();
    let mut step = |stepper: &mut S| {
        let targets = path.next(stepper, drive.samples_per_frame)?;
        stepper.step(&targets)
    };
    record_steps(stepper, frames, &mut step, on_frame)
}

/// As [`record`], by any step.
pub fn record_steps<S: Stepper + ?Sized>(
    stepper: &mut S,
    frames: usize,
    step: &mut dyn FnMut(&mut S) -> Result<(), StepError>,
    on_frame: &mut dyn FnMut(&S) -> ControlFlow<()>,
) -> Recording {
    let whole = frames
        .saturating_add(1)
        .saturating_mul(stepper.positions().len());
    let mut positions = Vec::with_capacity(whole.min(MOST_RESERVED));
    positions.extend_from_slice(stepper.positions());
    let mut end = RecordingEnd::Complete;
    for done in 1..=frames {
        if let Err(error) = step(stepper) {
            end = match error {
                StepError::Stopped { .. } => RecordingEnd::Stopped,
                error => RecordingEnd::Failed(error),
            };
            break;
        }
        positions.extend_from_slice(stepper.positions());
        if on_frame(stepper).is_break() && done < frames {
            end = RecordingEnd::Stopped;
            break;
        }
    }
    Recording { positions, end }
}

/// Plays a trajectory frame by frame. Handle targets must be as many as there are handles, and
/// are otherwise ignored.
#[derive(Clone, Debug, PartialEq)]
pub struct Playback {
    trajectory: Trajectory,
    frame: usize,
}

impl Playback {
    /// Starts `trajectory` at frame 0.
    pub fn new(trajectory: Trajectory) -> Self {
        Self {
            trajectory,
            frame: 0,
        }
    }

    /// The trajectory that is played.
    pub fn trajectory(&self) -> &Trajectory {
        &self.trajectory
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

    fn snapshot(&self) -> Option<Snapshot> {
        Some(Snapshot::of(self.frame))
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let frames = self.trajectory.frame_count();
        self.frame = *snapshot.get(self.frame, |frame| *frame < frames)?;
        Ok(())
    }
}
