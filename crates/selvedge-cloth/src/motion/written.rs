//! The forms in which people write motions, and their TOML.

use glam::DVec3;
use serde::{Deserialize, Serialize};

use super::pace::Pace;

/// A motion of the handles.
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
    /// Duration `[s]`; a whole number of frames of 1/60 s.
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
    /// Distance or speed.
    pub pace: Pace,
}

/// A rotation of all handles about a vertical axis.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotation {
    /// Place at which the axis meets the handles' line at the start of the block: -1 = first
    /// handle, +1 = last, 0 = the middle, 2 = half their distance outside.
    pub center: f64,
    /// Sense of the turn, seen from above.
    pub sense: TurnSense,
    /// Arc of the handle that is farthest from the axis `[m]`, or its speed.
    pub arc: Pace,
}

/// Sense of a rotation, seen from above.
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
    /// Duration of the motion `[s]`; a whole number of frames of 1/60 s.
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

/// The place of a group at a time.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
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
    /// Duration of the motion `[s]`.
    pub duration: f64,
    /// Time at which the handles are where the mesh has them `[s]`: their transform at that time
    /// leaves them there.
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
    #[serde(default = "upwards")]
    pub axis: DVec3,
    /// Right-handed angle about the axis `[degrees]`. What counts is the rotation, not the turns:
    /// from one keyframe to the next it goes the shorter way.
    #[serde(default)]
    pub angle_deg: f64,
    /// Displacement `[m]`.
    #[serde(default)]
    pub translation: DVec3,
}

/// One position per handle and frame of the scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RecordedMotion {
    /// Positions `[m]`, `[frames + 1][handles]`; the first is where the handles start.
    pub positions: Vec<Vec<DVec3>>,
}

impl Motion {
    /// No motion for `duration` `[s]`.
    pub fn still(duration: f64) -> Self {
        Self::Blocks {
            blocks: vec![Block::still(duration)],
        }
    }

    /// The same motion `factor` times as fast: every block goes so many times as far in its time.
    /// Returns none for a motion that is not made of blocks: its places are given, not its moves.
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
}

impl Block {
    /// No motion for `duration` `[s]`.
    pub fn still(duration: f64) -> Self {
        Self {
            duration,
            translations: Vec::new(),
            rotation: None,
        }
    }
}

fn one() -> f64 {
    1.0
}

fn upwards() -> DVec3 {
    DVec3::Y
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_upwards(axis: &DVec3) -> bool {
    *axis == upwards()
}
