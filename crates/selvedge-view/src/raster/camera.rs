//! Where a run is seen from: an orbit around it, fitted so that every point of every frame stays in
//! view, and the stage that goes with it (the floor, the light that casts the shadow).
//!
//! With camera axes x (right), y (up), z (towards the viewer) and half-angle tangents tx, ty, the
//! camera at (x₀, y₀, d) sees a point when |x - x₀| ≤ tx (d - z) and |y - y₀| ≤ ty (d - z). The
//! nearest such camera follows from four maxima over the points: with A = max(x + tx z) and
//! B = max(-x + tx z), the width needs d ≥ (A + B) / 2tx at x₀ = (A - B) / 2, and the height alike.

use glam::{Vec2, Vec3};

use crate::{Run, ViewError};

/// The direction that a run is seen from, and how wide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// Angle of the camera around y, from +x towards +z `[rad]`.
    pub azimuth: f32,
    /// Angle of the camera above the horizon `[rad]`, in [0, 1.4].
    pub elevation: f32,
    /// Vertical angle of view `[rad]`, in [0.05, 2.5].
    pub field_of_view: f32,
    /// Part of the half picture that is left free at each side, in [0, 0.9].
    pub margin: f32,
}

impl Default for Orbit {
    /// Three quarters from the front of a sheet that hangs in the yz-plane with its normals along
    /// -x, slightly from above: +x runs away to the right, +z comes to the right.
    fn default() -> Self {
        Self {
            azimuth: 142_f32.to_radians(),
            elevation: 14_f32.to_radians(),
            field_of_view: 28_f32.to_radians(),
            margin: 0.07,
        }
    }
}

/// A perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    position: Vec3,
    right: Vec3,
    up: Vec3,
    backward: Vec3,
    tangents: Vec2,
}

/// Where a point lands in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projected {
    /// From the left (0) to the right edge (1).
    pub x: f32,
    /// From the top (0) to the bottom edge (1).
    pub y: f32,
    /// Distance from the camera's plane `[m]`; behind the camera it is not positive.
    pub depth: f32,
}

impl Orbit {
    /// Checks that every angle is in its range.
    ///
    /// # Errors
    /// [`ViewError::Setting`] with the field, its range and what was found.
    pub fn validate(&self) -> Result<(), ViewError> {
        let fields = [
            ("azimuth", self.azimuth, -1e4..=1e4, "finite"),
            ("elevation", self.elevation, 0.0..=1.4, "in [0, 1.4] rad"),
            (
                "field_of_view",
                self.field_of_view,
                0.05..=2.5,
                "in [0.05, 2.5] rad",
            ),
            ("margin", self.margin, 0.0..=0.9, "in [0, 0.9]"),
        ];
        for (field, value, allowed, expected) in fields {
            if !allowed.contains(&value) {
                return Err(ViewError::Setting {
                    field,
                    expected,
                    found: value.to_string(),
                });
            }
        }
        Ok(())
    }

    /// The nearest camera in this direction that sees all `points` `[m]` in a picture of `aspect`
    /// (width over height). Without points it looks at the origin.
    #[must_use]
    pub fn fit(&self, points: impl IntoIterator<Item = Vec3>, aspect: f32) -> Camera {
        let (sin_azimuth, cos_azimuth) = self.azimuth.sin_cos();
        let (sin_elevation, cos_elevation) = self.elevation.sin_cos();
        let level = Vec3::new(cos_azimuth, 0.0, sin_azimuth);
        let backward = cos_elevation * level + sin_elevation * Vec3::Y;
        let right = Vec3::Y.cross(level);
        let up = backward.cross(right);
        let tangent = (0.5 * self.field_of_view).tan();
        let tangents = Vec2::new(tangent * aspect, tangent);

        // Inner tangents leave the margin free.
        let inner = tangents * (1.0 - self.margin);
        let mut high = Vec2::splat(f32::NEG_INFINITY);
        let mut low = Vec2::splat(f32::NEG_INFINITY);
        let mut nearest = f32::NEG_INFINITY;
        for point in points {
            let flat = Vec2::new(point.dot(right), point.dot(up));
            let z = point.dot(backward);
            high = high.max(flat + inner * z);
            low = low.max(inner * z - flat);
            nearest = nearest.max(z);
        }
        if nearest == f32::NEG_INFINITY {
            (high, low, nearest) = (inner, inner, 0.0);
        }
        let centre = 0.5 * (high - low);
        // A tenth of a metre keeps a lone point in front of the camera.
        let distance = (0.5 * (high + low) / inner)
            .max_element()
            .max(nearest + 0.1);
        Camera {
            position: centre.x * right + centre.y * up + distance * backward,
            right,
            up,
            backward,
            tangents,
        }
    }
}

