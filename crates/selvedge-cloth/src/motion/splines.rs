//! Motion along splines of similarity transforms, as ARCSim (Narain et al. 2012) moves its handles.
//!
//! A keyframe is a transform x → translation + scale · rotation x of the world. Between keyframes
//! each of its numbers (those of the rotation as a unit quaternion, made one again afterwards)
//! follows the cubic Hermite curve whose slope at an inner keyframe is that between its two
//! neighbours and zero at the first and the last. `[eq:spline]` Before the first keyframe and after
//! the last the transform stays. A handle is taken where it starts, at time `taken`, and goes
//! rigidly with the transform from then: x(t) = T(t) T(taken)⁻¹ x.

use glam::{DQuat, DVec3, DVec4};

use super::bounds::{DISPLACEMENT, FARTHEST, LONGEST};
use super::keyframes::claim_handles;
use super::written::{PoseKeyframe, SplineMotion};
use crate::error::{SceneError, must, require, require_positive};
use crate::geometry::turn;

/// Splines bound to handles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SplinePath {
    /// Start positions, taken back by T(taken)⁻¹.
    origins: Vec<DVec3>,
    /// Handles, and the spline that they follow.
    groups: Vec<(Vec<usize>, Spline)>,
}

#[derive(Clone, Debug, PartialEq)]
struct Spline {
    points: Vec<Point>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Point {
    time: f64,
    pose: Pose,
    /// Change of the pose per second.
    slope: Pose,
}

/// A transform, or a difference of transforms.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Pose {
    scale: f64,
    rotation: DVec4,
    translation: DVec3,
}

impl SplinePath {
    pub(super) fn new(motion: &SplineMotion, start: &[DVec3]) -> Result<Self, SceneError> {
        let (duration, taken) = (motion.duration, motion.taken);
        let holds = duration > 0.0 && duration <= LONGEST;
        require(holds, "duration", "positive and at most a day", duration)?;
        require(taken.is_finite(), "taken", "finite", taken)?;
        let mut owner: Vec<Option<usize>> = vec![None; start.len()];
        let mut origins = start.to_vec();
        let mut groups = Vec::with_capacity(motion.groups.len());
        for (number, group) in motion.groups.iter().enumerate() {
            claim_handles(number, &group.handles, &mut owner)?;
            let spline = Spline::new(number, &group.keyframes)?;
            let taken = spline.at(taken);
            for &handle in &group.handles {
                origins[handle] = taken.take_back(start[handle]);
            }
            groups.push((group.handles.clone(), spline));
        }
        Ok(Self { origins, groups })
    }

    /// Positions at `time` `[s]`.
    pub(super) fn at(&self, time: f64) -> Vec<DVec3> {
        let mut places = self.origins.clone();
        for (handles, spline) in &self.groups {
            let pose = spline.at(time);
            for &handle in handles {
                places[handle] = pose.apply(places[handle]);
            }
        }
        places
    }
}

impl Spline {
    fn new(group: usize, keyframes: &[PoseKeyframe]) -> Result<Self, SceneError> {
        if keyframes.is_empty() {
            let field = format!("groups[{group}].keyframes");
            return Err(must(field, "at least one keyframe", "none"));
        }
        let mut points: Vec<Point> = Vec::with_capacity(keyframes.len());
        for (k, keyframe) in keyframes.iter().enumerate() {
            let mut pose = check_pose(group, k, keyframe)?;
            if let Some(last) = points.last() {
                let (time, expected) = (keyframe.time, "later than the keyframe before");
                let field = format!("groups[{group}].keyframes[{k}].time");
                require(time > last.time, field, expected, time)?;
                // q and -q are the same rotation: the nearer one is meant.
                if last.pose.rotation.dot(pose.rotation) < 0.0 {
                    pose.rotation = -pose.rotation;
                }
            }
            points.push(Point {
                time: keyframe.time,
                pose,
                slope: Pose::ZERO,
            });
        }
        for k in 1..points.len().saturating_sub(1) {
            let (before, after) = (points[k - 1], points[k + 1]);
            let change = Pose::sum([(after.pose, 1.0), (before.pose, -1.0)]);
            points[k].slope = Pose::sum([(change, 1.0 / (after.time - before.time))]);
        }
        Ok(Self { points })
    }

    fn at(&self, time: f64) -> Pose {
        let after = self.points.partition_point(|point| point.time <= time);
        let pose = match (after.checked_sub(1), self.points.get(after)) {
            (Some(before), Some(to)) => between(&self.points[before], to, time),
            (Some(last), None) => self.points[last].pose,
            (None, _) => self.points[0].pose,
        };
        Pose {
            rotation: pose.rotation.normalize_or(DVec4::W),
            ..pose
        }
    }
}

fn between(from: &Point, to: &Point, time: f64) -> Pose {
    let span = to.time - from.time;
    let s = (time - from.time) / span;
    let (squared, cubed) = (s * s, s * s * s);
    Pose::sum([
        (from.pose, 2.0 * cubed - 3.0 * squared + 1.0),
        (to.pose, -2.0 * cubed + 3.0 * squared),
        (from.slope, (cubed - 2.0 * squared + s) * span),
        (to.slope, (cubed - squared) * span),
    ])
}

impl Pose {
    const ZERO: Self = Self {
        scale: 0.0,
        rotation: DVec4::ZERO,
        translation: DVec3::ZERO,
    };

    fn sum<const N: usize>(terms: [(Self, f64); N]) -> Self {
        terms.iter().fold(Self::ZERO, |sum, (pose, weight)| Self {
            scale: sum.scale + pose.scale * weight,
            rotation: sum.rotation + pose.rotation * *weight,
            translation: sum.translation + pose.translation * *weight,
        })
    }

    fn apply(&self, point: DVec3) -> DVec3 {
        self.translation + DQuat::from_vec4(self.rotation) * point * self.scale
    }

    fn take_back(&self, point: DVec3) -> DVec3 {
        DQuat::from_vec4(self.rotation).inverse() * (point - self.translation) / self.scale
    }
}

fn check_pose(group: usize, k: usize, keyframe: &PoseKeyframe) -> Result<Pose, SceneError> {
    let &PoseKeyframe {
        time,
        scale,
        axis,
        angle_deg,
        translation,
    } = keyframe;
    let field = |key: &str| format!("groups[{group}].keyframes[{k}].{key}");
    require(time.is_finite(), field("time"), "finite", time)?;
    require_positive(field("scale"), scale)?;
    let holds = (0.0..=FARTHEST).contains(&translation.length());
    require(holds, field("translation"), DISPLACEMENT, translation)?;
    let holds = angle_deg.is_finite();
    require(holds, field("angle_deg"), "finite", angle_deg)?;
    let unit = axis.try_normalize();
    let unit = unit.ok_or_else(|| must(field("axis"), "a direction", axis))?;
    Ok(Pose {
        scale,
        rotation: DVec4::from(turn(unit, angle_deg.to_radians())),
        translation,
    })
}
