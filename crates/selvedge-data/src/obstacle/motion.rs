//! Motion of an obstacle: keyframes, a node of a rig, or its points as a file has them.

use std::fmt::Display;
use std::path::Path;

use glam::{DMat3, DMat4, DVec3};
use selvedge_cloth::geometry;
use selvedge_cloth::{
    Keyframe, KeyframeGroup, KeyframeMotion, Motion, ObstaclePath, PoseKeyframe, RigidKey,
    SplineGroup, SplineMotion,
};
use serde::{Deserialize, Serialize};

use super::body::BodySpec;
use super::read::{self, Frames, Kind, moving_points};
use crate::rig::Rig;

/// Longest motion by keyframes `[s]`, as of handles.
const LONGEST: f64 = 86_400.0;

/// Motion of an obstacle, resolved. Before it begins and after it ends the obstacle rests.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum ObstacleMotion {
    /// No motion.
    #[default]
    Still,
    /// Rigid motion from keyframe to keyframe.
    Keyframes(ObstacleKeyframes),
    /// Transforms of the world along splines, as ARCSim moves its obstacles.
    Splines(Vec<PoseKeyframe>),
    /// Rigid motion with a node of a file.
    Node(NodeFile),
    /// Every point as a file says.
    Points(FramesFile),
}

/// Keyframes of an obstacle: smooth (level at each) between them, relative to where it is placed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleKeyframes {
    /// Direction of the axis of its turns; need not have length one.
    #[serde(default = "crate::formats::up_axis::up")]
    pub axis: DVec3,
    /// A point of that axis `[m]`; the mean of the obstacle's points where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub centre: Option<DVec3>,
    /// Places over time.
    pub keyframes: Vec<Keyframe>,
}

/// A node that an obstacle follows from where it is placed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NodeFile {
    /// Path of the .glb or USD file, relative to the scene's folder.
    pub path: String,
    /// BLAKE3 hash of its bytes, in hexadecimal.
    pub blake3: String,
    /// Name of the node.
    pub node: String,
}

/// A file with the points of an obstacle over time.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FramesFile {
    /// Path of the file, relative to the scene's folder.
    pub path: String,
    /// BLAKE3 hash of its bytes in hexadecimal.
    pub blake3: String,
    /// Frames per second of a file that does not say it; the scene's where none are given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rate: Option<f64>,
    /// Name of the animation in a .glb that has several.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub animation: Option<String>,
    /// Seconds of the motion that are left out at its beginning.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub from: f64,
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_zero(value: &f64) -> bool {
    *value == 0.0
}

impl ObstacleMotion {
    pub(super) fn is_still(&self) -> bool {
        *self == Self::Still
    }

    /// The file that moves it, if there is one that is not shipped.
    pub(super) fn file(&self) -> Option<&str> {
        match self {
            Self::Node(file) => Some(&file.path),
            Self::Points(file) if read::shipped(&file.path).is_none() => Some(&file.path),
            _ => None,
        }
    }

    /// The points in every frame, before the obstacle is placed, if a file has them.
    pub(super) fn frames(
        &self,
        body: &BodySpec,
        folder: &Path,
        frame_rate: f64,
    ) -> Result<Option<Frames>, String> {
        let Self::Points(file) = self else {
            return Ok(None);
        };
        if !matches!(body, BodySpec::Mesh { .. }) {
            let problem = "points of a file move a mesh from a file: give mesh, or keyframes";
            return Err(wrong(problem));
        }
        file.frames(folder, frame_rate).map(Some)
    }

    /// The path of an obstacle that no points of a file move.
    pub(super) fn path(
        &self,
        points: &[DVec3],
        folder: &Path,
        frame_rate: f64,
    ) -> Result<ObstaclePath, String> {
        match self {
            Self::Still | Self::Points(_) => Ok(ObstaclePath::Still),
            Self::Keyframes(keyframes) => keyframes.path(points, frame_rate),
            Self::Splines(keyframes) => splines(keyframes, points, frame_rate),
            Self::Node(node) => node.path(folder, frame_rate),
        }
    }
}

impl FramesFile {
    fn frames(&self, folder: &Path, frame_rate: f64) -> Result<Frames, String> {
        if let Some(rate) = self.rate.filter(|rate| !(1e-3..=1e5).contains(rate)) {
            let problem = format!("rate must be between 0.001 and 100000, found {rate}");
            return Err(wrong(problem));
        }
        if !(self.from.is_finite() && self.from >= 0.0) {
            let problem = format!("from must not be negative, found {}", self.from);
            return Err(wrong(problem));
        }
        let rate = self.rate.unwrap_or(frame_rate);
        let within = |problem: String| wrong(format!("{}: {problem}", self.path));
        let has_times = matches!(Kind::of(&self.path), Some(Kind::Rig(_)));
        if has_times && self.rate.is_some() {
            return Err(within("it has times, leave rate out".to_owned()));
        }
        let bytes = read::unchanged("motion", &self.path, &self.blake3, folder)?;
        let animation = self.animation.as_deref();
        moving_points(&self.path, &bytes, animation, self.from, rate).map_err(within)
    }
}

