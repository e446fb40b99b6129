//! The local frame of a cloth: the yaw about the vertical that its handles share, so that a cloth
//! and the same cloth turned about the vertical look alike to the network (paper §5.4).
//!
//! y stays up. Two handles h0, h1 give x = normalise(up × (h0 - h1)) and z = x × up, which is the
//! horizontal direction of h0 - h1. More handles give the principal axis of their horizontal
//! positions at rest, signed like first - last; a moving cloth turns with the horizontal rotation
//! that best takes its handles from rest to where they are. Only differences of positions enter
//! the features, so that the frame has no origin.
//!
//! Continuous in the handles wherever they have a horizontal direction; elsewhere (no handle, one
//! handle, handles one above the other) the yaw of the frame before is kept. Never NaN.

use glam::{DVec2, DVec3, Vec3};

/// Least part of the spread it is compared with that makes a horizontal spread a direction: f32
/// positions at 1 m are exact to 6e-8 m, so that a direction is good to 1e-4 rad there.
const LEAST_SPREAD: f64 = 1e-3;

/// A rotation about the vertical: the local z axis lies at this angle from world z towards x.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Yaw {
    cos: f64,
    sin: f64,
}

impl Default for Yaw {
    fn default() -> Self {
        Self::WORLD
    }
}

impl Yaw {
    /// The world's own axes.
    pub const WORLD: Self = Self { cos: 1.0, sin: 0.0 };

    /// The rotation by `angle` about +y `[rad]`.
    pub fn from_angle(angle: f64) -> Self {
        Self {
            cos: angle.cos(),
            sin: angle.sin(),
        }
    }

    /// The angle of rotation about +y `[rad]`, in (-π, π].
    #[cfg(test)]
    pub(crate) fn angle(self) -> f64 {
        self.sin.atan2(self.cos)
    }

    /// A difference of world positions, in local axes.
    #[inline]
    pub fn to_local(self, world: Vec3) -> Vec3 {
        let (cos, sin) = (self.cos as f32, self.sin as f32);
        Vec3::new(
            cos * world.x - sin * world.z,
            world.y,
            sin * world.x + cos * world.z,
        )
    }

    /// A vector in local axes, in world axes: the inverse of [`Self::to_local`].
    #[inline]
    pub fn to_world(self, local: Vec3) -> Vec3 {
        let (cos, sin) = (self.cos as f32, self.sin as f32);
        Vec3::new(
            cos * local.x + sin * local.z,
            local.y,
            cos * local.z - sin * local.x,
        )
    }

    /// [`Self::to_local`] in f64.
    pub fn to_local_f64(self, world: DVec3) -> DVec3 {
        DVec3::new(
            self.cos * world.x - self.sin * world.z,
            world.y,
            self.sin * world.x + self.cos * world.z,
        )
    }

    /// [`Self::to_world`] in f64.
    pub fn to_world_f64(self, local: DVec3) -> DVec3 {
        DVec3::new(
            self.cos * local.x + self.sin * local.z,
            local.y,
            self.cos * local.z - self.sin * local.x,
        )
    }

    /// The direction of a complex number that is not 0.
    fn of(direction: DVec2) -> Self {
        let unit = direction / direction.length();
        Self {
            cos: unit.x,
            sin: unit.y,
        }
    }

    fn after(self, first: DVec2) -> Self {
        Self::of(product(DVec2::new(self.cos, self.sin), first))
    }
}

/// The local frame of one cloth, which follows its handles.
#[derive(Clone, Debug, PartialEq)]
pub struct LocalFrame {
    rest_yaw: Yaw,
    /// Handles at rest about their centroid, horizontally, as complex numbers z + i x.
    rest: Vec<DVec2>,
    /// Σ |rest|² `[m²]`; 0 where the handles have no horizontal direction.
    spread: f64,
}

impl LocalFrame {
    /// The frame of a cloth whose handles rest at `rest_handle_positions` `[m]`, `[handles]`.
    pub fn new(rest_handle_positions: &[Vec3]) -> Self {
        let count = rest_handle_positions.len().max(1) as f64;
        let centroid = rest_handle_positions
            .iter()
            .map(|p| p.as_dvec3())
            .sum::<DVec3>()
            / count;
        let centred = rest_handle_positions
            .iter()
            .map(|p| p.as_dvec3() - centroid);
        let whole: f64 = centred.clone().map(DVec3::length_squared).sum();
        let rest: Vec<DVec2> = centred.map(horizontal).collect();
        let spread: f64 = rest.iter().map(|a| a.length_squared()).sum();
        let has_direction = spread > LEAST_SPREAD * LEAST_SPREAD * whole;
        Self {
            rest_yaw: if has_direction {
                rest_direction(&rest, spread).map_or(Yaw::WORLD, Yaw::of)
            } else {
                Yaw::WORLD
            },
            rest,
            spread: if has_direction { spread } else { 0.0 },
        }
    }

