//! An obstacle, resolved: the same spec makes the same obstacle.

use std::path::{Path, PathBuf};

use glam::{DQuat, DVec3};
use selvedge_cloth::{Obstacle, ObstaclePath};
use serde::{Deserialize, Serialize};

use super::body::BodySpec;
use super::error::{ObstacleSpecError, Problem};
use super::motion::ObstacleMotion;
use super::weld::weld;
use crate::scene::Rotate;

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
            rotation: Rotate {
                axis: DVec3::Y,
                angle_deg: 0.0,
            },
            translation: DVec3::ZERO,
        }
    }
}

impl Placement {
    fn is_none(&self) -> bool {
        *self == Self::default()
    }

    fn validate(&self) -> Result<(), Problem> {
        let wrong = |must: &str, found: &dyn std::fmt::Display| {
            let problem = format!("{must}, found {found}");
            Err(Problem::Field("transform", problem))
        };
        if !(self.scale.is_finite() && self.scale > 0.0) {
            return wrong("scale must be finite and positive", &self.scale);
        }
        let Rotate { axis, angle_deg } = self.rotation;
        if axis.try_normalize().is_none() {
            return wrong("rotation.axis must be a direction", &axis);
        }
        if !angle_deg.is_finite() {
            return wrong("rotation.angle_deg must be finite", &angle_deg);
        }
        if !self.translation.is_finite() {
            return wrong("translation must be finite", &self.translation);
        }
        Ok(())
    }

    /// Places every point.
    fn apply(&self, points: &mut [DVec3]) {
        if self.is_none() {
            return;
        }
        let Rotate { axis, angle_deg } = self.rotation;
        let turn = DQuat::from_axis_angle(axis.normalize(), angle_deg.to_radians());
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
    /// `folder`.
    ///
    /// # Errors
    /// [`ObstacleSpecError`] names the obstacle, the field or file and what is wrong.
    pub fn build(&self, folder: &Path, frame_rate: f64) -> Result<Obstacle, ObstacleSpecError> {
        let own = |problem: Problem| problem.of(&self.name);
        self.transform.validate().map_err(own)?;
        let mut body = self.body.build(folder).map_err(own)?;
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
                    return Err(own(Problem::Field("motion", problem)));
                }
            }
        }
        if self.body.is_split() {
            let frames = frames.as_mut().map(|(_, frames)| frames.as_mut_slice());
            weld(&mut body, frames.unwrap_or_default());
        }
        self.transform.apply(&mut body.points);
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
