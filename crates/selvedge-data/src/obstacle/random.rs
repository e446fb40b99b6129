//! Obstacles drawn at random, as a preset of data sets asks for them.
//!
//! ```toml
//! [random_obstacles]                # of every trajectory its own
//! count = [1, 3]
//! kinds = ["sphere", "capsule", "box"]
//! size = [0.05, 0.15]               # radius, or half a side, m
//! min = [-0.8, -1.5, -0.8]          # where their centres start, m
//! max = [0.8, -0.6, 0.8]
//! speed = 0.3                       # at most, m/s; 0: they stand
//! friction = [0.1, 0.6]
//! seed = 1
//! ```

use glam::DVec3;
use selvedge_cloth::bodies::{BodyKind, BodyRanges, DrawnBody, draw};
use selvedge_cloth::{Keyframe, Scene};
use serde::Deserialize;

use super::body::{BodySpec, Capsule, Cuboid, Sphere};
use super::motion::{ObstacleKeyframes, ObstacleMotion};
use super::spec::{ObstacleSpec, Placement};
use crate::scene::Rotate;

/// Least distance to the cloth at the start `[m]`: it sags a little before.
const CLEARANCE: f64 = 0.05;
/// Largest speed of a motion between two keyframes in units of its mean: of s²(3 - 2s).
const PEAK: f64 = 1.5;

/// Ranges of obstacles, in the file's own words.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct RandomObstacles {
    count: [usize; 2],
    kinds: Vec<Kind>,
    size: [f64; 2],
    min: DVec3,
    max: DVec3,
    #[serde(default)]
    speed: f64,
    friction: [f64; 2],
    seed: u64,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Kind {
    Sphere,
    Capsule,
    Box,
}

impl RandomObstacles {
    /// Checks the ranges.
    ///
    /// # Errors
    /// The key and what is wrong with it.
    pub(crate) fn check(&self) -> Result<(), String> {
        let ascends = |[low, high]: [f64; 2], least: f64, most: f64| {
            low.is_finite() && high.is_finite() && least <= low && low <= high && high <= most
        };
        if self.count[0] > self.count[1] || self.count[1] > 100 {
            let [low, high] = self.count;
            return Err(format!(
                "count must be fewest and most, at most 100, found {low}, {high}"
            ));
        }
        if self.kinds.is_empty() {
            return Err("kinds is empty: name sphere, capsule or box".to_owned());
        }
        if !ascends(self.size, 1e-3, 100.0) {
            return Err(format!(
                "size must be smallest and largest, 0.001 to 100 m, found {:?}",
                self.size
            ));
        }
        if !ascends(self.friction, 0.0, 100.0) {
            return Err(format!(
                "friction must be least and largest, 0 to 100, found {:?}",
                self.friction
            ));
        }
        if !(self.min.is_finite() && self.max.is_finite() && self.min.cmple(self.max).all()) {
            return Err(format!(
                "min must be below max, found {} and {}",
                self.min, self.max
            ));
        }
        if !(0.0..=100.0).contains(&self.speed) {
            return Err(format!("speed must be 0 to 100 m/s, found {}", self.speed));
        }
        Ok(())
    }

    /// The obstacles of trajectory `number`, in a scene that lasts `seconds`.
    ///
    /// # Errors
    /// When one finds no place clear of the cloth.
    pub(crate) fn draw(
        &self,
        scene: &Scene,
        seconds: f64,
        number: usize,
    ) -> Result<Vec<ObstacleSpec>, String> {
        let kind = |kind: &Kind| match kind {
            Kind::Sphere => BodyKind::Sphere,
            Kind::Capsule => BodyKind::Capsule,
            Kind::Box => BodyKind::Box,
        };
        let ranges = BodyRanges {
            count: self.count,
            kinds: self.kinds.iter().map(kind).collect(),
            size: self.size,
            within: [self.min, self.max],
            travel: self.speed * seconds / PEAK,
            friction: self.friction,
            clearance: CLEARANCE,
        };
        let cloth = scene.mesh.positions();
        let drawn = draw(&ranges, cloth, self.seed, number as u64).ok_or_else(|| {
            "an obstacle finds no place clear of the cloth and of the others: make min to max larger, or count or size smaller".to_owned()
        })?;
        let numbered = drawn.iter().enumerate();
        Ok(numbered
            .map(|(k, body)| spec_of(body, k, seconds))
            .collect())
    }
}

fn spec_of(body: &DrawnBody, number: usize, seconds: f64) -> ObstacleSpec {
    let size = body.size;
    let (axis, angle) = body.turn.to_axis_angle();
    let motion = match body.travel == DVec3::ZERO {
        true => ObstacleMotion::Still,
        false => ObstacleMotion::Keyframes(ObstacleKeyframes {
            axis: DVec3::Y,
            centre: None,
            keyframes: vec![Keyframe {
                time: seconds,
                translation: body.travel,
                rotation_deg: 0.0,
            }],
        }),
    };
    ObstacleSpec {
        name: format!("random {number}"),
        body: match body.kind {
            BodyKind::Sphere => BodySpec::Sphere(Sphere {
                radius: size,
                edge: None,
            }),
            BodyKind::Capsule => BodySpec::Capsule(Capsule {
                radius: size,
                length: 4.0 * size,
                edge: None,
            }),
            BodyKind::Box => BodySpec::Box(Cuboid {
                size: DVec3::splat(2.0 * size),
            }),
        },
        transform: Placement {
            rotation: Rotate {
                axis,
                angle_deg: angle.to_degrees(),
            },
            translation: body.centre,
            ..Placement::default()
        },
        motion,
        friction: Some(body.friction),
        thickness: None,
    }
}
