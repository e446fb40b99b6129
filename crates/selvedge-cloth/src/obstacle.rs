//! Obstacles: bodies that the cloth touches and that do not feel it. Each is a triangle mesh that
//! is still, moves as a rigid body, or moves point by point; a sphere or a capsule is round, and its mesh
//! is only what is drawn of it.

use std::fmt::Display;

use glam::{DQuat, DVec3};

use crate::bodies::{Body, Core};
use crate::error::{SceneError, require};
use crate::geometry::{is_without_area, slerp};

/// Farthest coordinate of an obstacle `[m]`.
const FARTHEST: f64 = 1e6;

/// A body in the way of the cloth: a triangle mesh, open or closed, oriented or not, valid by
/// construction.
#[derive(Clone, Debug, PartialEq)]
pub struct Obstacle {
    name: String,
    faces: Vec<[u32; 3]>,
    points: Vec<DVec3>,
    core: Option<Core>,
    path: ObstaclePath,
    friction: f64,
    thickness: Option<f64>,
}

/// Motion of an obstacle's points over time. Before the first and after the last time it rests.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum ObstaclePath {
    /// No motion.
    #[default]
    Still,
    /// Rigid motion x(t) = R(t) x + T(t): rotations on the shortest arc, translations linear
    /// between the keys, whose times increase.
    Rigid(Vec<RigidKey>),
    /// Points at equally spaced times from 0, linear in between.
    Points {
        /// Frames per second.
        frame_rate: f64,
        /// Positions of every point `[m]`, `[frames, points]`.
        frames: Vec<Vec<DVec3>>,
    },
}

/// The place of a rigid body at a time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RigidKey {
    /// Time since the start `[s]`.
    pub time: f64,
    /// Rotation about the origin of the obstacle's own points.
    pub rotation: DQuat,
    /// Translation `[m]`.
    pub translation: DVec3,
}

impl Obstacle {
    /// An obstacle of these `points` `[m]` and `faces` among them, still, as rough as the cloth.
    ///
    /// # Errors
    /// [`SceneError`] names the first face or point that cannot be used.
    pub fn new(name: &str, points: Vec<DVec3>, faces: Vec<[u32; 3]>) -> Result<Self, SceneError> {
        let obstacle = Self {
            name: name.to_owned(),
            faces,
            points,
            core: None,
            path: ObstaclePath::Still,
            friction: f64::INFINITY,
            thickness: None,
        };
        obstacle.check_points(0, &obstacle.points)?;
        obstacle.check_faces()?;
        Ok(obstacle)
    }

    /// A body as an obstacle, as [`Self::new`]: where it is round, the cloth touches all that is within the
    /// radius of its core, and not the mesh.
    ///
    /// # Errors
    /// As for [`Self::new`].
    pub fn of(name: &str, body: Body) -> Result<Self, SceneError> {
        let obstacle = Self::new(name, body.points, body.faces)?;
        Ok(Self {
            core: body.core,
            ..obstacle
        })
    }

    /// The same obstacle on a `path`. The points of a path by points replace its own, and the mesh is
    /// what the cloth touches.
    ///
    /// # Errors
    /// [`SceneError`] names the first frame, key or point that cannot be used.
    pub fn moving(mut self, path: ObstaclePath) -> Result<Self, SceneError> {
        match &path {
            ObstaclePath::Still => {}
            ObstaclePath::Rigid(keys) => self.check_keys(keys)?,
            ObstaclePath::Points { frame_rate, frames } => {
                let holds = (1e-3..=1e5).contains(frame_rate);
                let expected = "between 0.001 and 100000 per second";
                self.require(holds, "frame_rate", expected, frame_rate)?;
                for (number, frame) in frames.iter().enumerate() {
                    self.check_points(number, frame)?;
                }
                self.require(!frames.is_empty(), "frames", "at least one", 0)?;
                self.points.clone_from(&frames[0]);
                self.core = None;
                self.check_faces()?;
            }
        }
        self.path = path;
        Ok(self)
    }

    /// The same obstacle with its own coefficient of friction; a pair has the lesser of two.
    ///
    /// # Errors
    /// [`SceneError`] for one that is negative or not a number.
    pub fn with_friction(mut self, friction: f64) -> Result<Self, SceneError> {
        self.require(friction >= 0.0, "friction", "not negative", friction)?;
        self.friction = friction;
        Ok(self)
    }

    /// The same obstacle with a thickness of its own `[m]`, in place of that of the scene.
    ///
    /// # Errors
    /// [`SceneError`] for one beyond 1e-5 to 1 m.
    pub fn with_thickness(mut self, thickness: f64) -> Result<Self, SceneError> {
        let holds = (1e-5..=1.0).contains(&thickness);
        self.require(holds, "thickness", "between 1e-5 and 1 m", thickness)?;
        self.thickness = Some(thickness);
        Ok(self)
    }

