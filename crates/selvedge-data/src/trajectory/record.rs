//! Recording a [`Stepper`]: its positions, frame by frame, while the handles follow their path.

use std::ops::ControlFlow;

use glam::Vec3;
use selvedge_cloth::{HandlePath, StepError, Stepper};

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
    let whole = frames
        .saturating_add(1)
        .saturating_mul(stepper.positions().len());
    let mut positions = Vec::with_capacity(whole.min(MOST_RESERVED));
    positions.extend_from_slice(stepper.positions());
    let mut end = RecordingEnd::Complete;
    for done in 1..=frames {
        if let Err(error) = step(stepper, drive) {
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

fn step<S: Stepper + ?Sized>(stepper: &mut S, drive: Drive<'_>) -> Result<(), StepError> {
    let frame = stepper.frame();
    let targets = drive
        .path
        .targets(frame, drive.samples_per_frame)
        .map_err(|source| StepError::Handles {
            frame: frame + 1,
            source,
        })?;
    stepper.step(&targets)
}
