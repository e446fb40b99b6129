//! Frames that go along with a body, so that what moves as a whole is at rest in them.
//!
//! A frame has points at y where the world has them at x = M y + t. M is a rotation, or a mean
//! between two that are near each other: it lengthens nothing, and shortens nothing below
//! [`Passage::shrink`].
//!
//! Points go straight in the world, from x to x'. A frame that goes straight as well, M(s) = (1-s) M
//! + s M' and t(s) likewise, has them at y(s) with x_a(s) - x_b(s) = M(s) (y_a(s) - y_b(s)): two
//! points are at least [`Passage::shrink`] times as far apart as in the frame, at every s. Where
//! y = y', y(s) stays there. Else y(s) is off the straight line from y to y' by
//! s (1-s) M(s)⁻¹ (M' - M) (y' - y), which is at most [`Passage::bulge`] times |y' - y|.

use glam::{DMat3, DQuat, DVec3};

/// Least part of a length that a frame may leave: the cosine of half an angle of 16°.
pub(crate) const LEAST_SHRINK: f64 = 0.99;
/// Rounds of a fit. Whatever it finds is a rotation.
const ROUNDS: usize = 3;

/// A frame at an instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frame {
    matrix: DMat3,
    inverse: DMat3,
    origin: DVec3,
}

impl Frame {
    /// The frame that is turned by this rotation, a unit quaternion, and shifted then `[m]`.
    #[must_use]
    pub fn new(rotation: DQuat, origin: DVec3) -> Self {
        let matrix = DMat3::from_quat(rotation);
        Self {
            matrix,
            inverse: matrix.transpose(),
            origin,
        }
    }

    /// Place in the frame of a `point` of the world `[m]`.
    #[must_use]
    #[inline]
    pub fn place(&self, point: DVec3) -> DVec3 {
        self.inverse * (point - self.origin)
    }

    fn lerp(&self, other: &Self, part: f64) -> Self {
        if self == other {
            return *self;
        }
        let matrix = self.matrix * (1.0 - part) + other.matrix * part;
        Self {
            matrix,
            inverse: matrix.inverse(),
            origin: self.origin.lerp(other.origin, part),
        }
    }
}

/// The way of a frame, straight from one instant to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Passage {
    pub(crate) from: Frame,
    pub(crate) to: Frame,
    /// Part of a length in the frame that it has in the world on the way, at least.
    pub(crate) shrink: f64,
    /// Distance of a point from its straight way in the frame, as a part of that, at most.
    pub(crate) bulge: f64,
}

impl Passage {
    /// The way between two places of a body, each a rotation, a unit quaternion, and a translation
    /// `[m]`. None where it turns by more than 16°.
    #[must_use]
    pub fn new(from: (DQuat, DVec3), to: (DQuat, DVec3)) -> Option<Self> {
        let shrink = from.0.dot(to.0).abs().min(1.0);
        (shrink >= LEAST_SHRINK).then(|| Self {
            from: Frame::new(from.0, from.1),
            to: Frame::new(to.0, to.1),
            shrink,
            bulge: bulge(shrink, 1.0),
        })
    }

    /// A frame that stays.
    #[must_use]
    pub fn still(frame: Frame) -> Self {
        Self {
            from: frame,
            to: frame,
            shrink: 1.0,
            bulge: 0.0,
        }
    }

    /// The way between two parts of this one.
    #[must_use]
    pub fn between(&self, from: f64, to: f64) -> Self {
        Self {
            from: self.from.lerp(&self.to, from),
            to: self.from.lerp(&self.to, to),
            shrink: self.shrink,
            bulge: bulge(self.shrink, (to - from).abs()),
        }
    }

    /// Returns true if the frame does not move.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.from == self.to
    }
}

/// A quarter of |M' - M|, over the least length that M(s) leaves of a unit.
fn bulge(shrink: f64, part: f64) -> f64 {
    0.5 * (1.0 - shrink * shrink).max(0.0).sqrt() * part / shrink
}

/// The frame that best follows points that deform: that of the rigid motion since a reference.
#[derive(Clone, Debug)]
pub(crate) struct Follower {
    /// Places of the points in the frame when it was taken `[m]`; empty before.
    reference: Vec<DVec3>,
    mean: DVec3,
    /// Where the frame is.
    rotation: DQuat,
    origin: DVec3,
}

impl Default for Follower {
    fn default() -> Self {
        Self {
            reference: Vec::new(),
            mean: DVec3::ZERO,
            rotation: DQuat::IDENTITY,
            origin: DVec3::ZERO,
        }
    }
}

impl Follower {
    /// Takes these `places` in the frame `[m]` for the reference. The frame stays where it is.
    pub(crate) fn refer(&mut self, places: &[DVec3]) {
        self.reference.clear();
        self.reference.extend_from_slice(places);
        self.mean = mean(places);
    }

    /// The way of the frame with the points, which go to `to` `[m]`. Where they turn too far it only
    /// shifts.
    pub(crate) fn follow(&self, to: &[DVec3]) -> Passage {
        let own = (self.rotation, self.origin);
        let turned = self.turned(to);
        let far = (turned, self.origin_at(to, turned));
        Passage::new(own, far).unwrap_or_else(|| Passage {
            from: Frame::new(own.0, own.1),
            to: Frame::new(own.0, self.origin_at(to, own.0)),
            shrink: 1.0,
            bulge: 0.0,
        })
    }

