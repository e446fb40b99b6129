//! An obstacle, resolved: the same spec makes the same obstacle.

use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::bodies::Body;
use selvedge_cloth::{Obstacle, ObstaclePath, SceneError};
use serde::{Deserialize, Serialize};

use super::body::{BodySpec, problem_of};
use super::motion::ObstacleMotion;
use super::weld::{drop_flat, weld};
use crate::formats::extent::{extent, unit_remedy};
use crate::formats::file_error::Problem;
use crate::scene::Rotate;

/// Length of a body from a file `[m]`; others are warned of.
const SIZES: std::ops::RangeInclusive<f64> = 0.01..=100.0;

/// A resolved obstacle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObstacleSpec {
    /// Name of the obstacle.
    pub name: String,
    /// The body before it is placed and moves.
    pub body: BodySpec,
    /// Placement of the body; of one whose points a file moves, in every frame.
    #[serde(default, skip_serializing_if = "Placement::is_none")]
    pub transform: Placement,
    /// Motion of the body.
    #[serde(default, skip_serializing_if = "ObstacleMotion::is_still")]
    pub motion: ObstacleMotion,
    /// Coefficient of friction; that of the cloth where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub friction: Option<f64>,
    /// Thickness `[m]`; that of the scene's contact where there is none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thickness: Option<f64>,
}

/// Placement of a body: scaled, then turned about the origin, then moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Placement {
    /// Multiplies the positions, as 0.01 for a file in centimetres.
    pub scale: f64,
    /// Turns them.
    pub rotation: Rotate,
    /// Moves them `[m]`.
    pub translation: DVec3,
}

impl Default for Placement {
    fn default() -> Self {
        Self {
            scale: 1.0,
            rotation: Rotate::default(),
            translation: DVec3::ZERO,
        }
    }
}

impl Placement {
    fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Checks that it can be used; else the field, what it must be, and what was found.
    pub(crate) fn check(&self) -> Result<(), (&'static str, &'static str, String)> {
        let Rotate { axis, angle_deg } = self.rotation;
        if !(self.scale.is_finite() && self.scale > 0.0) {
            return Err(("scale", "finite and positive", self.scale.to_string()));
        }
        if axis.try_normalize().is_none() {
            return Err(("rotation.axis", "a direction", axis.to_string()));
        }
        if !angle_deg.is_finite() {
            return Err(("rotation.angle_deg", "finite", angle_deg.to_string()));
        }
        match self.translation {
            by if by.is_finite() => Ok(()),
            by => Err(("translation", "finite", by.to_string())),
        }
    }

    pub(crate) fn place(&self, point: DVec3) -> DVec3 {
        self.rotation.turn() * (self.scale * point) + self.translation
    }
}

impl ObstacleSpec {
    /// The files that stay references.
    pub(crate) fn files(&self, folder: &Path) -> Vec<PathBuf> {
        let own = self.body.file().into_iter().chain(self.motion.file());
        own.map(|file| folder.join(file)).collect()
    }

    /// Makes the obstacle for a scene of `frame_rate` frames per second; files are relative to
    /// `folder`. What of its file is left out, or hardly meant, is said in `warnings`.
    ///
    /// # Errors
    /// [`Problem`] names the obstacle, the field or file and what is wrong.
    pub fn build(
        &self,
        folder: &Path,
        frame_rate: f64,
        warnings: &mut Vec<String>,
    ) -> Result<Obstacle, Problem> {
        let mut left = Vec::new();
        let made = self.body_and_path(folder, frame_rate, &mut left);
        let (body, path) = made.map_err(problem_of(&self.name))?;
        let name = &self.name;
        let left = left.into_iter();
        warnings.extend(left.map(|left| format!("obstacles[{name:?}].mesh: {left}")));
        let wrong = |error: SceneError| Problem(error.to_string());
        let made = || {
            let mut obstacle = Obstacle::of(name, body)?.moving(path)?;
            if let Some(friction) = self.friction {
                obstacle = obstacle.with_friction(friction)?;
            }
            match self.thickness {
                Some(thickness) => obstacle.with_thickness(thickness),
                None => Ok(obstacle),
            }
        };
        made().map_err(wrong)
    }

    /// The body where it is placed, and its path; what is hardly meant is said in `left`.
    fn body_and_path(
        &self,
        folder: &Path,
        frame_rate: f64,
        left: &mut Vec<String>,
    ) -> Result<(Body, ObstaclePath), String> {
        let placed = self.transform.check();
        placed.map_err(|(field, expected, found)| {
            format!("transform: {field} must be {expected}, found {found}")
        })?;
        let mut body = self.body.build(folder, self.motion.is_still(), left)?;
        let frames = self.motion.frames(&self.body, folder, frame_rate)?;
        let (rate, mut frames) = frames.unwrap_or_default();
        let count = body.points.len();
        let mut numbered = frames.iter().enumerate();
        if let Some((number, frame)) = numbered.find(|(_, frame)| frame.len() != count) {
            return Err(format!(
                "motion: frame {number} has {} points, but the mesh has {count}: their number must not change, so export both without merging points",
                frame.len()
            ));
        }
        let count = body.faces.len();
        if self.body.is_split() {
            weld(&mut body, &mut frames);
        }
        drop_flat(&mut body, frames.first().map(Vec::as_slice));
        if body.faces.len() < count {
            left.push(format!(
                "{} of {count} faces have no area at the start and are left out",
                count - body.faces.len()
            ));
        }
        if !self.transform.is_none() {
            body = body.placed(self.transform.scale, |p| self.transform.place(p));
        }
        let size = extent(&body.points);
        if matches!(self.body, BodySpec::Mesh { .. }) && !SIZES.contains(&size) {
            let remedy = unit_remedy(size, "transform.scale");
            left.push(format!("it is {size:.4} m long: {remedy}"));
        }
        for point in frames.iter_mut().flatten() {
            *point = self.transform.place(*point);
        }
        let path = match self.motion {
            ObstacleMotion::Points(_) => ObstaclePath::Points {
                frame_rate: rate,
                frames,
            },
            _ => self.motion.path(&body.points, folder, frame_rate)?,
        };
        Ok((body, path))
    }
}
