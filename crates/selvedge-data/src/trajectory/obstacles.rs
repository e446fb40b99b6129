//! Obstacles of a trajectory: bodies beside the cloth, in every frame of it.

use std::borrow::Cow;

use glam::{DVec3, Quat, Vec3};
use selvedge_cloth::{Obstacle, ObstaclePath};

use crate::formats::file_error::Problem;

/// A body over the frames of a trajectory. Positions are in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct ObstacleTrack {
    pub(super) name: String,
    pub(super) faces: Vec<[u32; 3]>,
    pub(super) motion: TrackMotion,
}

/// Places of a body's points.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum TrackMotion {
    /// Points by the frame; of one frame where they never move.
    Points(Vec<Vec<Vec3>>),
    /// The same points, placed in every frame.
    Rigid(Vec<Vec3>, Vec<Pose>),
}

/// A place of a rigid body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Pose {
    pub(crate) rotation: Quat,
    pub(crate) translation: Vec3,
}

impl Pose {
    fn apply(&self, point: Vec3) -> Vec3 {
        // In double precision: the rounding of a frame must not depend on where a body is kept.
        let turned = self.rotation.as_dquat().normalize() * point.as_dvec3();
        (turned + self.translation.as_dvec3()).as_vec3()
    }
}

impl ObstacleTrack {
    /// The track of `obstacle` over `frames` frames at `frame_rate` `[1/s]`, the first at the time
    /// of frame `first`.
    pub fn of(obstacle: &Obstacle, frame_rate: f64, first: usize, frames: usize) -> Self {
        let time = |frame: usize| (first + frame) as f64 / frame_rate;
        let at = |time: f64| rounded(obstacle.positions_at(time));
        let motion = match obstacle.path() {
            _ if obstacle.is_still() => TrackMotion::Points(vec![at(0.0)]),
            ObstaclePath::Rigid(keys) => {
                let start = &keys[0];
                // Where the first key holds, its inverse brings the points back to the body's own.
                let own = |p: DVec3| start.rotation.inverse() * (p - start.translation);
                let points = rounded(obstacle.positions_at(start.time).map(own));
                let pose = |frame: usize| {
                    let (rotation, translation) = obstacle.rigid_place(time(frame));
                    Pose {
                        rotation: rotation.as_quat(),
                        translation: translation.as_vec3(),
                    }
                };
                TrackMotion::Rigid(points, (0..frames).map(pose).collect())
            }
            _ => TrackMotion::Points((0..frames).map(|frame| at(time(frame))).collect()),
        };
        Self {
            name: obstacle.name().to_owned(),
            faces: obstacle.faces().to_vec(),
            motion,
        }
    }

    /// The track of a body whose points are at `frames` `[m]`, `[frames][points]`; still where they
    /// are the same in all.
    ///
    /// # Panics
    /// When there is no frame.
    pub fn of_frames(name: String, faces: Vec<[u32; 3]>, mut frames: Vec<Vec<Vec3>>) -> Self {
        if frames.iter().all(|frame| *frame == frames[0]) {
            frames.truncate(1);
        }
        Self {
            name,
            faces,
            motion: TrackMotion::Points(frames),
        }
    }

    /// Name of the obstacle.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Corners of every face, `[faces, 3]`.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Number of points.
    pub fn point_count(&self) -> usize {
        match &self.motion {
            TrackMotion::Rigid(points, _) => points.len(),
            TrackMotion::Points(frames) => frames.first().map_or(0, Vec::len),
        }
    }

    /// Returns true if it never moves.
    pub fn is_still(&self) -> bool {
        matches!(&self.motion, TrackMotion::Points(frames) if frames.len() == 1)
    }

    /// Positions in frame `index` `[m]`, `[points]`; in the last one it has where there is none of
    /// this number.
    pub fn frame(&self, index: usize) -> Cow<'_, [Vec3]> {
        match &self.motion {
            TrackMotion::Rigid(points, poses) => {
                let pose = poses[index.min(poses.len() - 1)];
                Cow::Owned(points.iter().map(|p| pose.apply(*p)).collect())
            }
            TrackMotion::Points(frames) => Cow::Borrowed(&frames[index.min(frames.len() - 1)]),
        }
    }

    /// Points of a rigid body that moves, before it is placed `[m]`, and its place in every frame.
    pub(crate) fn rigid(&self) -> Option<(&[Vec3], &[Pose])> {
        match &self.motion {
            TrackMotion::Rigid(points, poses) => Some((points, poses)),
            TrackMotion::Points(_) => None,
        }
    }

    /// Checks that it has `frames` frames, finite, of the same points, which the faces name.
    pub(super) fn check(&self, frames: usize) -> Result<(), Problem> {
        let name = &self.name;
        let wrong = |problem: String| Problem(format!("obstacle {name:?}: {problem}"));
        let is_sound = |pose: &Pose| {
            let length = pose.rotation.length();
            pose.translation.is_finite() && (length - 1.0).abs() < 1e-3
        };
        let all_finite = |points: &Vec<Vec3>| points.iter().all(|p| p.is_finite());
        let points = self.point_count();
        let (found, is_finite) = match &self.motion {
            TrackMotion::Points(frames) => (frames.len(), frames.iter().all(all_finite)),
            TrackMotion::Rigid(points, poses) => {
                let is_finite = all_finite(points) && poses.iter().all(is_sound);
                (poses.len(), is_finite)
            }
        };
        if found != frames && !self.is_still() {
            return Err(wrong(format!("has {found} frames, the cloth has {frames}")));
        }
        let corners = self.faces.as_flattened().iter();
        if let Some(beyond) = corners.copied().find(|&p| p as usize >= points) {
            return Err(wrong(format!("a face names point {beyond} of {points}")));
        }
        if let TrackMotion::Points(frames) = &self.motion
            && let Some(other) = frames.iter().find(|frame| frame.len() != points)
        {
            let found = other.len();
            return Err(wrong(format!(
                "has {found} points in a frame, and {points} in the first"
            )));
        }
        if is_finite {
            Ok(())
        } else {
            Err(wrong(
                "has a place that is not finite, or no rotation".to_owned(),
            ))
        }
    }
}

fn rounded(points: impl Iterator<Item = DVec3>) -> Vec<Vec3> {
    points.map(|p| p.as_vec3()).collect()
}
