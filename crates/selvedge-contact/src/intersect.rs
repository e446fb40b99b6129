//! The exact test: faces of a mesh that meet at given positions, decided by the signs of
//! determinants without rounding (Shewchuk 1997).

use glam::DVec3;
use robust::{Coord, Coord3D, orient2d, orient3d};

use crate::boxes::{Apart, Bounds};
use crate::candidates::Candidates;
use crate::closest::gap;
use crate::collision_mesh::CollisionMesh;
use crate::pair::Kind;

/// Two faces that meet.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct Intersection {
    /// The two faces, numbered as in the mesh, the smaller first.
    pub faces: [u32; 2],
}

impl Candidates {
    /// All faces of the cloth that meet another face of the cloth, where it touches itself, or of
    /// an obstacle, at `points` `[m]`, in ascending order, but for contact that is released. Faces with a common vertex meet where
    /// they do so elsewhere too.
    pub fn intersections(&self, mesh: &CollisionMesh, points: &[DVec3]) -> Vec<Intersection> {
        let corners = |face: u32| mesh.faces()[face as usize];
        let mut found = Vec::new();
        let mut test = |a: u32, b: u32, _| {
            let [of_a, of_b] = [a, b].map(corners);
            let radius = mesh.radii()[of_b[0] as usize];
            let meet = if radius > 0.0 {
                comes_within(radius, points, of_a, of_b)
            } else {
                triangles_meet(points, of_a, of_b)
            };
            if meet && !self.released().frees(mesh, &corners(a), &corners(b)) {
                let faces = [a.min(b), a.max(b)];
                found.push(Intersection { faces });
            }
        };
        let trees = self.trees_around(|face| {
            let [a, b, c] = corners(face)
                .map(|p| Bounds::of(points[p as usize]).widened(mesh.radii()[p as usize]));
            a.around(b).around(c)
        });
        if let Some((cloth, obstacles)) = trees.split_first() {
            if self.touches_itself() {
                cloth.own_pairs(true, |_, _| Apart::Never, &mut test);
            }
            for obstacle in obstacles {
                cloth.pairs(obstacle, true, &mut test);
            }
        }
        found.sort_unstable();
        found
    }
}

/// Returns true if a triangle comes nearer than a `radius` `[m]` to a core, a point or a segment among
/// `points`.
fn comes_within(radius: f64, points: &[DVec3], triangle: [u32; 3], core: [u32; 3]) -> bool {
    let [a, b, c] = triangle.map(|p| points[p as usize]);
    let [p, q, _] = core.map(|p| points[p as usize]);
    let is_near = |kind, corners| gap(kind, corners).distance < radius;
    let ends = [p, q].map(|end| sign(a, b, c, end));
    [p, q]
        .into_iter()
        .any(|end| is_near(Kind::VertexFace, [end, a, b, c]))
        || [(a, b), (b, c), (c, a)]
            .into_iter()
            .any(|(from, to)| is_near(Kind::EdgeEdge, [p, q, from, to]))
        || p != q && segment_meets([p, q], ends, [a, b, c])
}

/// Returns true if two triangles among `points` meet, exactly. Of triangles with a common vertex,
/// only what they have in common beside it counts; with three common vertices they always meet.
pub fn triangles_meet(points: &[DVec3], first: [u32; 3], second: [u32; 3]) -> bool {
    let place = |corner: u32| points[corner as usize];
    let (a, b) = (first.map(place), second.map(place));
    let common = first.map(|p| second.contains(&p));
    let of_first = |wanted: bool| (0..3).find(|k| common[*k] == wanted);
    let of_second = |wanted: bool| (0..3).find(|k| first.contains(&second[*k]) == wanted);
    match common.iter().filter(|c| **c).count() {
        0 => meet_apart(a, b),
        1 => {
            let (Some(k), Some(l)) = (of_first(true), of_second(true)) else {
                return true;
            };
            meet_beside_corner(a, k, b, l)
        }
        2 => {
            let (Some(k), Some(l)) = (of_first(false), of_second(false)) else {
                return true;
            };
            let (from, to, p, q) = (a[(k + 1) % 3], a[(k + 2) % 3], a[k], b[l]);
            // Faces that a fold has not closed are told apart without the sum of a flat one's sign.
            same_side(from, to, p, q) && sign(from, to, p, q) == 0.0
        }
        _ => true,
    }
}