impl Camera {
    /// Where the camera is `[m]`.
    #[must_use]
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Where `point` `[m]` lands in the picture.
    #[must_use]
    pub fn project(&self, point: Vec3) -> Projected {
        let offset = point - self.position;
        let depth = -offset.dot(self.backward);
        let reach = self.tangents * depth;
        Projected {
            x: 0.5 + 0.5 * offset.dot(self.right) / reach.x,
            y: 0.5 - 0.5 * offset.dot(self.up) / reach.y,
            depth,
        }
    }

    /// The direction from the camera through a place of the picture (0 to 1 from the left and from
    /// the top), not normalised.
    #[must_use]
    pub fn ray(&self, x: f32, y: f32) -> Vec3 {
        let across = (2.0 * x - 1.0) * self.tangents.x * self.right;
        let upwards = (1.0 - 2.0 * y) * self.tangents.y * self.up;
        across + upwards - self.backward
    }

    /// Unit vector to the right of the picture.
    pub(crate) fn right(&self) -> Vec3 {
        self.right
    }

    /// Unit vector towards the viewer.
    pub(crate) fn backward(&self) -> Vec3 {
        self.backward
    }
}

/// A camera for whole runs, the floor under them, and the part of the floor that their shadow can
/// reach.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stage {
    pub(crate) camera: Camera,
    pub(crate) floor: f32,
    pub(crate) shadow_light: Vec3,
    pub(crate) shadow_low: Vec2,
    pub(crate) shadow_high: Vec2,
}