impl ObstacleKeyframes {
    fn path(&self, points: &[DVec3], frame_rate: f64) -> Result<ObstaclePath, String> {
        let mean = points.iter().sum::<DVec3>() / points.len().max(1) as f64;
        let centre = self.centre.unwrap_or(mean);
        let last = self.keyframes.last().map_or(0.0, |keyframe| keyframe.time);
        let marks = marks(centre);
        let motion = Motion::Keyframes(KeyframeMotion {
            // A whole number of frames of 1/60 s, as motions of handles have it.
            duration: ((last * 60.0).ceil().max(1.0)) / 60.0,
            groups: vec![KeyframeGroup {
                handles: (0..marks.len()).collect(),
                axis: self.axis,
                keyframes: self.keyframes.clone(),
            }],
        });
        let path = motion.bind(&marks, frame_rate).map_err(wrong)?;
        let times = times(last, frame_rate);
        Ok(rigid(times, |time| transform(centre, &path.at(time))))
    }
}

impl NodeFile {
    fn path(&self, folder: &Path, frame_rate: f64) -> Result<ObstaclePath, String> {
        read::unchanged("motion", &self.path, &self.blake3, folder)?;
        let nodes = [self.node.clone()];
        let frames = Rig::read_motion(&folder.join(&self.path), None, &nodes, frame_rate);
        let frames = frames.map_err(wrong)?.concat();
        let is_scaled = |m: &DMat4| (m.determinant().cbrt() - 1.0).abs() > 1e-3;
        if frames.iter().any(is_scaled) {
            let problem = format!(
                "{}: node {:?} is scaled: obstacles that follow a node are rigid, bake the points instead",
                self.path, self.node
            );
            return Err(wrong(problem));
        }
        let times = (0..frames.len()).map(|frame| frame as f64 / frame_rate);
        let mut frames = frames.iter();
        Ok(rigid(times, |_| frames.next().copied().unwrap_or_default()))
    }
}

/// The path of transforms of the world: rigid where nothing is scaled, else point by point.
fn splines(
    keyframes: &[PoseKeyframe],
    points: &[DVec3],
    frame_rate: f64,
) -> Result<ObstaclePath, String> {
    let (Some(first), Some(last)) = (keyframes.first(), keyframes.last()) else {
        return Err(wrong("needs at least one keyframe"));
    };
    // A motion of handles is relative to the transform when they are taken; here it is not.
    let turn = geometry::turn(
        first.axis.normalize_or(DVec3::Y),
        first.angle_deg.to_radians(),
    );
    let start = marks(DVec3::ZERO).map(|p| first.translation + turn * p * first.scale);
    let motion = Motion::Splines(SplineMotion {
        duration: last.time.clamp(1.0 / frame_rate, LONGEST),
        taken: first.time,
        groups: vec![SplineGroup {
            handles: (0..start.len()).collect(),
            keyframes: keyframes.to_vec(),
        }],
    });
    let path = motion.bind(&start, frame_rate).map_err(wrong)?;
    let place = |time| transform(DVec3::ZERO, &path.at(time));
    let times = times(last.time, frame_rate);
    if keyframes.iter().all(|k| k.scale == 1.0) {
        return Ok(rigid(times, place));
    }
    let frame = |time| {
        let place = place(time);
        points.iter().map(|p| place.transform_point3(*p)).collect()
    };
    Ok(ObstaclePath::Points {
        frame_rate,
        frames: times.map(frame).collect(),
    })
}

pub(super) fn wrong(problem: impl Display) -> String {
    format!("motion: {problem}")
}

/// Times of all frames until `last` `[s]`.
fn times(last: f64, frame_rate: f64) -> impl Iterator<Item = f64> {
    let steps = (last.clamp(0.0, LONGEST) * frame_rate - 1e-9).ceil() as usize;
    (0..=steps).map(move |frame| frame as f64 / frame_rate)
}

/// Points that tell the place of a body: two on each axis, a metre from a centre.
fn marks(centre: DVec3) -> [DVec3; 6] {
    let [x, y, z] = DVec3::AXES;
    [x, -x, y, -y, z, -z].map(|arm| centre + arm)
}

/// The transform that takes the marks about `centre` to `places`.
fn transform(centre: DVec3, places: &[DVec3]) -> DMat4 {
    let axis = |k: usize| 0.5 * (places[2 * k] - places[2 * k + 1]);
    let turned = DMat3::from_cols(axis(0), axis(1), axis(2));
    let middle = places.iter().sum::<DVec3>() / places.len() as f64;
    DMat4::from_translation(middle - turned * centre) * DMat4::from_mat3(turned)
}

/// The path of a rigid body that is so placed at these times.
fn rigid(times: impl Iterator<Item = f64>, mut place: impl FnMut(f64) -> DMat4) -> ObstaclePath {
    let key = |time| {
        let (_, rotation, translation) = place(time).to_scale_rotation_translation();
        RigidKey {
            time,
            rotation: rotation.normalize(),
            translation,
        }
    };
    ObstaclePath::Rigid(times.map(key).collect())
}