    /// The yaw of the rest pose, from which a motion starts.
    pub fn rest_yaw(&self) -> Yaw {
        self.rest_yaw
    }

    /// The yaw when the handles are at `handle_positions` `[m]`, `[handles]`: that of the rest pose
    /// turned by ψ = arg Σ conj(aᵢ) bᵢ, the rotation that minimises Σ |bᵢ - e^{iψ} aᵢ|² over
    /// handles at rest a and now b, horizontal and about their centroids `[eq:local-frame]`.
    ///
    /// Returns `previous` if the handles have no horizontal direction, at rest or now.
    ///
    /// # Panics
    /// When there are not as many positions as handles.
    pub fn yaw(&self, handle_positions: &[Vec3], previous: Yaw) -> Yaw {
        self.yaw_of(handle_positions.iter().copied(), previous)
    }

    /// [`Self::yaw`] of an iterator over positions.
    pub(crate) fn yaw_of(
        &self,
        handle_positions: impl ExactSizeIterator<Item = Vec3> + Clone,
        previous: Yaw,
    ) -> Yaw {
        assert_eq!(
            handle_positions.len(),
            self.rest.len(),
            "one position per handle"
        );
        let Some(anchor) = handle_positions.clone().next() else {
            return previous;
        };
        // Σ a = 0, so that b may be taken from any origin: the first handle keeps it small.
        let anchor = anchor.as_dvec3();
        let turn: DVec2 = self
            .rest
            .iter()
            .zip(handle_positions)
            .map(|(a, b)| product(DVec2::new(a.x, -a.y), horizontal(b.as_dvec3() - anchor)))
            .sum();
        if turn.is_finite() && turn.length() > LEAST_SPREAD * self.spread && self.spread > 0.0 {
            self.rest_yaw.after(turn)
        } else {
            previous
        }
    }
}

/// The horizontal part as a complex number z + i x, whose argument is the yaw of its direction.
fn horizontal(p: DVec3) -> DVec2 {
    DVec2::new(p.z, p.x)
}

fn product(a: DVec2, b: DVec2) -> DVec2 {
    DVec2::new(a.x * b.x - a.y * b.y, a.x * b.y + a.y * b.x)
}

