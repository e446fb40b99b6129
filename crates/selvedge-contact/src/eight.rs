//! Closest points of eight pairs of one kind at once, on the machine's vectors: the
//! same bits as of one pair after the other by [`gap`](crate::gap()) and its neighbours, which are their
//! reference.

use glam::DVec3;
use pulp::{Arch, Simd, WithSimd};

use crate::closest;
use crate::number::{GROUP, Lanes, LanesVector, Number, Row, Vector, gather};
use crate::pair::Kind;

/// As [`Gap`](crate::Gap), of each pair.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Gaps {
    /// Distance `[m]`.
    pub distance: Row,
    /// Unit direction from the second feature to the first, by component; zero where they meet.
    pub normal: [Row; 3],
    /// Weights of the corners.
    pub weights: [Row; 4],
    /// As [`extent`](crate::extent()) along the direction `[m]`.
    pub extent: Row,
}

/// The gaps of pairs of this `kind` of `points` `[m]`.
pub fn gaps(kind: Kind, corners: &[[u32; 4]; GROUP], points: &[DVec3]) -> Gaps {
    Arch::new().dispatch(OfGaps {
        kind,
        corners,
        points,
    })
}

struct OfGaps<'a> {
    kind: Kind,
    corners: &'a [[u32; 4]; GROUP],
    points: &'a [DVec3],
}

impl WithSimd for OfGaps<'_> {
    type Output = Gaps;

    #[inline(always)]
    fn with_simd<S: Simd>(self, simd: S) -> Gaps {
        let places = gather(self.points, self.corners);
        let mut found = Gaps::default();
        let mut is_line = [0.0; GROUP];
        for part in 0..Lanes::<S>::PARTS {
            let corners = Lanes::vectors(simd, &places, part);
            let weights = match self.kind {
                Kind::VertexFace => {
                    let (weights, line) = vertex_face::<Lanes<S>>(corners);
                    line.store(&mut is_line, part);
                    weights
                }
                Kind::EdgeEdge => edge_edge::<Lanes<S>>(corners),
            };
            let zero = weights[0].same(0.0);
            let mut between = LanesVector::of([zero; 3]);
            for (corner, weight) in corners.into_iter().zip(weights) {
                between = between + corner * weight;
            }
            let distance = between.dot(between).sqrt();
            let inverse = zero.same(1.0) / distance;
            // As `try_normalize`: finite and above zero.
            let is_known = zero.both(zero.below(inverse), inverse.below(zero.same(f64::INFINITY)));
            let [x, y, z] = (between * inverse).components();
            let normal = [x, y, z];
            let mut known = [zero; 3];
            for (known, part) in known.iter_mut().zip(normal) {
                *known = Number::pick(is_known, part, zero);
            }
            distance.store(&mut found.distance, part);
            Lanes::store_all(known, &mut found.normal, part);
            Lanes::store_all(weights, &mut found.weights, part);
            extent::<Lanes<S>>(self.kind, corners, LanesVector::of(known))
                .store(&mut found.extent, part);
        }
        if is_line != [0.0; GROUP] {
            self.lines(&is_line, &mut found);
        }
        found
    }
}

impl OfGaps<'_> {
    /// Faces that are lines, one after the other.
    #[cold]
    fn lines(&self, is_line: &Row, found: &mut Gaps) {
        for lane in (0..GROUP).filter(|lane| is_line[*lane] != 0.0) {
            let corners = self.corners[lane].map(|p| self.points[p as usize]);
            let gap = closest::gap(self.kind, corners);
            found.distance[lane] = gap.distance;
            for (row, part) in found.normal.iter_mut().zip(gap.normal.to_array()) {
                row[lane] = part;
            }
            for (row, weight) in found.weights.iter_mut().zip(gap.weights) {
                row[lane] = weight;
            }
            found.extent[lane] = crate::extent(self.kind, corners, gap.normal);
        }
    }
}

