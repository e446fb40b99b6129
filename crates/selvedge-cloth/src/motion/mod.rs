//! Handle motion: blocks, keyframes, splines and recordings, bound to the handles' start positions as a
//! [`HandlePath`] that tells where every handle is at any time.
//!
//! Conventions: y is up; the handles' line is through the first and the last handle; rotations turn
//! handles about a vertical axis, a positive angle being counter-clockwise seen from above. Times
//! in seconds; speeds in metres per frame of 1/60 s, the unit of the paper's figures, whatever the
//! frame rate of the scene. The forms that people write (and their TOML) are here, what is computed
//! from them in one file per form; [`named`] holds the motions of the paper and of our tests.

mod apart;
mod blocks;
mod keyframes;
pub mod named;
mod pace;
mod random;
mod recorded;
mod splines;

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use self::apart::apart;
use self::blocks::BlockPath;
use self::keyframes::KeyframePath;
pub use self::pace::{Pace, Profile};
pub use self::random::RandomMotion;
use self::recorded::RecordedPath;
use self::splines::SplinePath;
use crate::{HandleError, HandleSchedule, HandleTargets};

/// Frames per second in which durations are counted and speeds are given.
pub(crate) const MOTION_RATE: f64 = 60.0;

/// Farthest from the origin that a handle may be led `[m]`, and the longest displacement: far beyond
/// any cloth, near enough for f64 to tell micrometres.
const FARTHEST: f64 = 1e6;
const DISPLACEMENT: &str = "finite and at most 1e6 m long";

/// Longest duration of one block or one keyframed motion `[s]`: a day.
const LONGEST: f64 = 86_400.0;

/// How the handles move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "kebab-case", deny_unknown_fields)]
pub enum Motion {
    /// Blocks played one after another.
    Blocks {
        /// The blocks.
        blocks: Vec<Block>,
    },
    /// Keyframes for groups of handles.
    Keyframes(KeyframeMotion),
    /// Splines of transforms for groups of handles.
    Splines(SplineMotion),
    /// One position per handle and frame.
    Recorded(RecordedMotion),
}

/// A stretch of time with parts that are added: translations and a rotation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// How long it lasts `[s]`; a whole number of frames of 1/60 s.
    pub duration: f64,
    /// Translations of all handles, added up.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub translations: Vec<Translation>,
    /// Rotation of all handles about a vertical axis that stands still during the block.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rotation: Option<Rotation>,
}

/// A translation along a direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Translation {
    /// Direction in the world; need not have length one.
    pub direction: DVec3,
    /// How far or how fast.
    pub pace: Pace,
}

/// A rotation of all handles about a vertical axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Where the axis meets the handles' line at the start of the block: -1 = first handle,
    /// +1 = last, 0 = the middle, 2 = half their distance outside.
    pub center: f64,
    /// Which way, seen from above.
    pub sense: TurnSense,
    /// Arc of the handle that is farthest from the axis `[m]`, or its speed.
    pub arc: Pace,
}

/// Which way a rotation turns, seen from above.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TurnSense {
    /// A positive angle about +y.
    CounterClockwise,
    /// A negative angle about +y.
    Clockwise,
}

/// Keyframes for groups of handles; a handle in no group stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyframeMotion {
    /// How long the motion lasts `[s]`; a whole number of frames of 1/60 s.
    pub duration: f64,
    /// The groups.
    pub groups: Vec<KeyframeGroup>,
}

/// Handles that move rigidly together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyframeGroup {
    /// Numbers in the list of handles, from 0.
    pub handles: Vec<usize>,
    /// Direction of the axis through the group's start centroid about which keyframes turn it; need
    /// not have length one.
    #[serde(default = "upwards", skip_serializing_if = "is_upwards")]
    pub axis: DVec3,
    /// Keyframes in order of time; smooth (cubic Hermite, level at both ends) between them. The
    /// group starts from where it stands, as if a keyframe without displacement stood at time 0.
    pub keyframes: Vec<Keyframe>,
}

/// Where a group is at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Time `[s]`.
    pub time: f64,
    /// Displacement from the start `[m]`.
    #[serde(default)]
    pub translation: DVec3,
    /// Right-handed angle about the group's axis `[degrees]`; may be more than a turn.
    #[serde(default)]
    pub rotation_deg: f64,
}

/// Splines of transforms for groups of handles; a handle in no group stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplineMotion {
    /// How long the motion lasts `[s]`.
    pub duration: f64,
    /// When the handles are where the mesh has them `[s]`: their transform at that time leaves them
    /// there.
    #[serde(default)]
    pub taken: f64,
    /// The groups.
    pub groups: Vec<SplineGroup>,
}

/// Handles that go with one spline.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SplineGroup {
    /// Numbers in the list of handles, from 0.
    pub handles: Vec<usize>,
    /// Keyframes in order of time; smooth between them.
    pub keyframes: Vec<PoseKeyframe>,
}

/// A transform of the world at a time: scaled, then turned about the origin, then moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PoseKeyframe {
    /// Time `[s]`.
    pub time: f64,
    /// Factor.
    #[serde(default = "one")]
    pub scale: f64,
    /// Axis of the turn; need not have length one.
    #[serde(default = "up")]
    pub axis: DVec3,
    /// Right-handed angle about the axis `[degrees]`. What counts is the rotation, not the turns: from
    /// one keyframe to the next it goes the shorter way.
    #[serde(default)]
    pub angle_deg: f64,
    /// Displacement `[m]`.
    #[serde(default)]
    pub translation: DVec3,
}

