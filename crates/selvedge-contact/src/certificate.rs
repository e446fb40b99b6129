//! A proof that two features stay apart while their corners move on straight lines.
//!
//! For one direction n, the least of n·(x_i - x_j) over corners i of one feature and j of the other
//! is a minimum of functions that are affine in time. So it is concave: where it is at least d at
//! both ends of a span of time, the features are at least d apart throughout. Nothing is iterated
//! and nothing is tuned.
//!
//! Features that turn together need a direction that turns: spans of the way get one each, down to
//! [`SHORTEST`].

use glam::DVec3;

use crate::closest::{Gap, along_axes, gap};
use crate::eight::weights;
use crate::number::{Number, Vector};
use crate::pair::Kind;

/// Shortest span that gets a direction of its own, before a pair counts as not safe.
const SHORTEST: f64 = 1.0 / 256.0;
/// Length of the first span that is tried.
const FIRST_SPAN: f64 = 0.25;
/// Part of the span that a direction serves for which is taken: features that meet are told from
/// each other the better the nearer they are, but what is safe should leave them some room.
const CAUTION: f64 = 0.9;

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
pub struct Impact {
    /// Time of impact at the earliest: the part of the span up to which they surely stay apart, 0 to 1.
    pub time: f64,
    /// Their closest points then.
    pub gap: Gap,
}

impl Path {
    /// The places at `part` of the span.
    #[inline]
    pub fn at(&self, part: f64) -> [DVec3; 4] {
        std::array::from_fn(|k| self.from[k].lerp(self.to[k], part))
    }

    /// A distance that the features keep by one of the directions of the axes `[m]`; negative where
    /// none of them shows it.
    #[inline]
    pub fn axes_gap(&self, kind: Kind) -> f64 {
        let (above, below) = self.along_axes(kind);
        above.max(below).max_element()
    }

    /// The axis by which [`Self::axes_gap`] is kept: a unit direction from the second feature to
    /// the first.
    pub fn axis(&self, kind: Kind) -> DVec3 {
        let (above, below) = self.along_axes(kind);
        let axis = above.max(below).max_position();
        let sign = if above[axis] >= below[axis] { 1.0 } else { -1.0 };
        DVec3::AXES[axis] * sign
    }

    /// Distances that the features keep along the axes, the first above the second, and below it
    /// `[m]`.
    #[inline]
    fn along_axes(&self, kind: Kind) -> (DVec3, DVec3) {
        let (above, below) = along_axes(kind, self.from);
        let (above_then, below_then) = along_axes(kind, self.to);
        (above.min(above_then), below.min(below_then))
    }
}

/// One direction that keeps two features apart for the whole of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Straight {
    /// The direction, not longer than 1, from the second feature to the first.
    pub direction: DVec3,
    /// By how much more than the distance it keeps them apart at the end `[m]`.
    pub spare: f64,
}

/// Proves that the features stay at least `distance` `[m]` apart over the whole of `path`.
/// `[eq:certificate]`
///
/// # Errors
/// [`Impact`] where that is not so, or where short spans did not show it.
#[inline]
pub fn certify(kind: Kind, path: Path, distance: f64) -> Result<(), Impact> {
    let start = gap(kind, path.from);
    match is_apart(kind, path.from, path.to, distance, &start) {
        Some(_) => Ok(()),
        None => certify_turning(kind, &path, distance, start),
    }
}

/// As [`certify`], with one direction for the whole path. By as much as that has to spare at the
/// end the corners may end elsewhere, those of one feature against those of the other, and the
/// features still are apart.
///
/// # Errors
/// The gap at the start, where no one direction shows it: [`certify_turning`] may.
pub fn certify_straight(kind: Kind, path: Path, distance: f64) -> Result<Straight, Gap> {
    let start = gap(kind, path.from);
    is_apart(kind, path.from, path.to, distance, &start).ok_or(start)
}

