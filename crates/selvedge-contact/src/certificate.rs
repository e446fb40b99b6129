//! A proof that two features stay apart while their corners move on straight lines.
//!
//! For one direction n, the least of n·(x_i - x_j) over corners i of one feature and j of the other
//! is a minimum of functions that are affine in time. So it is concave: where it is at least d at
//! both ends of a span of time, the features are at least d apart throughout. Nothing is iterated
//! and nothing is tuned.
//!
//! Features that turn together need a direction that turns. Where no direction serves for a span,
//! its halves get one each, down to [`MOST_HALVINGS`].

use glam::DVec3;

use crate::boxes::Bounds;
use crate::closest::{Gap, gap};
use crate::pair::Kind;

/// Halvings of the span before a pair counts as not safe.
const MOST_HALVINGS: u32 = 8;

/// The corners of a pair at both ends of a span of time, on straight lines in between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Path {
    /// At the start `[m]`.
    pub from: [DVec3; 4],
    /// At the end `[m]`.
    pub to: [DVec3; 4],
}

/// Features that could not be shown to stay apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Part of the span up to which they surely do, 0 to 1.
    pub safe: f64,
    /// Their closest points then.
    pub gap: Gap,
}

impl Path {
    /// The places at `part` of the span.
    #[must_use]
    #[inline]
    pub fn at(&self, part: f64) -> [DVec3; 4] {
        std::array::from_fn(|k| self.from[k].lerp(self.to[k], part))
    }

    /// Returns true if boxes along the axes show that the features of a pair, vertex and face or
    /// two edges, stay at least `distance` `[m]` apart.
    #[must_use]
    #[inline]
    pub fn boxes_apart(&self, kind: Kind, distance: f64) -> bool {
        let around = |corners: std::ops::Range<usize>| {
            let boxes = corners.map(|k| Bounds::of(self.from[k]).around(Bounds::of(self.to[k])));
            boxes.reduce(Bounds::around)
        };
        let split = kind.split();
        match (around(0..split), around(split..4)) {
            (Some(first), Some(second)) => !first.widened(distance).meets(&second),
            _ => false,
        }
    }
}

/// Proves that the features stay at least `distance` `[m]` apart over the whole of `path`.
/// `[eq:certificate]`
///
/// # Errors
/// [`Approach`] where that is not so, or where halves of halves did not show it.
#[inline]
pub fn certify(kind: Kind, path: Path, distance: f64) -> Result<(), Approach> {
    if is_apart(kind, path.from, path.to, distance) {
        return Ok(());
    }
    refined(kind, &path, distance)
}

/// As [`certify`], with one direction for the whole path.
#[must_use]
pub fn certify_straight(kind: Kind, path: Path, distance: f64) -> bool {
    is_apart(kind, path.from, path.to, distance)
}

#[cold]
fn refined(kind: Kind, path: &Path, distance: f64) -> Result<(), Approach> {
    // Spans that are still to be shown, the earliest last: numerator and halvings.
    let mut open: Vec<(u32, u32)> = vec![(1, 1), (0, 1)];
    while let Some((number, halvings)) = open.pop() {
        let length = 1.0 / f64::from(1_u32 << halvings);
        let safe = f64::from(number) * length;
        let from = path.at(safe);
        if is_apart(kind, from, path.at(safe + length), distance) {
            continue;
        }
        let now = gap(kind, from);
        if halvings >= MOST_HALVINGS || now.distance < distance {
            return Err(Approach { safe, gap: now });
        }
        open.extend([(2 * number + 1, halvings + 1), (2 * number, halvings + 1)]);
    }
    Ok(())
}

/// Returns true if one of a few directions keeps the features apart at both ends.
#[inline]
fn is_apart(kind: Kind, from: [DVec3; 4], to: [DVec3; 4], distance: f64) -> bool {
    let serves = |direction: DVec3| {
        least(kind, from, direction) >= distance && least(kind, to, direction) >= distance
    };
    let start = gap(kind, from);
    if start.distance < distance {
        return false;
    }
    if serves(start.normal) {
        return true;
    }
    let end = gap(kind, to);
    if end.distance < distance {
        return false;
    }
    if serves(end.normal) {
        return true;
    }
    if let Some(middle) = (start.normal + end.normal).try_normalize()
        && serves(middle)
    {
        return true;
    }
    [across(kind, from), across(kind, to)]
        .into_iter()
        .flatten()
        .any(|normal| serves(normal) || serves(-normal))
}

