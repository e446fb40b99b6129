//! The camera: a direction towards the cloth, and the nearest camera in it that has every point in
//! view.
//!
//! With camera axes x (right), y (up), z (towards the viewer) and half-angle tangents tx, ty, the
//! camera at (x₀, y₀, d) sees a point when |x - x₀| ≤ tx (d - z) and |y - y₀| ≤ ty (d - z). The
//! nearest such camera follows from four maxima over the points: with A = max(x + tx z) and
//! B = max(-x + tx z), the width needs d ≥ (A + B) / 2tx at x₀ = (A - B) / 2, and the height alike.

use glam::{Vec2, Vec3};

use crate::ViewError;

/// A direction from which pictures are taken.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Angle of the camera around y, from +x towards +z `[degrees]`.
    pub azimuth: f32,
    /// Angle of the camera above the horizon `[degrees]`, 0 to 80.
    pub elevation: f32,
}

impl Default for View {
    /// Three quarters from the front of a sheet that hangs in the yz-plane with its normals along
    /// -x, slightly from above: +x runs away to the right, +z comes to the right.
    fn default() -> Self {
        Self {
            azimuth: 142.0,
            elevation: 14.0,
        }
    }
}

impl View {
    /// Checks that it is a direction.
    ///
    /// # Errors
    /// [`ViewError`] names the angle.
    pub fn check(&self) -> Result<(), ViewError> {
        for (field, angle, bounds) in [
            ("azimuth", self.azimuth, -360.0..=360.0),
            ("elevation", self.elevation, 0.0..=80.0),
        ] {
            if !bounds.contains(&angle) {
                let expected = format!("between {} and {} degrees", bounds.start(), bounds.end());
                return Err(ViewError::setting(field, &expected, angle));
            }
        }
        Ok(())
    }
}

/// Vertical angle of view `[degrees]`.
const FIELD_OF_VIEW: f32 = 28.0;
/// Part of the half picture that is left free at each side.
pub(crate) const MARGIN: f32 = 0.07;

/// A perspective camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Camera {
    /// `[m]`
    pub(crate) position: Vec3,
    /// Unit vector to the right of the picture.
    pub(crate) right: Vec3,
    up: Vec3,
    /// Unit vector towards the viewer.
    pub(crate) backward: Vec3,
    tangents: Vec2,
}

/// The image of a point in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Projected {
    /// From the left (0) to the right edge (1).
    pub(crate) x: f32,
    /// From the top (0) to the bottom edge (1).
    pub(crate) y: f32,
    /// Distance from the camera's plane `[m]`; behind the camera it is not positive.
    pub(crate) depth: f32,
}

impl View {
    /// The nearest camera in this direction that sees all `points` `[m]` in a picture of `aspect`
    /// (width over height). Without points it looks at the origin.
    pub(crate) fn fit(&self, points: impl IntoIterator<Item = Vec3>, aspect: f32) -> Camera {
        let (sin_azimuth, cos_azimuth) = self.azimuth.to_radians().sin_cos();
        let (sin_elevation, cos_elevation) = self.elevation.to_radians().sin_cos();
        let level = Vec3::new(cos_azimuth, 0.0, sin_azimuth);
        let backward = cos_elevation * level + sin_elevation * Vec3::Y;
        let right = Vec3::Y.cross(level);
        let up = backward.cross(right);
        let tangent = (0.5 * FIELD_OF_VIEW.to_radians()).tan();
        let tangents = Vec2::new(tangent * aspect, tangent);

        // Inner tangents leave the margin free.
        let inner = tangents * (1.0 - MARGIN);
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
    /// Projects `point` `[m]` into the picture.
    pub(crate) fn project(&self, point: Vec3) -> Projected {
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
    pub(crate) fn ray(&self, x: f32, y: f32) -> Vec3 {
        let across = (2.0 * x - 1.0) * self.tangents.x * self.right;
        let upwards = (1.0 - 2.0 * y) * self.tangents.y * self.up;
        across + upwards - self.backward
    }

    /// The same camera elsewhere, by `offset` `[m]`.
    pub(crate) fn moved_by(self, offset: Vec3) -> Self {
        Self {
            position: self.position + offset,
            ..self
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_known_point_lands_on_its_closed_form() {
        // From +x, level: the square y, z in [-1, 1] at x = 0 fills the picture within its margin.
        let view = View {
            azimuth: 0.0,
            elevation: 0.0,
        };
        let inner = 1.0 - MARGIN;
        let distance = 1.0 / (14_f32.to_radians().tan() * inner);
        let corners = [-1.0_f32, 1.0]
            .into_iter()
            .flat_map(|y| [-1.0_f32, 1.0].map(|z| Vec3::new(0.0, y, z)));
        let camera = view.fit(corners, 1.0);
        assert!(camera.position.distance(distance * Vec3::X) < 1e-5);
        // From +x with y up, +z lies to the left.
        let expected = 0.5 - 0.25 * inner;
        let seen = camera.project(Vec3::new(0.0, 0.5, 0.5));
        assert!((seen.x - expected).abs() < 1e-6 && (seen.y - expected).abs() < 1e-6);
        assert!((seen.depth - distance).abs() < 1e-5);
        // Twice as far away, half as far from the middle.
        let seen = camera.project(Vec3::new(-distance, 0.5, 0.5));
        let expected = 0.5 - 0.125 * inner;
        assert!((seen.x - expected).abs() < 1e-6 && (seen.depth - 2.0 * distance).abs() < 1e-5);
    }

    #[test]
    fn a_lone_point_is_in_the_middle() {
        let point = Vec3::new(3.0, -2.0, 5.0);
        let seen = View::default().fit([point], 1.5).project(point);
        assert!((seen.x - 0.5).abs() < 1e-4 && (seen.y - 0.5).abs() < 1e-4);
        assert!(seen.depth > 0.0);
    }
}