/// As [`certify`], by spans of the path, of which each has a direction; `start` is the gap where it
/// begins. How far a span may go is told by the direction of the gap at its start: the extent along
/// it is no less than the straight line between its values there and at the end of the path. Where
/// that is not far, a longer span may have another direction.
///
/// # Errors
/// As for [`certify`].
#[cold]
pub fn certify_turning(kind: Kind, path: &Path, distance: f64, start: Gap) -> Result<(), Impact> {
    let (mut safe, mut now, mut span) = (0.0, start, FIRST_SPAN);
    loop {
        if now.distance < distance {
            return Err(Impact {
                time: safe,
                gap: now,
            });
        }
        let from = path.at(safe);
        let first = extent(kind, from, now.normal) - distance;
        let last = extent(kind, path.to, now.normal) - distance;
        if first >= 0.0 && last >= 0.0 {
            return Ok(());
        }
        let mut step = CAUTION * (1.0 - safe) * (first / (first - last)).max(0.0);
        span = span.max(SHORTEST);
        while step < span && span >= SHORTEST {
            let next = path.at((safe + span).min(1.0));
            if is_apart(kind, from, next, distance, &now).is_some() {
                step = span;
                span *= 2.0;
                break;
            }
            span *= 0.5;
        }
        if step < SHORTEST {
            return Err(Impact {
                time: safe,
                gap: now,
            });
        }
        safe += step;
        if safe >= 1.0 {
            return Ok(());
        }
        now = gap(kind, path.at(safe));
    }
}

/// The corners of a pair at the time of impact that [`certify`] finds on its way `from` here `to` there, or at
/// the end of the way where it finds none: with a derivative by both, where numbers have one.
pub fn at_impact<N: Number<Mask = bool>>(
    kind: Kind,
    path: &Path,
    [from, to]: [[N::Vector; 4]; 2],
    distance: f64,
) -> [N::Vector; 4] {
    let lerp =
        |part: N| -> [N::Vector; 4] { std::array::from_fn(|k| from[k] + (to[k] - from[k]) * part) };
    let one = from[0].components()[0].same(1.0);
    let (mut safe, mut place, mut span) = (one.same(0.0), 0.0, FIRST_SPAN);
    loop {
        let (now, here) = (lerp(safe), gap(kind, path.at(place)));
        if here.distance < distance || place >= 1.0 {
            return now;
        }
        let weights = weights::<N>(kind, now);
        let mut between = now[0] * weights[0];
        for k in 1..4 {
            between = between + now[k] * weights[k];
        }
        let normal = between / between.dot(between).sqrt();
        let first: N = crate::eight::extent::<N>(kind, now, normal) - distance;
        let last: N = crate::eight::extent::<N>(kind, to, normal) - distance;
        let [start, end] =
            [path.at(place), path.to].map(|corners| extent(kind, corners, here.normal) - distance);
        let mut step = (one - safe) * CAUTION * (first / (first - last));
        let mut length = CAUTION * (1.0 - place) * (start / (start - end)).max(0.0);
        span = span.max(SHORTEST);
        while length < span && span >= SHORTEST {
            let next = path.at((place + span).min(1.0));
            if is_apart(kind, path.at(place), next, distance, &here).is_some() {
                (step, length) = (one.same(span), span);
                span *= 2.0;
                break;
            }
            span *= 0.5;
        }
        if length < SHORTEST {
            return now;
        }
        (safe, place) = (safe + step, place + length);
    }
}

/// Looks for one of a few directions that keeps the features apart at both ends, where `start` is
/// their gap at the first.
#[inline]
fn is_apart(
    kind: Kind,
    from: [DVec3; 4],
    to: [DVec3; 4],
    distance: f64,
    start: &Gap,
) -> Option<Straight> {
    let serves = |direction: DVec3| {
        let spare = extent(kind, to, direction) - distance;
        let is_apart = spare >= 0.0 && extent(kind, from, direction) >= distance;
        is_apart.then_some(Straight { direction, spare })
    };
    if start.distance < distance {
        return None;
    }
    if let Some(straight) = serves(start.normal) {
        return Some(straight);
    }
    let end = gap(kind, to);
    if end.distance < distance {
        return None;
    }
    if let Some(straight) = serves(end.normal) {
        return Some(straight);
    }
    if let Some(middle) = (start.normal + end.normal).try_normalize()
        && let Some(straight) = serves(middle)
    {
        return Some(straight);
    }
    let mut across = [across(kind, from), across(kind, to)].into_iter().flatten();
    across.find_map(|normal| serves(normal).or_else(|| serves(-normal)))
}

