//! Closest points of a vertex and a face, and of two edges; the push that brings such a pair to a gap,
//! the least change of positions by mass along one direction.

use glam::DVec3;

use crate::eight::ratio;
use crate::pair::Kind;

/// The closest points of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Gap {
    /// Distance of the two points `[m]`.
    pub distance: f64,
    /// Unit direction from the second feature to the first; zero where they touch.
    pub normal: DVec3,
    /// Weights of the corners: those of the first feature sum to 1, those of the second to -1. The
    /// vector between the points is Σ w x.
    pub weights: [f64; 4],
}

/// The closest points of the two features with these corners `[m]`.
#[inline]
pub fn gap(kind: Kind, corners: [DVec3; 4]) -> Gap {
    let weights = match kind {
        Kind::VertexFace => vertex_face(corners),
        Kind::EdgeEdge => edge_edge(corners),
    };
    let mut between = DVec3::ZERO;
    for (corner, weight) in corners.iter().zip(weights) {
        between += *corner * weight;
    }
    let distance = between.length();
    Gap {
        distance,
        normal: between.try_normalize().unwrap_or(DVec3::ZERO),
        weights,
    }
}

/// A distance that the gap of the two features with these corners is not below `[m]`, at a fraction
/// of its cost: that of the boxes around them, along the axis in which it is largest; negative
/// where they overlap.
#[inline]
pub fn least_gap(kind: Kind, corners: [DVec3; 4]) -> f64 {
    let (above, below) = along_axes(kind, corners);
    above.max(below).max_element()
}

/// Distances of the boxes around two features along the axes, the first above the second, and
/// below it `[m]`.
#[inline]
pub(crate) fn along_axes(kind: Kind, corners: [DVec3; 4]) -> (DVec3, DVec3) {
    let [a, b, c, d] = corners;
    let (least, greatest) = match kind {
        Kind::VertexFace => ((a, b.min(c).min(d)), (a, b.max(c).max(d))),
        Kind::EdgeEdge => ((a.min(b), c.min(d)), (a.max(b), c.max(d))),
    };
    (least.0 - greatest.1, least.1 - greatest.0)
}

/// Weights of a vertex p and the nearest point of the triangle a, b, c (Ericson 2005, 5.1.5).
#[inline]
fn vertex_face(corners: [DVec3; 4]) -> [f64; 4] {
    let [p, a, b, c] = corners;
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let most = ab.length_squared() * ac.length_squared();
    if ab.cross(ac).length_squared() <= 1e-20 * most {
        return vertex_line(corners);
    }
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    if d1 <= 0.0 && d2 <= 0.0 {
        return [1.0, -1.0, 0.0, 0.0];
    }
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    if d3 >= 0.0 && d4 <= d3 {
        return [1.0, 0.0, -1.0, 0.0];
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let t = ratio(d1, d1 - d3);
        return [1.0, t - 1.0, -t, 0.0];
    }
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    if d6 >= 0.0 && d5 <= d6 {
        return [1.0, 0.0, 0.0, -1.0];
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let t = ratio(d2, d2 - d6);
        return [1.0, t - 1.0, 0.0, -t];
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let t = ratio(d4 - d3, (d4 - d3) + (d5 - d6));
        return [1.0, 0.0, t - 1.0, -t];
    }
    let (v, w) = (ratio(vb, va + vb + vc), ratio(vc, va + vb + vc));
    [1.0, v + w - 1.0, -v, -w]
}

/// As [`vertex_face`], of a triangle that is a line: the nearest point of its sides.
#[cold]
fn vertex_line(corners: [DVec3; 4]) -> [f64; 4] {
    let mut best = ([1.0, -1.0, 0.0, 0.0], f64::INFINITY);
    for (from, to) in [(1, 2), (2, 3), (3, 1)] {
        let side = corners[to] - corners[from];
        let out = corners[0] - corners[from];
        let t = ratio(side.dot(out), side.length_squared());
        let distance = (out - side * t).length_squared();
        if distance < best.1 {
            let mut weights = [1.0, 0.0, 0.0, 0.0];
            weights[from] = t - 1.0;
            weights[to] = -t;
            best = (weights, distance);
        }
    }
    best.0
}