impl Stage {
    /// The stage that holds all `runs` in pictures of `aspect` (width over height).
    ///
    /// # Errors
    /// [`ViewError::NoPanels`] without runs; [`ViewError::Setting`] for an orbit out of range.
    pub fn of_runs(runs: &[&Run<'_>], orbit: &Orbit, aspect: f32) -> Result<Self, ViewError> {
        if runs.is_empty() {
            return Err(ViewError::NoPanels);
        }
        orbit.validate()?;
        let points = || {
            let frames = runs.iter().flat_map(|run| run.frames());
            frames.flat_map(|frame| frame.iter().copied())
        };
        let (lowest, highest) = points().fold((f32::MAX, f32::MIN), |(low, high), point| {
            (low.min(point.y), high.max(point.y))
        });
        let floor = lowest - (0.06 * (highest - lowest)).max(0.01);
        let grounded = |point: Vec3| Vec3::new(point.x, floor, point.z);
        let camera = orbit.fit(points().flat_map(|p| [p, grounded(p)]), aspect);

        let level = Vec3::Y.cross(camera.right).normalize_or(Vec3::X) * -1.0;
        let shadow_light = (Vec3::Y + 0.22 * level - 0.16 * camera.right).normalize();
        let (mut shadow_low, mut shadow_high) = (Vec2::MAX, Vec2::MIN);
        for point in points() {
            let place = cast(point, shadow_light, floor);
            shadow_low = shadow_low.min(place);
            shadow_high = shadow_high.max(place);
        }
        Ok(Self {
            camera,
            floor,
            shadow_light,
            shadow_low,
            shadow_high,
        })
    }

    /// The camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }
}

/// Where the light from `towards_light` throws `point` onto the floor: (x, z) `[m]`.
pub(crate) fn cast(point: Vec3, towards_light: Vec3, floor: f32) -> Vec2 {
    let fall = (point.y - floor) / towards_light.y;
    let place = point - fall * towards_light;
    Vec2::new(place.x, place.z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use selvedge_cloth::Topology;

    #[test]
    fn a_known_point_lands_on_its_closed_form() {
        // From +x, level, 90 degrees high, without margin: the square y, z in [-1, 1] at x = 0
        // fills the picture from a distance of 1.
        let orbit = Orbit {
            azimuth: 0.0,
            elevation: 0.0,
            field_of_view: std::f32::consts::FRAC_PI_2,
            margin: 0.0,
        };
        let corners = [-1.0_f32, 1.0]
            .into_iter()
            .flat_map(|y| [-1.0_f32, 1.0].map(|z| Vec3::new(0.0, y, z)));
        let camera = orbit.fit(corners, 1.0);
        assert!(camera.position().distance(Vec3::X) < 1e-6);
        // From +x with y up, +z lies to the left.
        let seen = camera.project(Vec3::new(0.0, 0.5, 0.5));
        assert!((seen.x - 0.25).abs() < 1e-6 && (seen.y - 0.25).abs() < 1e-6);
        assert!((seen.depth - 1.0).abs() < 1e-6);
        // Twice as far away, half as far from the middle.
        let seen = camera.project(Vec3::new(-1.0, 0.5, 0.5));
        assert!((seen.x - 0.375).abs() < 1e-6 && (seen.depth - 2.0).abs() < 1e-6);
    }

    #[test]
    fn an_orbit_out_of_range_is_an_error() {
        let orbit = Orbit {
            elevation: 2.0,
            ..Orbit::default()
        };
        let message = orbit.validate().unwrap_err().to_string();
        assert_eq!(message, "elevation must be in [0, 1.4] rad, found 2");
        assert!(
            Orbit {
                azimuth: f32::NAN,
                ..Orbit::default()
            }
            .validate()
            .is_err()
        );
    }

    #[test]
    fn a_lone_point_is_in_the_middle() {
        let point = Vec3::new(3.0, -2.0, 5.0);
        let seen = Orbit::default().fit([point], 1.5).project(point);
        assert!((seen.x - 0.5).abs() < 1e-4 && (seen.y - 0.5).abs() < 1e-4);
        assert!(seen.depth > 0.0);
    }

    proptest! {
        #[test]
        fn the_stage_contains_every_point_and_touches_the_margin(
            points in prop::collection::vec(prop::array::uniform3(-3.0_f32..3.0), 6),
            azimuth in -4.0_f32..4.0,
            elevation in 0.0_f32..1.2,
            aspect in 0.5_f32..2.5,
        ) {
            let topology = Topology::new(3, &[[0, 1, 2]]).unwrap();
            let points: Vec<Vec3> = points.into_iter().map(Vec3::from_array).collect();
            let run = Run::new(&topology, points.chunks(3), &[], 60.0).unwrap();
            let orbit = Orbit { azimuth, elevation, ..Orbit::default() };
            let stage = Stage::of_runs(&[&run], &orbit, aspect).unwrap();
            let mut farthest = 0.0_f32;
            let grounded = points.iter().map(|p| Vec3::new(p.x, stage.floor, p.z));
            for &point in &points {
                let seen = stage.camera.project(point);
                prop_assert!(seen.depth > 0.0);
            }
            for point in points.iter().copied().chain(grounded) {
                let seen = stage.camera.project(point);
                let reach = (2.0 * seen.x - 1.0).abs().max((2.0 * seen.y - 1.0).abs());
                farthest = farthest.max(reach);
            }
            // Some point is at the margin: the camera is no farther away than it must be. Rounding
            // of coordinates around 10 m leaves about 1e-5.
            prop_assert!((farthest - (1.0 - orbit.margin)).abs() < 1e-4, "{}", farthest);
        }
    }
}