/// Least extent along `direction` from the second feature to the first `[m]`.
#[inline]
fn least(kind: Kind, corners: [DVec3; 4], direction: DVec3) -> f64 {
    let [a, b, c, d] = corners.map(|corner| corner.dot(direction));
    match kind {
        Kind::VertexFace => a - b.max(c).max(d),
        Kind::EdgeEdge => a.min(b) - c.max(d),
    }
}

/// The direction across both features: a face's normal, or that across two edges.
#[inline]
fn across(kind: Kind, corners: [DVec3; 4]) -> Option<DVec3> {
    let [a, b, c, d] = corners;
    let cross = match kind {
        Kind::VertexFace => (c - b).cross(d - b),
        Kind::EdgeEdge => (b - a).cross(d - c),
    };
    cross.try_normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Outcomes of random moving pairs.
    #[derive(Debug, Default)]
    struct Count {
        apart: u32,
        by_one_direction: u32,
        certified: u32,
        false_safe: u32,
    }

    /// Pairs that move at random: near, far, together, turning, through each other.
    fn count(pairs: u32, seed: u64, samples: u32) -> Count {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut count = Count::default();
        let distance = 2e-5;
        for number in 0..pairs {
            let kind = [Kind::VertexFace, Kind::EdgeEdge][number as usize % 2];
            let mut point =
                |size: f64| DVec3::from_array([0; 3].map(|_| rng.random_range(-size..size)));
            let size = [0.03, 0.01, 0.003][number as usize / 2 % 3];
            let (drift, own) = (point(0.1), [0.03, 0.003, 0.0003][number as usize / 6 % 3]);
            let axis = point(1.0);
            let from = [0; 4].map(|_| point(size));
            let to = from.map(|p| p + axis.cross(p) + drift + point(own));
            let path = Path { from, to };
            let nearest = (0..=samples)
                .map(|k| gap(kind, path.at(f64::from(k) / f64::from(samples))).distance)
                .fold(f64::INFINITY, f64::min);
            let is_certified = certify(kind, path, distance).is_ok();
            // A sampled minimum is at least the true one.
            count.false_safe += u32::from(is_certified && nearest < distance * (1.0 - 1e-9));
            count.apart += u32::from(nearest >= distance + 1e-6);
            count.certified += u32::from(is_certified && nearest >= distance + 1e-6);
            let straight = certify_straight(kind, path, distance);
            count.by_one_direction += u32::from(straight && nearest >= distance + 1e-6);
        }
        count
    }

    #[test]
    fn nothing_that_is_certified_touches() {
        let count = count(20_000, 3, 200);
        assert_eq!(count.false_safe, 0, "{count:?}");
        assert!(
            f64::from(count.certified) >= 0.95 * f64::from(count.apart),
            "{count:?}"
        );
    }

    #[test]
    #[ignore = "takes minutes: a million pairs at a thousand times each"]
    fn nothing_of_a_million_that_is_certified_touches() {
        let count = count(1_000_000, 4, 1000);
        assert_eq!(count.false_safe, 0, "{count:?}");
        assert!(
            f64::from(count.certified) >= 0.95 * f64::from(count.apart),
            "{count:?}"
        );
    }

    #[test]
    fn layers_that_turn_together_need_more_than_one_direction() {
        // A face of 30 mm and a vertex 0.1 mm above it turn by 20° together.
        let face = [DVec3::ZERO, DVec3::X * 0.03, DVec3::Y * 0.03];
        let from = [DVec3::new(1e-2, 1e-2, 1e-4), face[0], face[1], face[2]];
        let turn = glam::DQuat::from_rotation_x(20_f64.to_radians());
        let path = Path {
            from,
            to: from.map(|p| turn * p),
        };
        assert!(!certify_straight(Kind::VertexFace, path, 2e-5));
        assert_eq!(certify(Kind::VertexFace, path, 2e-5), Ok(()));
    }

    #[test]
    fn an_approach_says_until_when_it_was_safe() {
        let face = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let at = |z: f64| [DVec3::new(0.2, 0.2, z), face[0], face[1], face[2]];
        let path = Path {
            from: at(1.0),
            to: at(-1.0),
        };
        let approach = certify(Kind::VertexFace, path, 0.01).unwrap_err();
        // The gap is 0.01 at 0.495 of the span, and a 256th of it is 0.004.
        assert!((0.49..=0.495).contains(&approach.safe), "{approach:?}");
        assert!(approach.gap.normal.distance(DVec3::Z) < 1e-12);
        let flat = at(0.0);
        let touching = Path {
            from: flat,
            to: at(1.0),
        };
        assert_eq!(
            certify(Kind::VertexFace, touching, 0.01).unwrap_err().safe,
            0.0
        );
    }
}