/// As [`extent`](crate::extent()).
#[inline(always)]
pub(crate) fn extent<N: Number>(kind: Kind, corners: [N::Vector; 4], direction: N::Vector) -> N {
    let [a, b, c, d] = corners;
    let (a, b, c, d) = (
        a.dot(direction),
        b.dot(direction),
        c.dot(direction),
        d.dot(direction),
    );
    match kind {
        Kind::VertexFace => a - b.greater(c).greater(d),
        Kind::EdgeEdge => a.smaller(b) - c.greater(d),
    }
}

/// Weights of the closest points of a pair with these corners, as [`Gap::weights`](crate::Gap::weights), of
/// numbers with a derivative too.
pub fn weights<N: Number<Mask = bool>>(kind: Kind, corners: [N::Vector; 4]) -> [N; 4] {
    match kind {
        Kind::VertexFace => {
            let (weights, is_line) = vertex_face::<N>(corners);
            if is_line.same(0.0).below(is_line) { vertex_line(corners) } else { weights }
        }
        Kind::EdgeEdge => edge_edge::<N>(corners),
    }
}

/// As `closest::vertex_line`.
fn vertex_line<N: Number<Mask = bool>>(corners: [N::Vector; 4]) -> [N; 4] {
    let square = |vector: N::Vector| -> N { vector.dot(vector) };
    let zero = square(corners[0]).same(0.0);
    let one = zero.same(1.0);
    let (mut best, mut least) = ([one, -one, zero, zero], zero.same(f64::INFINITY));
    for (from, to) in [(1, 2), (2, 3), (3, 1)] {
        let side = corners[to] - corners[from];
        let out = corners[0] - corners[from];
        let t: N = ratio(side.dot(out), square(side));
        let distance = square(out - side * t);
        if distance.below(least) {
            least = distance;
            best = [one, zero, zero, zero];
            best[from] = t - one;
            best[to] = -t;
        }
    }
    best
}

/// `part` of `whole`, within 0 and 1; 0 of nothing.
#[inline(always)]
pub(crate) fn ratio<N: Number>(part: N, whole: N) -> N {
    let zero = part.same(0.0);
    let within = (part / whole).at_least(0.0).at_most(1.0);
    N::pick(zero.below(whole), within, zero)
}

/// As `closest::vertex_face`, all regions at once; and 1 where the face is a line, where the weights are
/// of no use.
#[inline(always)]
fn vertex_face<N: Number>(corners: [N::Vector; 4]) -> ([N; 4], N) {
    let [p, a, b, c] = corners;
    let (ab, ac, ap) = (b - a, c - a, p - a);
    let (ab2, ac2): (N, N) = (ab.dot(ab), ac.dot(ac));
    let normal = ab.cross(ac);
    let most = ab2 * ac2;
    let (zero, one) = (most.same(0.0), most.same(1.0));
    let is_line = normal.dot(normal).within(most * 1e-20);
    let (d1, d2) = (ab.dot(ap), ac.dot(ap));
    let bp = p - b;
    let (d3, d4) = (ab.dot(bp), ac.dot(bp));
    let cp = p - c;
    let (d5, d6) = (ab.dot(cp), ac.dot(cp));
    let vc = d1 * d4 - d3 * d2;
    let vb = d5 * d2 - d1 * d6;
    let va = d3 * d6 - d5 * d4;
    // Weights of b and c; that of a is what they leave. The last region that holds is overwritten by the
    // first, as the reference leaves by the first.
    let all = va + vb + vc;
    let (v, w) = (ratio(vb, all), ratio(vc, all));
    let mut weights = [v + w - one, -v, -w];
    let mut put = |mask: N::Mask, to: [N; 3]| {
        for (own, to) in weights.iter_mut().zip(to) {
            *own = N::pick(mask, to, *own);
        }
    };
    let t = ratio(d4 - d3, (d4 - d3) + (d5 - d6));
    put(
        zero.both(va.within(zero), zero.both(d3.within(d4), d6.within(d5))),
        [zero, t - one, -t],
    );
    let t = ratio(d2, d2 - d6);
    put(
        zero.both(vb.within(zero), zero.both(zero.within(d2), d6.within(zero))),
        [t - one, zero, -t],
    );
    put(
        zero.both(zero.within(d6), d5.within(d6)),
        [zero, zero, -one],
    );
    let t = ratio(d1, d1 - d3);
    put(
        zero.both(vc.within(zero), zero.both(zero.within(d1), d3.within(zero))),
        [t - one, -t, zero],
    );
    put(
        zero.both(zero.within(d3), d4.within(d3)),
        [zero, -one, zero],
    );
    put(
        zero.both(d1.within(zero), d2.within(zero)),
        [-one, zero, zero],
    );
    let [u, v, w] = weights;
    ([one, u, v, w], N::pick(is_line, one, zero))
}

