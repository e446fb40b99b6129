//! A motion bound to the start positions of handles: positions and targets at any time.

use glam::DVec3;

use super::blocks::BlockPath;
use super::bounds::{FARTHEST, MOTION_RATE, scene_frames, whole_frames};
use super::error::{MotionError, value_error};
use super::keyframes::KeyframePath;
use super::recorded::RecordedPath;
use super::splines::SplinePath;
use super::written::Motion;
use crate::{HandleError, HandleSchedule, HandleTargets};

/// A motion bound to start positions: where every handle is at any time.
#[derive(Clone, Debug, PartialEq)]
pub struct HandlePath {
    handle_count: usize,
    frame_rate: f64,
    frame_count: usize,
    form: PathForm,
    schedule: HandleSchedule,
}

#[derive(Clone, Debug, PartialEq)]
enum PathForm {
    Blocks(BlockPath),
    Keyframes(KeyframePath),
    Splines(SplinePath),
    Recorded(RecordedPath),
}

impl Motion {
    /// Binds the motion to handles that start at `start` `[m]`, `[handles]`, in a scene of
    /// `frame_rate` frames per second.
    ///
    /// ```
    /// use glam::DVec3;
    /// use selvedge_cloth::motion::named;
    ///
    /// let start = [DVec3::new(0.0, 0.0, -0.5), DVec3::new(0.0, 0.0, 0.5)];
    /// let path = named::by_name("forward").expect("a known name").bind(&start, 60.0)?;
    /// assert_eq!(path.frame_count(), 1260);
    /// assert_eq!(path.at(2.0)[0], start[0] + DVec3::X);
    /// # Ok::<(), selvedge_cloth::MotionError>(())
    /// ```
    ///
    /// # Errors
    /// [`MotionError`] names the field, or the frame of a recording, that cannot be used.
    pub fn bind(&self, start: &[DVec3], frame_rate: f64) -> Result<HandlePath, MotionError> {
        if !(frame_rate.is_finite() && frame_rate > 0.0) {
            let found = frame_rate.to_string();
            return Err(value_error("frame_rate", "finite and positive", found));
        }
        if let Some(handle) = start.iter().position(|p| !p.is_finite()) {
            let field = format!("the start of handle {handle}");
            return Err(value_error(field, "finite", start[handle]));
        }
        let (form, frames) = match self {
            Self::Blocks { blocks } => {
                let path = BlockPath::new(blocks, start)?;
                let frames = scene_frames(path.frames() as f64, frame_rate);
                (PathForm::Blocks(path), frames)
            }
            Self::Keyframes(motion) => {
                let path = KeyframePath::new(motion, start)?;
                let frames = whole_frames("duration", motion.duration)?;
                (
                    PathForm::Keyframes(path),
                    scene_frames(frames as f64, frame_rate),
                )
            }
            Self::Splines(motion) => {
                let path = SplinePath::new(motion, start)?;
                let frames = scene_frames(motion.duration * MOTION_RATE, frame_rate).max(1);
                (PathForm::Splines(path), frames)
            }
            Self::Recorded(motion) => {
                let path = RecordedPath::new(motion, start)?;
                let frames = motion.positions.len() - 1;
                (PathForm::Recorded(path), frames)
            }
        };
        Ok(HandlePath {
            handle_count: start.len(),
            frame_rate,
            frame_count: frames,
            form,
            schedule: HandleSchedule::default(),
        })
    }
}

impl HandlePath {
    /// The same path, of handles that let go as `schedule` says.
    #[must_use]
    pub fn scheduled(self, schedule: HandleSchedule) -> Self {
        Self { schedule, ..self }
    }

    /// Frames of the scene that the motion lasts (a run has one position more).
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.frame_count
    }

    /// Positions of the handles at `time` `[s]`, `[handles]` `[m]`; past the end they stay.
    #[must_use]
    pub fn at(&self, time: f64) -> Vec<DVec3> {
        let time = time.max(0.0);
        match &self.form {
            PathForm::Blocks(path) => path.at(time * MOTION_RATE),
            PathForm::Keyframes(path) => path.at(time),
            PathForm::Splines(path) => path.at(time),
            PathForm::Recorded(path) => path.at(time * self.frame_rate),
        }
    }

    /// Targets for the step from frame `frame` to the next, sampled `samples` times (at least
    /// once), the last at the end of the step.
    ///
    /// # Errors
    /// [`HandleError::NonFinite`] or [`HandleError::TooFar`].
    pub fn targets(&self, frame: usize, samples: usize) -> Result<HandleTargets, HandleError> {
        let count = samples.max(1);
        let mut positions = Vec::with_capacity(count * self.handle_count);
        for k in 1..=count {
            let frames = frame as f64 + k as f64 / count as f64;
            positions.extend(self.at(frames / self.frame_rate));
        }
        if let Some(far) = positions.iter().position(|p| p.length() > FARTHEST) {
            return Err(HandleError::TooFar {
                handle: far % self.handle_count,
                target: positions[far],
            });
        }
        let targets = HandleTargets::sampled(positions, self.handle_count)?;
        if self.schedule.is_empty() {
            return Ok(targets);
        }
        let released = self
            .schedule
            .released(frame, self.frame_rate, self.handle_count);
        targets.releasing(released)
    }
}