/// Returns true if the direction between the middles of two sets of `corners` has all of the one beyond
/// all of the other, and where they have a corner in common beyond `common` too, by more than rounding:
/// the signs of flat neighbours are sums of many terms.
fn are_beyond(first: &[DVec3], second: &[DVec3], common: Option<DVec3>) -> bool {
    let origin = common.unwrap_or(first[0]);
    let middle = |of: &[DVec3]| of.iter().map(|p| *p - origin).sum::<DVec3>() / of.len() as f64;
    let direction = middle(first) - middle(second);
    let along = |of: &[DVec3]| {
        let all = of.iter().map(|p| direction.dot(*p - origin));
        all.fold([f64::INFINITY, f64::NEG_INFINITY], |[least, most], at| {
            [least.min(at), most.max(at)]
        })
    };
    let ([least, _], [_, most]) = (along(first), along(second));
    let size = |of: &[DVec3]| {
        let squares = of.iter().map(|p| (*p - origin).length_squared());
        squares.fold(direction.length_squared(), f64::max)
    };
    let rounding = 1e-12 * size(first).max(size(second));
    match common {
        None => least - most > rounding,
        Some(_) => least > rounding && most < -rounding,
    }
}

/// Triangles without a common corner. Most pairs are told apart by the plane of one of them.
fn meet_apart(a: [DVec3; 3], b: [DVec3; 3]) -> bool {
    if are_beyond(&a, &b, None) {
        return false;
    }
    let of_a = a.map(|p| sign(b[0], b[1], b[2], p));
    if are_on_one_side(&of_a) {
        return false;
    }
    let of_b = b.map(|p| sign(a[0], a[1], a[2], p));
    if are_on_one_side(&of_b) {
        return false;
    }
    let side_meets = |of: [DVec3; 3], signs: [f64; 3], other: [DVec3; 3]| {
        (0..3).any(|k| {
            let l = (k + 1) % 3;
            segment_meets([of[k], of[l]], [signs[k], signs[l]], other)
        })
    };
    side_meets(a, of_a, b) || side_meets(b, of_b, a)
}

/// Triangles whose corners `a[k]` and `b[l]` are one.
fn meet_beside_corner(a: [DVec3; 3], k: usize, b: [DVec3; 3], l: usize) -> bool {
    let others = |of: [DVec3; 3], corner: usize| [of[(corner + 1) % 3], of[(corner + 2) % 3]];
    if are_beyond(&others(a, k), &others(b, l), Some(a[k])) {
        return false;
    }
    let opposite = |of: [DVec3; 3], corner: usize, other: [DVec3; 3]| {
        let side = [of[(corner + 1) % 3], of[(corner + 2) % 3]];
        let signs = side.map(|p| sign(other[0], other[1], other[2], p));
        (side, signs)
    };
    let (side_a, of_a) = opposite(a, k, b);
    if are_on_one_side(&of_a) {
        return false;
    }
    let (side_b, of_b) = opposite(b, l, a);
    !are_on_one_side(&of_b) && (segment_meets(side_a, of_a, b) || segment_meets(side_b, of_b, a))
}

/// Returns true if no sign is zero and none differs from another.
fn are_on_one_side(signs: &[f64]) -> bool {
    signs.iter().all(|s| *s > 0.0) || signs.iter().all(|s| *s < 0.0)
}