/// Length of the longest of the `ways` `[m]` of a corner of one feature against one of the other: the
/// features come no nearer than by that.
#[inline]
pub fn approach(kind: Kind, ways: [DVec3; 4]) -> f64 {
    let [a, b, c, d] = ways;
    let way = |p: DVec3, q: DVec3| (p - q).length_squared();
    let most = match kind {
        Kind::VertexFace => (way(a, b).greater(way(a, c))).greater(way(a, d)),
        Kind::EdgeEdge => (way(a, c).greater(way(a, d))).greater(way(b, c).greater(way(b, d))),
    };
    most.sqrt()
}

/// Least extent along `direction`, not longer than 1, from the second feature to the first `[m]`:
/// they are at least so far apart. Where the extent at both ends of a straight way is at least a
/// distance, it is so on all of it.
#[inline]
pub fn extent(kind: Kind, corners: [DVec3; 4], direction: DVec3) -> f64 {
    crate::eight::extent::<f64>(kind, corners, direction)
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

    #[derive(Debug, Default)]
    struct Count {
        apart: u32,
        certified: u32,
        false_safe: u32,
    }

    /// Checks pairs that move at random: near, far, together, turning, through each other.
    fn check(pairs: u32, seed: u64, samples: u32) {
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
        }
        assert_eq!(count.false_safe, 0, "{count:?}");
        assert!(
            f64::from(count.certified) >= 0.95 * f64::from(count.apart),
            "{count:?}"
        );
    }

    #[test]
    fn nothing_that_is_certified_touches() {
        check(20_000, 3, 200);
    }

    #[test]
    #[ignore = "takes minutes: a million pairs at a thousand times each"]
    fn nothing_of_a_million_that_is_certified_touches() {
        check(1_000_000, 4, 1000);
    }

    #[test]
    fn what_is_to_spare_may_be_used_up_by_other_ends() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        let (mut tried, mut least_left) = (0, f64::INFINITY);
        for number in 0..20_000_u32 {
            let kind = [Kind::VertexFace, Kind::EdgeEdge][number as usize % 2];
            let mut point =
                |size: f64| DVec3::from_array([0; 3].map(|_| rng.random_range(-size..size)));
            let from = [0; 4].map(|_| point(0.01));
            let drift = point(0.05);
            let path = Path {
                from,
                to: from.map(|p| p + drift + point(0.002)),
            };
            let axes = path.axes_gap(kind);
            let ways = std::array::from_fn(|k| path.to[k] - from[k]);
            let near = gap(kind, from).distance - approach(kind, ways);
            let straight =
                certify_straight(kind, path, 2e-5).map_or(f64::NEG_INFINITY, |s| s.spare + 2e-5);
            let best = axes.max(near).max(straight);
            if best <= 0.0 {
                continue;
            }
            tried += 1;
            // All go elsewhere together, and one feature against the other by what is to spare.
            let elsewhere = point(0.05);
            let against = point(1.0).normalize_or_zero() * (best - 1e-7).max(0.0);
            let mut to = path.to.map(|p| p + elsewhere);
            to[..kind.split()].iter_mut().for_each(|p| *p += against);
            let other = Path { from, to };
            for k in 0..=40 {
                let distance = gap(kind, other.at(f64::from(k) / 40.0)).distance;
                assert!(distance > 0.0, "{kind:?} {number}");
                least_left = least_left.min(distance);
            }
        }
        assert!(tried > 1000, "{tried}");
        assert!(least_left < 1e-4, "nothing came near: {least_left}");
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
        assert!(certify_straight(Kind::VertexFace, path, 2e-5).is_err());
        assert_eq!(certify(Kind::VertexFace, path, 2e-5), Ok(()));
    }

    #[test]
    fn an_impact_says_until_when_features_were_safe() {
        let face = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let at = |z: f64| [DVec3::new(0.2, 0.2, z), face[0], face[1], face[2]];
        let path = Path {
            from: at(1.0),
            to: at(-1.0),
        };
        let impact = certify(Kind::VertexFace, path, 0.01).unwrap_err();
        // The gap is 0.01 at 0.495 of the span, and a 256th of it is 0.004.
        assert!((0.49..=0.495).contains(&impact.time), "{impact:?}");
        assert!(impact.gap.normal.distance(DVec3::Z) < 1e-12);
        let flat = at(0.0);
        let touching = Path {
            from: flat,
            to: at(1.0),
        };
        assert_eq!(
            certify(Kind::VertexFace, touching, 0.01).unwrap_err().time,
            0.0
        );
    }
}
