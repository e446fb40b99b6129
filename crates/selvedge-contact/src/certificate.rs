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

    /// Longest way of a corner of one feature against one of the other `[m]`: the features come no
    /// nearer than by that.
    #[must_use]
    #[inline]
    pub fn approach(&self, kind: Kind) -> f64 {
        let way = |k: usize| self.to[k] - self.from[k];
        let [a, b, c, d] = [way(0), way(1), way(2), way(3)];
        let apart = |p: DVec3, q: DVec3| (p - q).length_squared();
        let most = match kind {
            Kind::VertexFace => apart(a, b).max(apart(a, c)).max(apart(a, d)),
            Kind::EdgeEdge => (apart(a, c).max(apart(a, d))).max(apart(b, c).max(apart(b, d))),
        };
        most.sqrt()
    }

    /// A distance that the features keep by one of the directions of the axes `[m]`; negative where
    /// none of them shows it.
    #[must_use]
    #[inline]
    pub fn axes_gap(&self, kind: Kind) -> f64 {
        let (above, below) = along_axes(kind, self.from);
        let (above_then, below_then) = along_axes(kind, self.to);
        above
            .min(above_then)
            .max(below.min(below_then))
            .max_element()
    }
}

/// Distances of the boxes around two features along the axes, the first above the second, and
/// below it `[m]`.
#[inline]
fn along_axes(kind: Kind, corners: [DVec3; 4]) -> (DVec3, DVec3) {
    let [a, b, c, d] = corners;
    let (least, greatest) = match kind {
        Kind::VertexFace => ((a, b.min(c).min(d)), (a, b.max(c).max(d))),
        Kind::EdgeEdge => ((a.min(b), c.min(d)), (a.max(b), c.max(d))),
    };
    (least.0 - greatest.1, least.1 - greatest.0)
}

/// Proves that the features stay at least `distance` `[m]` apart over the whole of `path`.
/// `[eq:certificate]`
///
/// # Errors
/// [`Approach`] where that is not so, or where halves of halves did not show it.
#[inline]
pub fn certify(kind: Kind, path: Path, distance: f64) -> Result<(), Approach> {
    let start = gap(kind, path.from);
    match is_apart(kind, path.from, path.to, distance, &start) {
        Some(_) => Ok(()),
        None => refined(kind, &path, distance, start),
    }
}

/// As [`certify`], with one direction for the whole path. Returns by how much more than `distance`
/// it keeps the features apart at the end `[m]`: they still are apart if the corners end elsewhere,
/// none of one feature further off against one of the other than that.
#[must_use]
pub fn certify_straight(kind: Kind, path: Path, distance: f64) -> Option<f64> {
    let start = gap(kind, path.from);
    is_apart(kind, path.from, path.to, distance, &start)
}

/// As [`certify`], by spans of the path; `start` is the gap where it begins.
#[cold]
fn refined(kind: Kind, path: &Path, distance: f64, start: Gap) -> Result<(), Approach> {
    let approach = path.approach(kind);
    // Spans that are still to be shown, the earliest last: numerator and halvings.
    let mut open = [(0_u32, 0_u32); MOST_HALVINGS as usize + 2];
    (open[0], open[1]) = ((1, 1), (0, 1));
    let mut count = 2;
    // The gap where the next span begins, if it is known.
    let mut known = Some(start);
    while count > 0 {
        count -= 1;
        let (number, halvings) = open[count];
        let length = 1.0 / f64::from(1_u32 << halvings);
        let safe = f64::from(number) * length;
        let from = path.at(safe);
        let now = known.unwrap_or_else(|| gap(kind, from));
        known = Some(now);
        if now.distance < distance {
            return Err(Approach { safe, gap: now });
        }
        if now.distance - approach * length >= distance {
            known = None;
            continue;
        }
        match is_apart(kind, from, path.at(safe + length), distance, &now) {
            Some(_) => known = None,
            None if halvings >= MOST_HALVINGS => return Err(Approach { safe, gap: now }),
            None => {
                open[count] = (2 * number + 1, halvings + 1);
                open[count + 1] = (2 * number, halvings + 1);
                count += 2;
            }
        }
    }
    Ok(())
}

/// Looks for one of a few directions that keeps the features apart at both ends, where `start` is
/// their gap at the first. Returns by how much more than `distance` it does at the second `[m]`.
#[inline]
fn is_apart(
    kind: Kind,
    from: [DVec3; 4],
    to: [DVec3; 4],
    distance: f64,
    start: &Gap,
) -> Option<f64> {
    let serves = |direction: DVec3| {
        let spare = least(kind, to, direction) - distance;
        (spare >= 0.0 && least(kind, from, direction) >= distance).then_some(spare)
    };
    if start.distance < distance {
        return None;
    }
    if let Some(spare) = serves(start.normal) {
        return Some(spare);
    }
    let end = gap(kind, to);
    if end.distance < distance {
        return None;
    }
    if let Some(spare) = serves(end.normal) {
        return Some(spare);
    }
    if let Some(middle) = (start.normal + end.normal).try_normalize()
        && let Some(spare) = serves(middle)
    {
        return Some(spare);
    }
    let mut across = [across(kind, from), across(kind, to)].into_iter().flatten();
    across.find_map(|normal| serves(normal).or_else(|| serves(-normal)))
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
            let straight = certify_straight(kind, path, distance).is_some();
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
            let near = gap(kind, from).distance - path.approach(kind);
            let straight = certify_straight(kind, path, 2e-5).map(|spare| spare + 2e-5);
            let best = axes.max(near).max(straight.unwrap_or(f64::NEG_INFINITY));
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
        assert_eq!(certify_straight(Kind::VertexFace, path, 2e-5), None);
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