/// Side of the plane a, b, c on which d lies.
fn sign(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> f64 {
    let coordinates = |p: DVec3| Coord3D {
        x: p.x,
        y: p.y,
        z: p.z,
    };
    orient3d(
        coordinates(a),
        coordinates(b),
        coordinates(c),
        coordinates(d),
    )
}

/// Returns true if a segment and a triangle have a point in common. `signs` are the sides of the
/// triangle's plane on which the segment ends.
fn segment_meets(segment: [DVec3; 2], signs: [f64; 2], triangle: [DVec3; 3]) -> bool {
    let ([p, q], [a, b, c]) = (segment, triangle);
    if are_on_one_side(&signs) {
        return false;
    }
    if signs == [0.0; 2] {
        return (0..3).any(|axis| is_flat_meeting(segment, triangle, axis));
    }
    let sides = [sign(p, q, a, b), sign(p, q, b, c), sign(p, q, c, a)];
    sides.iter().all(|s| *s >= 0.0) || sides.iter().all(|s| *s <= 0.0)
}

/// Returns true if a segment and a triangle in one plane meet, seen along `axis`, along which the
/// triangle must have an area.
fn is_flat_meeting(segment: [DVec3; 2], triangle: [DVec3; 3], axis: usize) -> bool {
    let flat = |p: DVec3| Coord {
        x: p[(axis + 1) % 3],
        y: p[(axis + 2) % 3],
    };
    let ([p, q], [a, b, c]) = (segment.map(flat), triangle.map(flat));
    let turn = orient2d(a, b, c);
    if turn == 0.0 {
        return false;
    }
    let is_within = |point: Coord<f64>| {
        [(a, b), (b, c), (c, a)]
            .into_iter()
            .all(|(from, to)| orient2d(from, to, point) * turn.signum() >= 0.0)
    };
    let crosses = |from: Coord<f64>, to: Coord<f64>| {
        let (s, t) = (orient2d(p, q, from), orient2d(p, q, to));
        let (u, v) = (orient2d(from, to, p), orient2d(from, to, q));
        let differ = |s: f64, t: f64| (s >= 0.0 && t <= 0.0) || (s <= 0.0 && t >= 0.0);
        differ(s, t) && differ(u, v) && !(s == 0.0 && t == 0.0)
    };
    is_within(p) || is_within(q) || crosses(a, b) || crosses(b, c) || crosses(c, a)
}

/// Returns true if p and q, in one plane with a line, lie on the same side of it.
fn same_side(from: DVec3, to: DVec3, p: DVec3, q: DVec3) -> bool {
    (0..3).any(|axis| {
        let flat = |p: DVec3| Coord {
            x: p[(axis + 1) % 3],
            y: p[(axis + 2) % 3],
        };
        let side = |p: DVec3| orient2d(flat(from), flat(to), flat(p));
        side(p) * side(q) > 0.0
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// A vector of whole numbers, for which all products are exact.
    type Whole = [i128; 3];

    /// Random points on a grid of this size, or in its plane.
    fn draw<const N: usize>(rng: &mut ChaCha8Rng, size: i32, is_flat: bool) -> [Whole; N] {
        [0; N].map(|_| {
            let mut p: Whole = [0; 3].map(|_| i128::from(rng.random_range(-size..=size)));
            p[2] *= i128::from(!is_flat);
            p
        })
    }

    /// Whether two triangles of these corners meet, whichever is the first.
    fn meet(corners: &[Whole], first: [u32; 3], second: [u32; 3]) -> bool {
        let place = |p: &Whole| DVec3::from_array(p.map(|x| x as f64 * 0.25));
        let places: Vec<DVec3> = corners.iter().map(place).collect();
        let found = triangles_meet(&places, first, second);
        assert_eq!(found, triangles_meet(&places, second, first));
        found
    }

    fn minus(a: Whole, b: Whole) -> Whole {
        [a[0] - b[0], a[1] - b[1], a[2] - b[2]]
    }

    fn cross(a: Whole, b: Whole) -> Whole {
        [
            a[1] * b[2] - a[2] * b[1],
            a[2] * b[0] - a[0] * b[2],
            a[0] * b[1] - a[1] * b[0],
        ]
    }

    fn dot(a: Whole, b: Whole) -> i128 {
        a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
    }

    /// By axes of separation, in whole numbers: two convex bodies are apart if and only if one of
    /// these directions separates them strictly.
    fn meet_by_axes(a: [Whole; 3], b: [Whole; 3]) -> bool {
        let sides = |t: [Whole; 3]| [minus(t[1], t[0]), minus(t[2], t[1]), minus(t[0], t[2])];
        let (own, others) = (sides(a), sides(b));
        let normals = [cross(own[0], own[1]), cross(others[0], others[1])];
        let mut axes: Vec<Whole> = normals.to_vec();
        for left in own {
            for right in others {
                axes.push(cross(left, right));
            }
        }
        for normal in normals {
            axes.extend(own.iter().chain(&others).map(|side| cross(normal, *side)));
        }
        let apart = |axis: &Whole| {
            let of = |t: [Whole; 3]| t.map(|p| dot(p, *axis));
            let (left, right) = (of(a), of(b));
            left.iter().max() < right.iter().min() || right.iter().max() < left.iter().min()
        };
        !axes.iter().any(apart)
    }

    /// Random triangles on a small grid, where points fall on planes and lines all the time.
    #[test]
    fn signs_agree_with_whole_numbers() {
        let mut rng = ChaCha8Rng::seed_from_u64(7);
        let (mut meeting, mut tested) = (0, 0);
        while tested < 100_000 {
            let corners: [Whole; 6] = draw(&mut rng, [2, 3, 6, 1000][tested % 4], tested % 8 == 3);
            let [a, b, c, d, e, f] = corners;
            let has_area = |a, b, c| cross(minus(b, a), minus(c, a)) != [0; 3];
            if !has_area(a, b, c) || !has_area(d, e, f) {
                continue;
            }
            let found = meet(&corners, [0, 1, 2], [3, 4, 5]);
            assert_eq!(found, meet_by_axes([a, b, c], [d, e, f]), "{corners:?}");
            tested += 1;
            meeting += i32::from(found);
        }
        assert!((10_000..90_000).contains(&meeting), "{meeting}");
    }

    /// The parts of two cones with a common tip, each between two directions, have one in common.
    fn cones_meet(a: [Whole; 2], b: [Whole; 2]) -> bool {
        let normals = [cross(a[0], a[1]), cross(b[0], b[1])];
        let line = cross(normals[0], normals[1]);
        let within = |cone: [Whole; 2], normal: Whole, v: Whole| {
            dot(cross(cone[0], v), normal) >= 0 && dot(cross(v, cone[1]), normal) >= 0
        };
        if line == [0; 3] {
            let in_a = b.iter().any(|v| within(a, normals[0], *v));
            return in_a || a.iter().any(|v| within(b, normals[1], *v));
        }
        let back = line.map(|x| -x);
        [line, back]
            .into_iter()
            .any(|v| within(a, normals[0], v) && within(b, normals[1], v))
    }

    /// As above, with a common corner, or a common side: what two triangles have in common beside
    /// a corner is seen from that corner.
    #[test]
    fn signs_of_neighbours_agree_with_whole_numbers() {
        let mut rng = ChaCha8Rng::seed_from_u64(8);
        let (mut meeting, mut tested) = (0, 0);
        while tested < 100_000 {
            let shares_side = tested % 3 == 0;
            let size = [1, 2, 5, 1000][tested % 4];
            let [tip, a, b, c, mut d] = draw(&mut rng, size, tested % 8 == 3);
            if shares_side {
                d = a;
            }
            let [u, v, w, x] = [a, b, c, d].map(|p| minus(p, tip));
            if cross(u, v) == [0; 3] || cross(w, x) == [0; 3] {
                continue;
            }
            let corners = [tip, a, b, c, d];
            let (found, expected) = if shares_side {
                let (own, other) = (cross(u, v), cross(u, w));
                let folded = cross(own, other) == [0; 3] && dot(own, other) > 0;
                (meet(&corners, [0, 1, 2], [3, 0, 1]), folded)
            } else {
                let expected = cones_meet([u, v], [w, x]);
                (meet(&corners, [0, 1, 2], [3, 4, 0]), expected)
            };
            assert_eq!(
                found, expected,
                "{shares_side} {tip:?} {a:?} {b:?} {c:?} {d:?}"
            );
            tested += 1;
            meeting += i32::from(found);
        }
        assert!((10_000..90_000).contains(&meeting), "{meeting}");
    }
}