    /// The same obstacle where it is at the start, for ever.
    pub fn at_start(&self) -> Self {
        Self {
            points: self.positions_at(0.0).collect(),
            core: self.core_at(0.0),
            path: ObstaclePath::Still,
            name: self.name.clone(),
            faces: self.faces.clone(),
            ..*self
        }
    }

    /// The same obstacle, of which the cloth touches the mesh even where it is round.
    pub fn as_mesh(self) -> Self {
        Self { core: None, ..self }
    }

    /// The core, which stands still where the body does; none where it is not round.
    pub fn core(&self) -> Option<&Core> {
        self.core.as_ref()
    }

    /// Name of the obstacle.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Corners of every face, `[faces, 3]`. They stay the same.
    pub fn faces(&self) -> &[[u32; 3]] {
        &self.faces
    }

    /// Number of points. It stays the same.
    pub fn point_count(&self) -> usize {
        self.points.len()
    }

    /// The motion.
    pub fn path(&self) -> &ObstaclePath {
        &self.path
    }

    /// Coefficient of friction; infinite where the cloth alone decides.
    pub fn friction(&self) -> f64 {
        self.friction
    }

    /// Thickness `[m]`, if it has one of its own.
    pub fn thickness(&self) -> Option<f64> {
        self.thickness
    }

    /// Returns true if the obstacle never moves.
    pub fn is_still(&self) -> bool {
        match &self.path {
            ObstaclePath::Still => true,
            ObstaclePath::Rigid(keys) => keys.len() == 1,
            ObstaclePath::Points { frames, .. } => frames.len() == 1,
        }
    }

    /// Positions of the points at `time` `[s]` since the start, in metres, `[points]`.
    pub fn positions_at(&self, time: f64) -> impl ExactSizeIterator<Item = DVec3> + '_ {
        let place = match &self.path {
            ObstaclePath::Still => Place::Still(&self.points),
            ObstaclePath::Rigid(keys) => {
                let (rotation, translation) = rigid_at(keys, time);
                Place::Rigid(&self.points, rotation, translation)
            }
            ObstaclePath::Points { frame_rate, frames } => {
                let last = frames.len() - 1;
                let at = (time * frame_rate).clamp(0.0, last as f64);
                let from = (at.floor() as usize).min(last);
                let to = (from + 1).min(last);
                Place::Between(&frames[from], &frames[to], at - from as f64)
            }
        };
        (0..self.points.len()).map(move |k| place.of(k))
    }

    /// The core at `time` `[s]`; none where the body is not round.
    pub fn core_at(&self, time: f64) -> Option<Core> {
        let (turn, by) = self.rigid_place(time);
        self.core.map(|core| Core {
            ends: core.ends.map(|end| turn * end + by),
            ..core
        })
    }

    /// Rotation and translation `[m]` of a rigid body at `time` `[s]`, against its own points; none
    /// of either for one that moves otherwise.
    pub fn rigid_place(&self, time: f64) -> (DQuat, DVec3) {
        match &self.path {
            ObstaclePath::Rigid(keys) => rigid_at(keys, time),
            ObstaclePath::Still | ObstaclePath::Points { .. } => (DQuat::IDENTITY, DVec3::ZERO),
        }
    }

    fn error(&self, what: impl Display) -> SceneError {
        SceneError(format!("obstacle {:?}{what}", self.name))
    }

    fn require(
        &self,
        holds: bool,
        field: &str,
        expected: &str,
        found: impl Display,
    ) -> Result<(), SceneError> {
        let checked = require(holds, field, expected, found);
        checked.map_err(|error| self.error(format_args!(": {error}")))
    }

    fn check_points(&self, frame: usize, points: &[DVec3]) -> Result<(), SceneError> {
        let (expected, found) = (self.points.len(), points.len());
        if found != expected {
            return Err(self.error(format_args!(
                ": frame {frame} has {found} points, expected {expected} as in the mesh: the number of points must not change"
            )));
        }
        let is_far = |p: &DVec3| !(p.is_finite() && p.abs().max_element() <= FARTHEST);
        match points.iter().position(is_far) {
            None => Ok(()),
            Some(point) => Err(self.error(format_args!(
                ": point {point} of frame {frame} is not finite or more than 1e6 m from the origin: {}",
                points[point]
            ))),
        }
    }

    fn check_faces(&self) -> Result<(), SceneError> {
        if self.faces.is_empty() {
            return Err(self.error(" has no faces: it needs at least one triangle"));
        }
        let points = self.points.len();
        for (face, corners) in self.faces.iter().enumerate() {
            if let Some(point) = corners.iter().find(|p| **p as usize >= points) {
                return Err(self.error(format_args!(
                    ": face {face} names point {point}, but there are {points}"
                )));
            }
            if is_without_area(corners.map(|p| self.points[p as usize])) {
                return Err(self.error(format_args!(
                    ": face {face} has no area at the start: remove it"
                )));
            }
        }
        Ok(())
    }

    fn check_keys(&self, keys: &[RigidKey]) -> Result<(), SceneError> {
        self.require(!keys.is_empty(), "keyframes", "at least one", 0)?;
        for pair in keys.windows(2) {
            let [before, time] = [pair[0].time, pair[1].time];
            let expected = "later than the one before";
            self.require(time > before, "keyframe.time", expected, time)?;
        }
        for &RigidKey {
            time,
            rotation,
            translation,
        } in keys
        {
            let holds = translation.abs().max_element() <= FARTHEST && translation.is_finite();
            let expected = "finite and within 1e6 m";
            self.require(holds, "keyframe.translation", expected, translation)?;
            let holds = rotation.is_finite() && (rotation.length() - 1.0).abs() < 1e-6;
            let expected = "a unit quaternion";
            self.require(holds, "keyframe.rotation", expected, rotation)?;
            self.require(time.is_finite(), "keyframe.time", "finite", time)?;
        }
        Ok(())
    }
}