/// As `closest::edge_edge`.
#[inline(always)]
fn edge_edge<N: Number>(corners: [N::Vector; 4]) -> [N; 4] {
    let [a, b, c, d] = corners;
    let (u, v, r) = (b - a, d - c, a - c);
    let (uu, vv, uv): (N, N, N) = (u.dot(u), v.dot(v), u.dot(v));
    let (ur, vr) = (u.dot(r), v.dot(r));
    let (zero, one) = (uu.same(0.0), uu.same(1.0));
    // The ends, each against the other edge.
    let ends = [
        (zero, ratio(vr, vv)),
        (one, ratio(vr + uv, vv)),
        (ratio(-ur, uu), zero),
        (ratio(uv - ur, uu), one),
    ];
    let (mut s, mut t, mut least) = (zero, zero, zero.same(f64::INFINITY));
    for (own, other) in ends {
        let apart = r + u * own - v * other;
        let distance: N = apart.dot(apart);
        let is_less = distance.below(least);
        s = N::pick(is_less, own, s);
        t = N::pick(is_less, other, t);
        least = N::pick(is_less, distance, least);
    }
    // The closest points of the two lines, where both lie within.
    let area = uu * vv - uv * uv;
    let own = (uv * vr - vv * ur) / area;
    let other = (uu * vr - uv * ur) / area;
    let is_within = zero.both(
        zero.both(zero.within(own), own.within(one)),
        zero.both(zero.within(other), other.within(one)),
    );
    let is_inside = zero.both((uu * 1e-24 * vv).below(area), is_within);
    let own = ratio(uv * other - ur, uu);
    let other = ratio(uv * own + vr, vv);
    s = N::pick(is_inside, own, s);
    t = N::pick(is_inside, other, t);
    [one - s, s, t - one, -t]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Pair, Path};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Pairs of points on a lattice and off it: parallel and crossing edges, closest points at corners, on
    /// sides and inside, lines in place of faces, features that meet.
    #[test]
    fn eight_pairs_give_the_bits_of_one_after_the_other() {
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        for round in 0..4000 {
            let kind = [Kind::VertexFace, Kind::EdgeEdge][round % 2];
            let is_lattice = round % 3 == 0;
            let mut points = || -> Vec<DVec3> {
                let mut number = || {
                    if is_lattice {
                        f64::from(rng.random_range(-1_i32..2))
                    } else {
                        rng.random_range(-1.0..1.0)
                    }
                };
                (0..12)
                    .map(|_| DVec3::new(number(), number(), number()))
                    .collect()
            };
            let (from, to) = (points(), points());
            let corners: [[u32; 4]; GROUP] = std::array::from_fn(|lane| {
                std::array::from_fn(|k| ((5 * lane + 3 * k + round) % 12) as u32)
            });
            let gaps = gaps(kind, &corners, &from);
            for lane in 0..GROUP {
                let pair = Pair {
                    kind,
                    first: 0,
                    second: 0,
                    corners: corners[lane],
                };
                let path = Path {
                    from: pair.places(&from),
                    to: pair.places(&to),
                };
                let gap = closest::gap(kind, path.from);
                assert_eq!(gaps.distance[lane].to_bits(), gap.distance.to_bits());
                assert_eq!(
                    gaps.weights.map(|row| row[lane]),
                    gap.weights,
                    "{kind:?} {path:?}"
                );
                let normal = gaps.normal.map(|row| row[lane]);
                assert_eq!(normal, gap.normal.to_array());
                assert_eq!(
                    gaps.extent[lane],
                    crate::extent(kind, path.from, gap.normal)
                );
            }
        }
    }
}