/// The principal axis of handles about their centroid, signed like first - last. Without a
/// distinct axis it is the direction first - last itself, or that of the first handle if both
/// coincide.
fn rest_direction(rest: &[DVec2], spread: f64) -> Option<DVec2> {
    let least = LEAST_SPREAD * spread.sqrt();
    let long = |direction: &DVec2| direction.length() > least;
    let (&first, &last) = (rest.first()?, rest.last()?);
    // Σ a² = |Σ a²| e^{2iφ} with φ the angle of the principal axis.
    let squares: DVec2 = rest.iter().map(|&a| product(a, a)).sum();
    if squares.length() <= LEAST_SPREAD * spread {
        return [first - last, first].into_iter().find(long);
    }
    let axis = DVec2::from_angle(0.5 * squares.y.atan2(squares.x));
    let sign = std::iter::once(first - last)
        .chain(rest.iter().copied())
        .map(|a| a.dot(axis))
        .find(|along| along.abs() > least)?
        .signum();
    Some(sign * axis)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_cloth::turn;
    use std::f64::consts::{PI, TAU};

    fn turned(positions: &[Vec3], angle: f64) -> Vec<Vec3> {
        turn(positions, Yaw::from_angle(angle), Vec3::new(0.3, -0.2, 0.9))
    }

    fn difference(a: Yaw, b: Yaw) -> f64 {
        let turn = (a.angle() - b.angle()).rem_euclid(TAU);
        turn.min(TAU - turn)
    }

    /// Handles of one cloth each, all with a horizontal direction.
    fn cases() -> Vec<Vec<Vec3>> {
        let line = |n: usize| {
            (0..n)
                .map(|k| Vec3::new(0.01 * (k * k) as f32, 1.0, 0.5 - 0.06 * k as f32))
                .collect()
        };
        let equilateral = (0..3)
            .map(|k| {
                let angle = f64::from(k) * TAU / 3.0;
                DVec3::new(angle.sin(), 1.0, angle.cos()).as_vec3()
            })
            .collect();
        vec![
            vec![Vec3::new(0.1, 1.0, -0.4), Vec3::new(-0.2, 1.3, 0.6)],
            vec![Vec3::Z, Vec3::X, Vec3::new(-0.4, 0.5, -2.0)],
            line(17),
            equilateral,
        ]
    }

    #[test]
    fn two_handles_give_the_frame_of_the_paper() {
        let handles = &cases()[0];
        let frame = LocalFrame::new(handles);
        let x = Vec3::Y.cross(handles[0] - handles[1]).normalize();
        let z = x.cross(Vec3::Y);
        for (local, world) in [(Vec3::X, x), (Vec3::Y, Vec3::Y), (Vec3::Z, z)] {
            assert!(frame.rest_yaw().to_world(local).distance(world) < 1e-6);
            assert!(frame.rest_yaw().to_local(world).distance(local) < 1e-6);
        }
    }

    #[test]
    fn the_frame_turns_with_the_handles_without_jumps_through_a_whole_circle() {
        for rest in cases() {
            let frame = LocalFrame::new(&rest);
            let mut previous = frame.rest_yaw();
            for step in 0..=720 {
                let angle = f64::from(step) * TAU / 720.0;
                let now = frame.yaw(&turned(&rest, angle), previous);
                let expected = Yaw::from_angle(frame.rest_yaw().angle() + angle);
                // Positions of 2 m rounded to f32: 1e-7 of a spread of about 1.
                assert!(difference(now, expected) < 1e-6);
                assert!(difference(now, previous) < 0.01);
                previous = now;
            }
            // A rest pose that is turned has a frame that is turned.
            for angle in [0.3, 1.9, -2.8] {
                let yaw = LocalFrame::new(&turned(&rest, angle)).rest_yaw();
                let expected = Yaw::from_angle(frame.rest_yaw().angle() + angle);
                assert!(difference(yaw, expected) < 1e-6);
            }
        }
    }

    #[test]
    fn the_yaw_is_the_rotation_that_fits_the_handles_best() {
        let rest = &cases()[1];
        let frame = LocalFrame::new(rest);
        let mut now = turned(rest, 1.1);
        now[0] += Vec3::new(0.2, -0.3, 0.1);
        let centre = |positions: &[Vec3]| positions.iter().sum::<Vec3>() / 3.0;
        let misfit = |turn: f64| -> f64 {
            let yaw = Yaw::from_angle(turn);
            rest.iter()
                .zip(&now)
                .map(|(&a, &b)| {
                    let a = (a - centre(rest)).as_dvec3();
                    let b = (b - centre(&now)).as_dvec3();
                    horizontal(yaw.to_world_f64(a) - b).length_squared()
                })
                .sum()
        };
        let best = frame.yaw(&now, Yaw::WORLD).angle() - frame.rest_yaw().angle();
        for away in [-1.0, -1e-3, 1e-3, 1.0, PI] {
            assert!(misfit(best) < misfit(best + away));
        }
    }

    #[test]
    fn without_a_horizontal_direction_the_frame_before_is_kept() {
        let before = Yaw::from_angle(0.7);
        let above = [Vec3::new(0.2, 1.0, 0.3), Vec3::new(0.2, 1.5, 0.3)];
        for rest in [&[][..], &[Vec3::ONE], &above, &[Vec3::ONE, Vec3::ONE]] {
            let frame = LocalFrame::new(rest);
            assert_eq!(frame.rest_yaw(), Yaw::WORLD);
            assert_eq!(frame.yaw(&turned(rest, 0.4), before), before);
        }
        let apart = LocalFrame::new(&cases()[0]);
        assert_eq!(apart.yaw(&above, before), before);
        assert_eq!(apart.yaw(&[Vec3::NAN, Vec3::ONE], before), before);
        // A hair beside each other is enough.
        let beside = [above[0], above[1] + Vec3::new(0.01, 0.0, 0.0)];
        assert_ne!(apart.yaw(&beside, before), before);
    }
}
