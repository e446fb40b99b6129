//! An obstacle, resolved: the same spec makes the same obstacle.

use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::{Obstacle, ObstaclePath};
use serde::{Deserialize, Serialize};

use super::body::BodySpec;
use super::error::FieldProblem;
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

    /// Places every point.
    fn apply(&self, points: &mut [DVec3]) {
        if self.is_none() {
            return;
        }
        let turn = self.rotation.turn();
        for point in points {
            *point = turn * (self.scale * *point) + self.translation;
        }
    }
}

impl ObstacleSpec {
    /// The files that stay references; sequences are named by their pattern.
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
        let own = |problem: FieldProblem| problem.of(&self.name);
        let placed = self.transform.check().map_err(|(field, expected, found)| {
            FieldProblem(
                "transform",
                format!("{field} must be {expected}, found {found}"),
            )
        });
        placed.map_err(own)?;
        let mut left = Vec::new();
        let is_still = self.motion.is_still();
        let body = self.body.build(folder, is_still, &mut left);
        let mut body = body.map_err(own)?;
        let mut frames = self
            .motion
            .frames(&self.body, folder, frame_rate)
            .map_err(own)?;
        if let Some((_, frames)) = &mut frames {
            for (number, frame) in frames.iter().enumerate() {
                if frame.len() != body.points.len() {
                    let problem = format!(
                        "frame {number} has {} points, but the mesh has {}: their number must not change, so export both without merging points",
                        frame.len(),
                        body.points.len()
                    );
                    return Err(own(FieldProblem("motion", problem)));
                }
            }
        }
        let count = body.faces.len();
        if self.body.is_split() {
            let frames = frames.as_mut().map(|(_, frames)| frames.as_mut_slice());
            weld(&mut body, frames.unwrap_or_default());
        }
        let first = frames.as_ref().and_then(|(_, frames)| frames.first());
        drop_flat(&mut body, first.map(Vec::as_slice));
        if body.faces.len() < count {
            left.push(format!(
                "{} of {count} faces have no area at the start and are left out",
                count - body.faces.len()
            ));
        }
        self.transform.apply(&mut body.points);
        let size = extent(&body.points);
        if matches!(self.body, BodySpec::Mesh { .. }) && !SIZES.contains(&size) {
            left.push(format!(
                "it is {size:.4} m long: {}",
                unit_remedy(size, "transform.scale")
            ));
        }
        let name = &self.name;
        warnings.extend(
            left.iter()
                .map(|left| format!("obstacles[{name:?}].mesh: {left}")),
        );
        let path = match frames {
            Some((rate, mut frames)) => {
                for frame in &mut frames {
                    self.transform.apply(frame);
                }
                ObstaclePath::Points {
                    frame_rate: rate,
                    frames,
                }
            }
            None => self
                .motion
                .path(&body.points, folder, frame_rate)
                .map_err(own)?,
        };
        let obstacle = Obstacle::new(&self.name, body.points, body.faces)?.moving(path)?;
        let obstacle = match self.friction {
            Some(friction) => obstacle.with_friction(friction)?,
            None => obstacle,
        };
        Ok(match self.thickness {
            Some(thickness) => obstacle.with_thickness(thickness)?,
            None => obstacle,
        })
    }
}