/// The points at a time.
enum Place<'a> {
    Still(&'a [DVec3]),
    Rigid(&'a [DVec3], DQuat, DVec3),
    Between(&'a [DVec3], &'a [DVec3], f64),
}

impl Place<'_> {
    fn of(&self, point: usize) -> DVec3 {
        match self {
            Self::Still(points) => points[point],
            Self::Rigid(points, rotation, translation) => *rotation * points[point] + *translation,
            Self::Between(from, to, part) => from[point].lerp(to[point], *part),
        }
    }
}

/// Rotation and translation at `time`.
fn rigid_at(keys: &[RigidKey], time: f64) -> (DQuat, DVec3) {
    let next = keys.partition_point(|key| key.time <= time);
    let last = keys.len() - 1;
    let (from, to) = (&keys[next.saturating_sub(1)], &keys[next.min(last)]);
    let length = to.time - from.time;
    let part = if length > 0.0 { ((time - from.time) / length).clamp(0.0, 1.0) } else { 0.0 };
    (
        slerp(from.rotation, to.rotation, part),
        from.translation.lerp(to.translation, part),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn triangle() -> Obstacle {
        let points = vec![DVec3::ZERO, DVec3::X, DVec3::Z];
        Obstacle::new("wedge", points, vec![[0, 1, 2]]).unwrap()
    }

    #[test]
    fn bad_meshes_are_named() {
        let line = [DVec3::ZERO, DVec3::X, DVec3::X * 2.0];
        let made = |points: [DVec3; 3], faces: &[[u32; 3]]| {
            Obstacle::new("a", points.to_vec(), faces.to_vec()).unwrap_err()
        };
        let frames = vec![vec![DVec3::ZERO, DVec3::X, DVec3::Z], vec![DVec3::ZERO; 2]];
        let frame_rate = 60.0;
        let far = made([DVec3::X * 1e7; 3], &[[0, 1, 2]]);
        let short = triangle().moving(ObstaclePath::Points { frame_rate, frames });
        for (error, words) in [
            (made(line, &[]), "\"a\" has no faces"),
            (
                made(line, &[[0, 1, 3]]),
                "\"a\": face 0 names point 3, but there are 3",
            ),
            (made(line, &[[0, 1, 2]]), "\"a\": face 0 has no area"),
            (far, "\"a\": point 0 of frame 0 is not finite or more than"),
            (
                short.unwrap_err(),
                "\"wedge\": frame 1 has 2 points, expected 3",
            ),
        ] {
            let text = error.to_string();
            assert!(text.starts_with(&format!("obstacle {words}")), "{text}");
        }
    }

    #[test]
    fn a_rigid_body_is_between_its_keys() {
        let key = |time: f64| RigidKey {
            time,
            rotation: DQuat::from_rotation_y(time),
            translation: DVec3::Y * time,
        };
        let moving = triangle()
            .moving(ObstaclePath::Rigid(vec![key(1.0), key(2.0)]))
            .unwrap();
        for (time, at) in [(0.0, 1.0), (1.25, 1.25), (2.0, 2.0), (9.0, 2.0)] {
            let found = moving.positions_at(time).nth(1).unwrap();
            let expected = DQuat::from_rotation_y(at) * DVec3::X + DVec3::Y * at;
            assert!(found.distance(expected) < 1e-12, "{time}");
        }
        let error = triangle().moving(ObstaclePath::Rigid(vec![key(1.0), key(1.0)]));
        let text = error.unwrap_err().to_string();
        assert!(text.contains("keyframe.time must be later"), "{text}");
    }

    #[test]
    fn points_run_straight_between_frames() {
        let frame = |y: f64| vec![DVec3::Y * y, DVec3::X, DVec3::Z];
        let path = ObstaclePath::Points {
            frame_rate: 10.0,
            frames: vec![frame(0.0), frame(1.0), frame(3.0)],
        };
        let moving = triangle().moving(path).unwrap();
        for (time, height) in [
            (-1.0, 0.0),
            (0.05, 0.5),
            (0.15, 2.0),
            (0.2, 3.0),
            (5.0, 3.0),
        ] {
            let found = moving.positions_at(time).next().unwrap().y;
            assert!((found - height).abs() < 1e-12, "{time}");
        }
    }
}