    /// Takes the frame to where the points are at `points` `[m]`, and returns it.
    pub(crate) fn turn(&mut self, points: &[DVec3]) -> Frame {
        self.rotation = self.turned(points);
        self.origin = self.origin_at(points, self.rotation);
        Frame::new(self.rotation, self.origin)
    }

    fn origin_at(&self, points: &[DVec3], rotation: DQuat) -> DVec3 {
        mean(points) - rotation * self.mean
    }

    /// The rotation that fits the reference to the points best, by Newton's method from the one that
    /// there is.
    fn turned(&self, points: &[DVec3]) -> DQuat {
        let middle = mean(points);
        let mut sums = DMat3::ZERO;
        for (point, reference) in points.iter().zip(&self.reference) {
            let (own, was) = (*point - middle, *reference - self.mean);
            sums.x_axis += own * was.x;
            sums.y_axis += own * was.y;
            sums.z_axis += own * was.z;
        }
        let mut rotation = self.rotation;
        for _ in 0..ROUNDS {
            // The turn that makes the product symmetric, to first order.
            let product = DMat3::from_quat(rotation).transpose() * sums;
            let DMat3 {
                x_axis: x,
                y_axis: y,
                z_axis: z,
            } = product;
            let across = DVec3::new(y.z - z.y, z.x - x.z, x.y - y.x);
            let trace = x.x + y.y + z.z;
            let stiff = DMat3::from_diagonal(DVec3::splat(trace)) - product;
            let half = (stiff + stiff.transpose()).inverse() * across;
            // A small turn without sines, which differ from system to system.
            let turn = DQuat::from_xyzw(half.x, half.y, half.z, 1.0);
            let next = (rotation * turn).normalize();
            if !next.is_finite() {
                break;
            }
            rotation = next;
        }
        rotation
    }
}

fn mean(points: &[DVec3]) -> DVec3 {
    points.iter().copied().sum::<DVec3>() / points.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn a_point_bulges_off_its_way_and_lengths_shrink_by_no_more_than_is_said() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let (mut most, mut shortest) = (0.0_f64, f64::INFINITY);
        for _ in 0..2000 {
            let mut number = || rng.random_range(-1.0..1.0);
            let mut vector = || DVec3::new(number(), number(), number());
            let turn = |axis: DVec3, angle: f64| DQuat::from_scaled_axis(axis.normalize() * angle);
            let first = turn(vector(), 2.0);
            let own = (first, vector());
            let far = (turn(vector(), 0.28 * vector().x) * first, vector() * 9.0);
            let whole = Passage::new(own, far).unwrap();
            for passage in [whole, whole.between(0.3, 0.8)] {
                let [x, x_then] = [vector(), vector() + far.1];
                let (y, y_then) = (passage.from.place(x), passage.to.place(x_then));
                for k in 1..8 {
                    let s = f64::from(k) / 8.0;
                    let frame = passage.from.lerp(&passage.to, s);
                    let off = frame.place(x.lerp(x_then, s)).distance(y.lerp(y_then, s));
                    let said = passage.bulge * y.distance(y_then);
                    assert!(off <= said * (1.0 + 1e-9) + 1e-12, "{off} {said}");
                    most = most.max(off / said.max(1e-3));
                    let unit = vector().normalize();
                    let length = (frame.matrix * unit).length();
                    assert!(length <= 1.0 + 1e-12 && length >= passage.shrink - 1e-12);
                    shortest = shortest.min(length);
                }
            }
        }
        // What is said is about what happens.
        assert!(most > 0.8 && shortest < 0.992, "{most} {shortest}");
        let half = (DQuat::from_rotation_y(0.3), DVec3::ZERO);
        assert!(Passage::new((DQuat::IDENTITY, DVec3::ZERO), half).is_none());
    }

    #[test]
    fn points_that_move_as_one_are_at_rest_in_the_frame_that_follows_them() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        // Flat, so that the fit alone does not tell the side.
        let points: Vec<DVec3> = (0..40)
            .map(|_| {
                DVec3::new(
                    rng.random_range(-1.0..1.0),
                    rng.random_range(-0.3..1.0),
                    0.0,
                )
            })
            .collect();
        let at = |time: f64| -> Vec<DVec3> {
            let rotation = DQuat::from_scaled_axis(DVec3::new(1.0, 2.0, -1.0) * time);
            let shift = DVec3::new(3.0, -80.0 * time, 9.0 * time * time);
            points.iter().map(|p| rotation * *p + shift).collect()
        };
        let mut follower = Follower::default();
        let frame = follower.turn(&at(0.0));
        let places: Vec<DVec3> = at(0.0).iter().map(|p| frame.place(*p)).collect();
        follower.refer(&places);
        for k in 0..400 {
            let (now, next) = (at(f64::from(k) * 0.02), at(f64::from(k + 1) * 0.02));
            let frame = follower.turn(&now);
            let passage = follower.follow(&next);
            for ((place, p), q) in places.iter().zip(&now).zip(&next) {
                assert!(frame.place(*p).distance(*place) < 1e-6);
                assert!(passage.to.place(*q).distance(*place) < 1e-6);
            }
        }
        // A leap is no turn, and what is no number turns nothing.
        follower.turn(&at(8.0));
        let leap = follower.follow(&at(8.5));
        assert!(leap.shrink == 1.0 && leap.bulge == 0.0);
        follower.turn(&[DVec3::NAN; 40]);
        assert!(follower.rotation.is_finite());
    }
}