fn one() -> f64 {
    1.0
}

fn up() -> DVec3 {
    DVec3::Y
}

/// One position per handle and frame of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedMotion {
    /// Positions `[m]`, `[frames + 1][handles]`; the first is where the handles start.
    pub positions: Vec<Vec<DVec3>>,
}

/// Why a motion cannot drive the handles.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum MotionError {
    #[error("motion: {field} must be {expected}, found {found}")]
    Value {
        field: String,
        expected: &'static str,
        found: String,
    },
    #[error("motion: {what} needs at least {needed} handles, found {found}")]
    TooFewHandles {
        what: &'static str,
        needed: usize,
        found: usize,
    },
    #[error("motion: frame {frame} has positions for {found} handles, the scene has {expected}")]
    HandleCount {
        frame: usize,
        expected: usize,
        found: usize,
    },
    #[error(
        "motion: the position of handle {handle} in frame {frame} must be finite and at most 1e6 m from the origin, found {position}"
    )]
    Position {
        frame: usize,
        handle: usize,
        position: DVec3,
    },
    #[error(
        "motion: the recording starts with handle {handle} at {found}, {millimetres:.3} mm from where it stands in the scene, {expected} (1 mm is allowed): move the mesh or the recording"
    )]
    Start {
        handle: usize,
        expected: DVec3,
        found: DVec3,
        millimetres: f64,
    },
    #[error(
        "motion: groups[{group}] names handle {handle}, but the scene has {handle_count} handles (numbered from 0)"
    )]
    HandleOutOfRange {
        group: usize,
        handle: usize,
        handle_count: usize,
    },
    #[error("motion: handle {handle} is named by groups[{first}] and again by groups[{second}]")]
    HandleRepeated {
        handle: usize,
        first: usize,
        second: usize,
    },
}

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
    /// No motion for `duration` `[s]`.
    #[must_use]
    pub fn still(duration: f64) -> Self {
        Self::Blocks {
            blocks: vec![Block::still(duration)],
        }
    }

    /// The same motion `factor` times as fast: every block goes so many times as far in its time. None
    /// where it is not made of blocks, whose places are given and not how far they are apart.
    #[must_use]
    pub fn at_speed(&self, factor: f64) -> Option<Self> {
        let Self::Blocks { blocks } = self else {
            return None;
        };
        let mut blocks = blocks.clone();
        for block in &mut blocks {
            for part in &mut block.translations {
                part.pace = part.pace.times(factor);
            }
            if let Some(rotation) = &mut block.rotation {
                rotation.arc = rotation.arc.times(factor);
            }
        }
        Some(Self::Blocks { blocks })
    }

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
            return Err(value_error(field, "finite", start[handle].to_string()));
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

impl Block {
    /// No motion for `duration` `[s]`.
    #[must_use]
    pub fn still(duration: f64) -> Self {
        Self {
            duration,
            translations: Vec::new(),
            rotation: None,
        }
    }
}

fn upwards() -> DVec3 {
    DVec3::Y
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_upwards(axis: &DVec3) -> bool {
    *axis == DVec3::Y
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

fn value_error(field: impl Into<String>, expected: &'static str, found: String) -> MotionError {
    MotionError::Value {
        field: field.into(),
        expected,
        found,
    }
}

/// The frames of 1/60 s in `duration` `[s]`, which must be a whole number of them, one at least.
fn whole_frames(field: impl Into<String>, duration: f64) -> Result<usize, MotionError> {
    let frames = duration * MOTION_RATE;
    // Eight digits of a duration such as 1/3 s are enough; 0.333 s is not meant to be 20 frames.
    let whole = (frames - frames.round()).abs() < 1e-6 && frames.round() >= 1.0;
    if whole && duration <= LONGEST {
        return Ok(frames.round() as usize);
    }
    let expected = "a whole number of frames of 1/60 s, at least one, and at most a day";
    let found = format!("{duration} s, which is {frames} frames");
    Err(value_error(field, expected, found))
}

/// Frames of a scene that cover `frames` of 1/60 s.
fn scene_frames(frames: f64, frame_rate: f64) -> usize {
    // 1e-6: a quotient that is whole but for rounding needs no frame more.
    (frames / MOTION_RATE * frame_rate - 1e-6).ceil() as usize
}

/// The sample before `place` (in samples, from 0) and the fraction from it to the next. A place
/// that is whole but for rounding is whole, so that samples are read as they are.
fn split_place(place: f64, last: usize) -> (usize, f64) {
    let place = place.clamp(0.0, last as f64);
    let nearest = place.round();
    if (place - nearest).abs() < 1e-9 * nearest.max(1.0) {
        (nearest as usize, 0.0)
    } else {
        (place.floor() as usize, place.fract())
    }
}

/// `point` turned by `angle` `[rad]` about the vertical axis through `axis`.
fn turned(point: DVec3, axis: DVec3, angle: f64) -> DVec3 {
    let (sin, cos) = angle.sin_cos();
    let (x, z) = (point.x - axis.x, point.z - axis.z);
    DVec3::new(
        axis.x + x * cos + z * sin,
        point.y,
        axis.z - x * sin + z * cos,
    )
}

#[cfg(test)]
mod tests;
