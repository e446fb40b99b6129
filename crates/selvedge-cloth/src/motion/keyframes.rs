//! Keyframed motion: groups of handles that move rigidly from keyframe to keyframe.
//!
//! Between two keyframes translation and angle follow the cubic Hermite curve with level ends, a +
//! (b - a) s²(3 - 2s). `[eq:keyframe]` The angle turns the group about its axis, the vertical one
//! if none is given, through its centroid at the start; the translation is added. After the last
//! keyframe the group stays.

use glam::DVec3;

use super::bounds::{DISPLACEMENT, FARTHEST, turned, whole_frames};
use super::written::{Keyframe, KeyframeGroup, KeyframeMotion};
use crate::error::{SceneError, must, require};
use crate::geometry::turn;

/// Keyframes bound to handles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct KeyframePath {
    start: Vec<DVec3>,
    groups: Vec<Group>,
}

#[derive(Clone, Debug, PartialEq)]
struct Group {
    handles: Vec<usize>,
    centroid: DVec3,
    /// Axis of length one; none for the vertical.
    axis: Option<DVec3>,
    /// The first at time 0, without displacement.
    keyframes: Vec<Keyframe>,
}

impl KeyframePath {
    pub(super) fn new(motion: &KeyframeMotion, start: &[DVec3]) -> Result<Self, SceneError> {
        whole_frames("duration", motion.duration)?;
        let mut owner: Vec<Option<usize>> = vec![None; start.len()];
        let mut groups = Vec::with_capacity(motion.groups.len());
        for (number, group) in motion.groups.iter().enumerate() {
            claim_handles(number, &group.handles, &mut owner)?;
            let keyframes = check_keyframes(number, group, motion.duration)?;
            let sum: DVec3 = group.handles.iter().map(|&h| start[h]).sum();
            groups.push(Group {
                handles: group.handles.clone(),
                axis: check_axis(number, group.axis)?,
                centroid: sum / group.handles.len() as f64,
                keyframes,
            });
        }
        let start = start.to_vec();
        Ok(Self { start, groups })
    }

    /// Positions at `time` `[s]`.
    pub(super) fn at(&self, time: f64) -> Vec<DVec3> {
        let mut positions = self.start.clone();
        for group in &self.groups {
            let (translation, angle) = group.pose(time);
            for &handle in &group.handles {
                let point = positions[handle];
                positions[handle] = group.turned(point, angle) + translation;
            }
        }
        positions
    }
}

impl Group {
    /// `point` turned by `angle` `[rad]`.
    fn turned(&self, point: DVec3, angle: f64) -> DVec3 {
        match self.axis {
            None => turned(point, self.centroid, angle),
            Some(axis) => self.centroid + turn(axis, angle) * (point - self.centroid),
        }
    }

    /// Displacement `[m]` and angle `[rad]` at `time` `[s]`.
    fn pose(&self, time: f64) -> (DVec3, f64) {
        let after = self.keyframes.partition_point(|k| k.time <= time).max(1);
        let from = &self.keyframes[after - 1];
        let Some(to) = self.keyframes.get(after) else {
            return (from.translation, from.rotation_deg.to_radians());
        };
        let s = (time - from.time) / (to.time - from.time);
        let share = s * s * (3.0 - 2.0 * s);
        let angle = from.rotation_deg + (to.rotation_deg - from.rotation_deg) * share;
        let translation = from.translation.lerp(to.translation, share);
        (translation, angle.to_radians())
    }
}

/// Makes group `number` the owner of `handles`, which nobody may own yet.
pub(super) fn claim_handles(
    number: usize,
    handles: &[usize],
    owner: &mut [Option<usize>],
) -> Result<(), SceneError> {
    if handles.is_empty() {
        let field = format!("groups[{number}].handles");
        return Err(must(field, "at least one handle", "none"));
    }
    for &handle in handles {
        let handle_count = owner.len();
        let Some(owner) = owner.get_mut(handle) else {
            return Err(SceneError(format!(
                "groups[{number}] names handle {handle}, but the scene has {handle_count} handles (numbered from 0)"
            )));
        };
        if let Some(first) = owner.replace(number) {
            return Err(SceneError(format!(
                "handle {handle} is named by groups[{first}] and again by groups[{number}]"
            )));
        }
    }
    Ok(())
}

/// The group's axis with length one; none where it is the vertical.
fn check_axis(number: usize, axis: DVec3) -> Result<Option<DVec3>, SceneError> {
    if axis == DVec3::Y {
        return Ok(None);
    }
    axis.try_normalize().map(Some).ok_or_else(|| {
        let field = format!("groups[{number}].axis");
        must(field, "a direction", axis)
    })
}

/// The keyframes of a group, led by one at time 0.
fn check_keyframes(
    number: usize,
    group: &KeyframeGroup,
    duration: f64,
) -> Result<Vec<Keyframe>, SceneError> {
    let mut keyframes = vec![Keyframe::default()];
    for (k, keyframe) in group.keyframes.iter().enumerate() {
        let field = |key: &str| format!("groups[{number}].keyframes[{k}].{key}");
        let (time, angle, by) = (keyframe.time, keyframe.rotation_deg, keyframe.translation);
        let holds = (0.0..=FARTHEST).contains(&by.length());
        require(holds, field("translation"), DISPLACEMENT, by)?;
        require(angle.is_finite(), field("rotation_deg"), "finite", angle)?;
        let (holds, expected) = (
            (0.0..=duration).contains(&time),
            "between 0 and the motion's duration",
        );
        require(holds, field("time"), expected, time)?;
        let holds = k == 0 || time > keyframes[keyframes.len() - 1].time;
        require(holds, field("time"), "later than the keyframe before", time)?;
        if time > 0.0 {
            keyframes.push(*keyframe);
        } else if by != DVec3::ZERO || angle != 0.0 {
            let expected = "later than 0, or without translation and rotation: handles cannot jump";
            return Err(must(field("time"), expected, time));
        }
    }
    Ok(keyframes)
}
