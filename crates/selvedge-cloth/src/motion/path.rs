//! A motion bound to the start positions of handles: positions and targets at any time.

use glam::DVec3;

use super::blocks::BlockPath;
use super::bounds::{FARTHEST, MOTION_RATE, scene_frames, whole_frames};
use super::keyframes::KeyframePath;
use super::recorded::RecordedPath;
use super::splines::SplinePath;
use super::written::Motion;
use crate::error::{SceneError, must, require_positive};
use crate::{HandleError, HandleSchedule, HandleTargets, StepError, Stepper};

/// A motion bound to start positions: where every handle is at any time.
#[derive(Clone, Debug, PartialEq)]
pub struct HandlePath {
    handle_count: usize,
    frame_rate: f64,
    frame_count: usize,
    form: PathForm,
    schedule: HandleSchedule,
    /// From the path of each handle to where it leads the cloth `[m]`, `[handles]`; empty where all
    /// are on their paths.
    offsets: Vec<DVec3>,
    /// The frame that was followed last.
    followed: Option<usize>,
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
    /// # Ok::<(), selvedge_cloth::SceneError>(())
    /// ```
    ///
    /// # Errors
    /// [`SceneError`] names the field, or the frame of a recording, that cannot be used.
    pub fn bind(&self, start: &[DVec3], frame_rate: f64) -> Result<HandlePath, SceneError> {
        let bound = self.form(start, frame_rate);
        let (form, frame_count) = bound.map_err(|error| error.of("motion"))?;
        Ok(HandlePath {
            handle_count: start.len(),
            frame_rate,
            frame_count,
            form,
            schedule: HandleSchedule::default(),
            offsets: Vec::new(),
            followed: None,
        })
    }

    /// The bound form, and the frames of the scene that it lasts.
    fn form(&self, start: &[DVec3], frame_rate: f64) -> Result<(PathForm, usize), SceneError> {
        require_positive("frame_rate", frame_rate)?;
        if let Some(handle) = start.iter().position(|p| !p.is_finite()) {
            let field = format!("the start of handle {handle}");
            return Err(must(field, "finite", start[handle]));
        }
        let in_scene = |frames: f64| scene_frames(frames, frame_rate);
        Ok(match self {
            Self::Blocks { blocks } => {
                let path = BlockPath::new(blocks, start)?;
                let frames = in_scene(path.frames() as f64);
                (PathForm::Blocks(path), frames)
            }
            Self::Keyframes(motion) => {
                let path = KeyframePath::new(motion, start)?;
                let frames = whole_frames("duration", motion.duration)?;
                (PathForm::Keyframes(path), in_scene(frames as f64))
            }
            Self::Splines(motion) => {
                let path = SplinePath::new(motion, start)?;
                let frames = in_scene(motion.duration * MOTION_RATE).max(1);
                (PathForm::Splines(path), frames)
            }
            Self::Recorded(motion) => {
                let path = RecordedPath::new(motion, start)?;
                (PathForm::Recorded(path), motion.positions.len() - 1)
            }
        })
    }
}

impl HandlePath {
    /// The same path, of handles that let go as `schedule` says.
    pub fn scheduled(self, schedule: HandleSchedule) -> Self {
        Self { schedule, ..self }
    }

    /// Frames of the scene that the motion lasts (a run has one position more).
    pub fn frame_count(&self) -> usize {
        self.frame_count
    }

    /// Positions of the handles at `time` `[s]`, `[handles]` `[m]`; past the end they stay.
    pub fn at(&self, time: f64) -> Vec<DVec3> {
        let time = time.max(0.0);
        match &self.form {
            PathForm::Blocks(path) => path.at(time * MOTION_RATE),
            PathForm::Keyframes(path) => path.at(time),
            PathForm::Splines(path) => path.at(time),
            PathForm::Recorded(path) => path.at(time * self.frame_rate),
        }
    }

    /// Sees the cloth in frame `frame`, its handles at `places` `[m]`, `[handles]`, before the targets
    /// of its next step are asked for. A handle that takes hold again in it does so of the cloth where
    /// that is, and from there moves by as much as its path. Where the frame before was not seen, as
    /// in a run that is taken up again, so does one that took hold again earlier.
    pub fn follow(&mut self, frame: usize, places: &[DVec3]) {
        let (rate, count) = (self.frame_rate, self.handle_count);
        let before = self.followed.replace(frame);
        let last = frame.saturating_sub(1);
        let ever = self.schedule.let_go_by(last, rate, count);
        if frame == 0 || !ever.contains(&true) {
            self.offsets.clear();
            return;
        }
        let goes_on = before == Some(last) || before == Some(frame);
        let was_free = self.schedule.released(last, rate, count);
        let path = self.at(frame as f64 / rate);
        self.offsets.resize(count, DVec3::ZERO);
        for handle in 0..count {
            if was_free[handle] || ever[handle] && !goes_on {
                self.offsets[handle] = places[handle] - path[handle];
            }
        }
    }

    /// Sees the cloth of `stepper` and gives the targets of its next step, sampled `samples` times.
    ///
    /// # Errors
    /// [`StepError::Handles`] for a target that is not finite, or too far away.
    pub fn next(
        &mut self,
        stepper: &(impl Stepper + ?Sized),
        samples: usize,
    ) -> Result<HandleTargets, StepError> {
        let frame = stepper.frame();
        self.follow(frame, &stepper.handle_places());
        let targets = self.targets(frame, samples);
        targets.map_err(|error| error.at(frame + 1))
    }

    /// Targets for the step from frame `frame` to the next, sampled `samples` times (at least
    /// once), the last at the end of the step; those of handles that took hold again as
    /// [`Self::follow`] saw it.
    ///
    /// # Errors
    /// [`HandleError`] for a target that is not finite, or too far away.
    pub fn targets(&self, frame: usize, samples: usize) -> Result<HandleTargets, HandleError> {
        let count = samples.max(1);
        let mut positions = Vec::with_capacity(count * self.handle_count);
        for k in 1..=count {
            let frames = frame as f64 + k as f64 / count as f64;
            positions.extend(self.at(frames / self.frame_rate));
        }
        let offsets = self.offsets.iter().cycle();
        for (position, offset) in positions.iter_mut().zip(offsets) {
            *position += *offset;
        }
        if let Some(far) = positions.iter().position(|p| p.length() > FARTHEST) {
            return Err(HandleError::Unusable(format!(
                "the target of handle {} is more than 1e6 m from the origin: {}; check the motion's units",
                far % self.handle_count,
                positions[far]
            )));
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