/// Weights of the nearest points of the edges a, b and c, d: the best of the two lines' own
/// closest points, where they lie within, and of each end against the other edge.
#[inline]
fn edge_edge(corners: [DVec3; 4]) -> [f64; 4] {
    let [a, b, c, d] = corners;
    let (u, v, r) = (b - a, d - c, a - c);
    let (uu, vv, uv) = (u.length_squared(), v.length_squared(), u.dot(v));
    let (ur, vr) = (u.dot(r), v.dot(r));
    let area = uu * vv - uv * uv;
    if area > 1e-24 * uu * vv {
        let s = (uv * vr - vv * ur) / area;
        let t = (uu * vr - uv * ur) / area;
        if (0.0..=1.0).contains(&s) && (0.0..=1.0).contains(&t) {
            // Two roundings of nearly parallel edges are polished by one step back and forth.
            let s = ratio(uv * t - ur, uu);
            let t = ratio(uv * s + vr, vv);
            return [1.0 - s, s, t - 1.0, -t];
        }
    }
    let mut best = ([0.0; 4], f64::INFINITY);
    let mut offer = |s: f64, t: f64| {
        let distance = (r + u * s - v * t).length_squared();
        if distance < best.1 {
            best = ([1.0 - s, s, t - 1.0, -t], distance);
        }
    };
    offer(0.0, ratio(vr, vv));
    offer(1.0, ratio(vr + uv, vv));
    offer(ratio(-ur, uu), 0.0);
    offer(ratio(uv - ur, uu), 1.0);
    best.0
}

/// A push on the four corners of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Push {
    /// Moves of the corners `[m]`.
    pub moves: [DVec3; 4],
    /// Size of the push λ `[kg m]`: corner i moves by wᵢ λ n / mᵢ.
    pub size: f64,
}

