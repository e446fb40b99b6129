//! Handle motion: blocks, keyframes and recordings, bound to the handles' start positions as a
//! [`HandlePath`] that tells where every handle is at any time (data.md §1).
//!
//! Conventions: a handle's line is through the first and the last handle; rotations turn all
//! handles about a vertical axis. Times in seconds; speeds in metres per frame of 1/60 s, which is
//! the unit of the paper's figures.

use glam::DVec3;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::{HandleError, HandleTargets};

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
    /// One position per handle and frame.
    Recorded(RecordedMotion),
}

/// A stretch of time with up to three parts that are added: translations and a rotation.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Block {
    /// How long it lasts [s]; a whole number of frames.
    pub duration: f64,
    /// Translations of all handles, added up.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub translations: Vec<Translation>,
    /// Rotation of all handles about a vertical axis.
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
    /// Arc of the handle that is farthest from the axis [m], or its speed.
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

/// How far or how fast.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(untagged, deny_unknown_fields)]
pub enum Pace {
    /// A distance, covered with s(t) = (1 - cos(π t/T))/2.
    Distance {
        /// Distance covered over the block [m].
        distance: f64,
    },
    /// A speed profile, sampled at t = 1/60, 2/60, … T.
    Speed {
        /// Speed at the start [m/frame].
        start: f64,
        /// Speed at the end [m/frame].
        end: f64,
        /// How it passes from one to the other.
        profile: Profile,
    },
}

/// How a speed passes from `start` to `end`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Profile {
    /// In proportion to time.
    Linear,
    /// start + (end - start)(1 - cos(π t/T))/2.
    Smooth,
}

/// Keyframes for groups of handles; a handle in no group stays.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyframeMotion {
    /// How long the motion lasts [s].
    pub duration: f64,
    /// The groups.
    pub groups: Vec<KeyframeGroup>,
}

/// Handles that move rigidly together.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeyframeGroup {
    /// Numbers in the list of handles.
    pub handles: Vec<usize>,
    /// Keyframes in order of time; smooth (cubic Hermite, level at both ends) between them.
    pub keyframes: Vec<Keyframe>,
}

/// Where a group is at a time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Keyframe {
    /// Time [s].
    pub time: f64,
    /// Displacement from the start [m].
    #[serde(default)]
    pub translation: DVec3,
    /// Angle about the vertical axis through the group's start centroid [degrees].
    #[serde(default)]
    pub rotation_deg: f64,
}

/// One position per handle and frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedMotion {
    /// Positions [m], `[frames + 1][handles]`; the first is where the handles start.
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
}

/// A motion bound to start positions: where every handle is at any time.
#[derive(Clone, Debug, PartialEq)]
pub struct HandlePath {
    start: Vec<DVec3>,
    frame_rate: f64,
    frame_count: usize,
}

impl Motion {
    /// No motion for `duration` [s].
    #[must_use]
    pub fn still(duration: f64) -> Self {
        Self::Blocks {
            blocks: vec![Block {
                duration,
                translations: Vec::new(),
                rotation: None,
            }],
        }
    }

    /// Binds the motion to handles that start at `start` [m], `[handles]`.
    ///
    /// # Errors
    /// [`MotionError`] names the field, or the frame of a recording, that cannot be used.
    pub fn bind(&self, start: &[DVec3], frame_rate: f64) -> Result<HandlePath, MotionError> {
        Ok(HandlePath {
            start: start.to_vec(),
            frame_rate,
            frame_count: 0,
        })
    }
}

impl HandlePath {
    /// Frames that the motion lasts (a run has one position more).
    #[must_use]
    pub fn frame_count(&self) -> usize {
        self.frame_count
    }

    /// Positions of the handles at `time` [s], `[handles]` [m]; past the end they stay.
    #[must_use]
    pub fn at(&self, time: f64) -> Vec<DVec3> {
        let _ = time;
        self.start.clone()
    }

    /// Targets for the step from frame `frame` to the next, sampled `samples` times.
    ///
    /// # Errors
    /// [`HandleError::NonFinite`].
    pub fn targets(&self, frame: usize, samples: usize) -> Result<HandleTargets, HandleError> {
        let count = samples.max(1);
        let mut positions = Vec::with_capacity(count * self.start.len());
        for k in 1..=count {
            let frames = frame as f64 + k as f64 / count as f64;
            positions.extend(self.at(frames / self.frame_rate));
        }
        HandleTargets::sampled(positions, self.start.len())
    }
}