/// The push along `gap`'s direction after which Σ wᵢ n·xᵢ is `distance` `[m]`, for corners `now`
/// `[m]` and their inverse masses `[1/kg]`, 0 where they are held. None if it is that already, or
/// if all are held. `[eq:separation]`
pub fn push(gap: &Gap, now: [DVec3; 4], inverse: [f64; 4], distance: f64) -> Option<Push> {
    let mut extent = 0.0;
    let mut mobility = 0.0;
    for k in 0..4 {
        extent += gap.weights[k] * gap.normal.dot(now[k]);
        mobility += gap.weights[k] * gap.weights[k] * inverse[k];
    }
    let lack = distance - extent;
    if lack <= 0.0 || mobility <= 0.0 {
        return None;
    }
    let size = lack / mobility;
    let moves = std::array::from_fn(|k| gap.normal * (gap.weights[k] * inverse[k] * size));
    Some(Push { moves, size })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// The least distance over weights of both features, by a search of nested thirds: the distance
    /// is convex in them.
    fn searched(kind: Kind, corners: [DVec3; 4]) -> f64 {
        let [a, b, c, d] = corners;
        let least = |f: &dyn Fn(f64) -> f64, top: f64| {
            let (mut low, mut high) = (0.0, top);
            for _ in 0..200 {
                let third = (high - low) / 3.0;
                if f(low + third) <= f(high - third) {
                    high -= third;
                } else {
                    low += third;
                }
            }
            [0.0, top, low]
                .map(f)
                .into_iter()
                .fold(f64::INFINITY, f64::min)
        };
        match kind {
            Kind::VertexFace => least(
                &|s| least(&|t| (a - b - (c - b) * s - (d - b) * t).length(), 1.0 - s),
                1.0,
            ),
            Kind::EdgeEdge => least(
                &|s| least(&|t| (a + (b - a) * s - c - (d - c) * t).length(), 1.0),
                1.0,
            ),
        }
    }

    #[test]
    fn no_weights_are_nearer() {
        let mut rng = ChaCha8Rng::seed_from_u64(2);
        let mut point = || DVec3::from_array([0; 3].map(|_| rng.random_range(-1.0..1.0)));
        for round in 0..400 {
            let mut corners = [point(), point(), point(), point()];
            match round % 8 {
                // Parallel, aligned, without length, touching.
                1 => corners[3] = corners[2] + (corners[1] - corners[0]) * 0.7,
                2 => corners[3] = corners[2],
                3 => corners[1] = corners[0],
                4 => corners[0] = corners[2] * 0.3 + corners[3] * 0.7,
                5 => corners[3] = corners[1] + (corners[2] - corners[1]) * 0.4,
                6 => {
                    corners[2] = corners[0] + (corners[1] - corners[0]) * 1.5;
                    corners[3] = corners[0] + (corners[1] - corners[0]) * 2.0;
                }
                _ => {}
            }
            for kind in [Kind::VertexFace, Kind::EdgeEdge] {
                let found = gap(kind, corners);
                assert!(least_gap(kind, corners) <= found.distance + 1e-15);
                let expected = searched(kind, corners);
                // The nested search stops at about the root of the rounding.
                let bound = if expected < 1e-6 { 1e-7 } else { 1e-10 };
                assert!(
                    (found.distance - expected).abs() < bound,
                    "{kind:?} {round}: {} {expected}",
                    found.distance
                );
                let split = kind.split();
                let (first, second) = found.weights.split_at(split);
                assert!((first.iter().sum::<f64>() - 1.0).abs() < 1e-14);
                assert!((second.iter().sum::<f64>() + 1.0).abs() < 1e-14);
                assert!(first.iter().all(|w| *w >= 0.0) && second.iter().all(|w| *w <= 0.0));
            }
        }
    }

    #[test]
    fn boxes_that_are_apart_along_an_axis_are_as_far_as_that() {
        let face = [DVec3::ZERO, DVec3::X, DVec3::Y];
        let above = DVec3::new(0.3, 0.3, 2.0);
        let corners = [above, face[0], face[1], face[2]];
        assert_eq!(least_gap(Kind::VertexFace, corners), 2.0);
        let edges = [DVec3::ZERO, DVec3::X, above, above + DVec3::Y];
        assert_eq!(least_gap(Kind::EdgeEdge, edges), 2.0);
        assert!(least_gap(Kind::EdgeEdge, [face[0], face[1], face[1], face[2]]) <= 0.0);
    }

    #[test]
    fn a_push_keeps_both_momenta_and_reaches_its_distance() {
        let mut rng = ChaCha8Rng::seed_from_u64(5);
        for round in 0..200 {
            let kind = [Kind::VertexFace, Kind::EdgeEdge][round % 2];
            let now =
                [0; 4].map(|_| DVec3::from_array([0; 3].map(|_| rng.random_range(-1.0..1.0))));
            let inverse = [0; 4].map(|_| rng.random_range(0.1..3.0));
            let found = gap(kind, now);
            let distance = found.distance + 0.3;
            let push = push(&found, now, inverse, distance).unwrap();
            let (mut linear, mut angular) = (DVec3::ZERO, DVec3::ZERO);
            let mut reached = 0.0;
            for k in 0..4 {
                let momentum = push.moves[k] / inverse[k];
                linear += momentum;
                angular += now[k].cross(momentum);
                reached += found.weights[k] * found.normal.dot(now[k] + push.moves[k]);
            }
            assert!(linear.length() < 1e-12 * push.size.max(1.0));
            assert!(angular.length() < 1e-10 * push.size.max(1.0));
            assert!((reached - distance).abs() < 1e-12);
            assert!(super::push(&found, now, inverse, found.distance - 0.1).is_none());
            assert!(super::push(&found, now, [0.0; 4], distance).is_none());
        }
    }
}
