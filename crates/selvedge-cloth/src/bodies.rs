//! Meshes of simple bodies: points and faces that turn counter-clockwise seen from outside.

use std::collections::BTreeMap;
use std::f64::consts::{FRAC_PI_2, PI, TAU};

use glam::DVec3;

use crate::geometry::sin_cos;

/// Points `[m]` and the faces between them.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Body {
    /// Positions `[m]`, `[points]`.
    pub points: Vec<DVec3>,
    /// Corners of every face, `[faces, 3]`.
    pub faces: Vec<[u32; 3]>,
    /// What the mesh only draws, where the body is round.
    pub core: Option<Core>,
}

/// The middle of a round body, which is all that is within `radius` of it: of a sphere a point, of a
/// capsule a segment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Core {
    /// Both ends `[m]`; the same of a sphere.
    pub ends: [DVec3; 2],
    /// Radius around it `[m]`.
    pub radius: f64,
}

impl Body {
    /// A body of this mesh, which is not round: `[points]` `[m]`, and corners of its faces.
    pub fn of(points: Vec<DVec3>, faces: Vec<[u32; 3]>) -> Self {
        Self {
            points,
            faces,
            core: None,
        }
    }

    /// The body where `place` takes its points: a similarity that multiplies lengths by `scale`.
    pub fn placed(mut self, scale: f64, place: impl Fn(DVec3) -> DVec3) -> Self {
        for point in &mut self.points {
            *point = place(*point);
        }
        self.core = self.core.map(|core| Core {
            ends: core.ends.map(&place),
            radius: core.radius * scale,
        });
        self
    }
}

impl Core {
    /// Number of its points: those of contact with the body.
    pub fn point_count(&self) -> usize {
        1 + usize::from(self.ends[0] != self.ends[1])
    }
}

/// Two triangles: a rectangle with these sides along x and z `[m]` about the origin, seen from
/// above.
pub fn plane([width, depth]: [f64; 2]) -> Body {
    let corner = |[x, z]: [f64; 2]| DVec3::new(0.5 * width * x, 0.0, 0.5 * depth * z);
    let corners = [[-1.0, -1.0], [-1.0, 1.0], [1.0, 1.0], [1.0, -1.0]].map(corner);
    Body::of(corners.to_vec(), vec![[0, 1, 2], [0, 2, 3]])
}

/// A box with these sides `[m]` about the origin.
pub fn cuboid(sides: DVec3) -> Body {
    let sign = |bit: u32| if bit == 0 { -0.5 } else { 0.5 };
    let corner = |k: u32| DVec3::new(sign(k & 1), sign(k >> 1 & 1), sign(k >> 2)) * sides;
    let quads: [[u32; 4]; 6] = [
        [0, 4, 6, 2],
        [1, 3, 7, 5],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 2, 3, 1],
        [4, 5, 7, 6],
    ];
    let triangles = quads.map(|[a, b, c, d]| [[a, b, c], [a, c, d]]);
    Body::of((0..8).map(corner).collect(), triangles.concat())
}

/// Longest edge of the finest [`sphere`] in radii: an icosahedron whose edges were halved six times.
pub const FINEST_SPHERE: f64 = 0.0207;

/// Edges at most around a [`capsule`] or [`cylinder`], and along it.
pub const MOST_PIECES: usize = 256;

/// A sphere of `radius` `[m]` about the origin: an icosahedron whose edges are halved until none is
/// longer than `edge` `[m]`, six times at most ([`FINEST_SPHERE`]). Its points lie on the sphere.
pub fn sphere(radius: f64, edge: f64) -> Body {
    let mut body = icosahedron();
    // An edge of the icosahedron in a unit sphere, and how short halving makes it at most.
    let mut longest = 1.052 * radius;
    for _ in 0..6 {
        if longest <= edge {
            break;
        }
        body = halved(&body);
        // Halves of the first edges swell the most when they are pushed out, by 18 %.
        longest *= 0.588;
    }
    for point in &mut body.points {
        *point *= radius;
    }
    let ends = [DVec3::ZERO; 2];
    body.core = Some(Core { ends, radius });
    body
}

/// A capsule along y about the origin: the points within `radius` of a straight line of `length`
/// `[m]`, cut so that no edge is much longer than `edge` `[m]`.
pub fn capsule(radius: f64, length: f64, edge: f64) -> Body {
    let up = pieces(FRAC_PI_2 * radius, edge, 2);
    let along = pieces(length, edge, 1);
    // Rings from below: of the lower half, of the cylinder, of the upper half.
    let mut rings: Vec<[f64; 2]> = Vec::new();
    let arc = |k: usize| FRAC_PI_2 * k as f64 / up as f64;
    for k in 1..=up {
        let (sine, cosine) = sin_cos(arc(k));
        rings.push([radius * sine, -0.5 * length - radius * cosine]);
    }
    if length > 0.0 {
        let steps = (1..along).map(|k| -0.5 * length + length * k as f64 / along as f64);
        rings.extend(steps.map(|y| [radius, y]));
        rings.push([radius, 0.5 * length]);
    }
    for k in (1..up).rev() {
        let (sine, cosine) = sin_cos(arc(k));
        rings.push([radius * sine, 0.5 * length + radius * cosine]);
    }
    let ends = [-0.5, 0.5].map(|part| DVec3::Y * (part * length));
    Body {
        core: Some(Core { ends, radius }),
        ..turned(&rings, 0.5 * length + radius, pieces(TAU * radius, edge, 8))
    }
}

/// A cylinder of `length` `[m]` along y about the origin, closed by flat ends, cut so that no edge is
/// much longer than `edge` `[m]`.
pub fn cylinder(radius: f64, length: f64, edge: f64) -> Body {
    let out = pieces(radius, edge, 1);
    let along = pieces(length, edge, 1);
    let part = |k: usize, of: usize| k as f64 / of as f64;
    let mut rings: Vec<[f64; 2]> = Vec::new();
    rings.extend((1..=out).map(|k| [radius * part(k, out), -0.5 * length]));
    rings.extend((1..along).map(|k| [radius, length * (part(k, along) - 0.5)]));
    rings.extend(
        (1..=out)
            .rev()
            .map(|k| [radius * part(k, out), 0.5 * length]),
    );
    turned(&rings, 0.5 * length, pieces(TAU * radius, edge, 8))
}

/// Pieces of a `length` that are no longer than `edge` `[m]`, at least `least`.
fn pieces(length: f64, edge: f64, least: usize) -> usize {
    ((length / edge).ceil() as usize).clamp(least, MOST_PIECES)
}

/// A body of `rings` about y from below, each of a radius and a height `[m]` and `around` points,
/// between two points at this distance above and below the origin.
fn turned(rings: &[[f64; 2]], tip: f64, around: usize) -> Body {
    let mut points = vec![DVec3::Y * -tip];
    for (number, [r, y]) in rings.iter().enumerate() {
        points.extend((0..around).map(|k| {
            // Every second ring is turned by half a step, so that triangles are even.
            let angle = TAU * (k as f64 + 0.5 * (number % 2) as f64) / around as f64;
            let (sine, cosine) = sin_cos(angle);
            DVec3::new(r * sine, *y, r * cosine)
        }));
    }
    points.push(DVec3::Y * tip);
    Body::of(points, ring_faces(rings.len(), around))
}

/// Faces of a bottom point, `rings` of `around` points and a top point.
fn ring_faces(rings: usize, around: usize) -> Vec<[u32; 3]> {
    let at = |ring: usize, k: usize| (1 + ring * around + k % around) as u32;
    let top = (1 + rings * around) as u32;
    let mut faces = Vec::new();
    for k in 0..around {
        faces.push([0, at(0, k + 1), at(0, k)]);
        for ring in 1..rings {
            let [a, b] = [at(ring - 1, k), at(ring - 1, k + 1)];
            let [c, d] = [at(ring, k), at(ring, k + 1)];
            // The ring that stands half a step ahead decides the diagonal.
            if ring % 2 == 1 {
                faces.extend([[a, b, c], [c, b, d]]);
            } else {
                faces.extend([[a, b, d], [a, d, c]]);
            }
        }
        faces.push([top, at(rings - 1, k), at(rings - 1, k + 1)]);
    }
    faces
}

/// An icosahedron in the unit sphere.
fn icosahedron() -> Body {
    let mut points = vec![DVec3::Y];
    let height = 1.0 / 5.0_f64.sqrt();
    for (y, turn) in [(height, 0.0), (-height, PI / 5.0)] {
        points.extend((0..5).map(|k| {
            let angle = turn + TAU * f64::from(k) / 5.0;
            let r = 2.0 * height;
            let (sine, cosine) = sin_cos(angle);
            DVec3::new(r * sine, y, r * cosine)
        }));
    }
    points.push(DVec3::NEG_Y);
    let mut faces = Vec::new();
    for k in 0..5 {
        let next = (k + 1) % 5;
        let [upper, upper_next] = [1 + k, 1 + next];
        let [lower, lower_next] = [6 + k, 6 + next];
        faces.extend([
            [0, upper, upper_next],
            [upper, lower, upper_next],
            [upper_next, lower, lower_next],
            [11, lower_next, lower],
        ]);
    }
    Body::of(points, faces)
}

/// Every face in four, with the new points on the unit sphere.
fn halved(body: &Body) -> Body {
    let mut points = body.points.clone();
    let mut middles: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
            let between = points[a as usize] + points[b as usize];
            points.push(between.normalize());
            (points.len() - 1) as u32
        })
    };
    let mut faces = Vec::with_capacity(4 * body.faces.len());
    for &[a, b, c] in &body.faces {
        let [ab, bc, ca] = [middle(a, b), middle(b, c), middle(c, a)];
        faces.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
    }
    Body::of(points, faces)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Volume of a closed mesh whose faces are seen from outside.
    fn volume(body: &Body) -> f64 {
        let of = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|p| body.points[p as usize]);
            a.dot(b.cross(c)) / 6.0
        };
        body.faces.iter().map(of).sum()
    }

    /// Checks that every edge is of two faces that pass it in opposite directions.
    fn assert_closed(body: &Body) {
        let mut sides: BTreeMap<[u32; 2], usize> = BTreeMap::new();
        for face in &body.faces {
            for k in 0..3 {
                *sides.entry([face[k], face[(k + 1) % 3]]).or_default() += 1;
            }
        }
        for ([a, b], count) in &sides {
            assert_eq!((*count, sides.get(&[*b, *a])), (1, Some(&1)), "{a} {b}");
        }
        let edges = sides.len() / 2;
        assert_eq!(body.points.len() + body.faces.len(), edges + 2);
    }

    fn longest(body: &Body) -> f64 {
        let of = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|p| body.points[p as usize]);
            a.distance(b).max(b.distance(c)).max(c.distance(a))
        };
        body.faces.iter().map(of).fold(0.0, f64::max)
    }

    #[test]
    fn closed_bodies_are_closed_and_seen_from_outside() {
        for edge in [1.0, 0.2, 0.05] {
            let ball = sphere(0.4, edge);
            assert_closed(&ball);
            assert!(longest(&ball) <= edge, "{}", longest(&ball));
            assert!(ball.points.iter().all(|p| (p.length() - 0.4).abs() < 1e-15));
            for (radius, length) in [(0.1, 0.5), (0.1, 0.0), (0.02, 1.0)] {
                let made = capsule(radius, length, edge);
                assert_closed(&made);
                let from_line = |p: &DVec3| {
                    let y = p.y.clamp(-0.5 * length, 0.5 * length);
                    (*p - DVec3::Y * y).length() - radius
                };
                assert!(made.points.iter().all(|p| from_line(p).abs() < 1e-15));
            }
        }
        for (edge, part) in [(1.0, 0.85..1.0), (0.05, 0.99..1.0)] {
            let made = cylinder(0.4, 1.5, edge);
            assert_closed(&made);
            let whole = PI * 0.16 * 1.5;
            assert!(part.contains(&(volume(&made) / whole)), "{edge}");
            let [least, greatest] =
                [f64::min, f64::max].map(|of| made.points.iter().map(|p| p.y).fold(0.0, of));
            assert_eq!((least, greatest), (-0.75, 0.75));
        }
        let sides = DVec3::new(1.0, 2.0, 3.0);
        assert_closed(&cuboid(sides));
        assert!((volume(&cuboid(sides)) - 6.0).abs() < 1e-15);
        // Inscribed, so a little smaller than what they stand for.
        let ball = volume(&sphere(1.0, 0.1)) / (4.0 * PI / 3.0);
        assert!((0.99..1.0).contains(&ball), "{ball}");
        let whole = PI * 0.01 * (0.5 + 4.0 / 3.0 * 0.1);
        let made = volume(&capsule(0.1, 0.5, 0.01)) / whole;
        assert!((0.99..1.0).contains(&made), "{made}");
    }

    #[test]
    fn a_plane_is_seen_from_above() {
        let ground = plane([8.0, 2.0]);
        for face in &ground.faces {
            let [a, b, c] = face.map(|p| ground.points[p as usize]);
            assert_eq!((b - a).cross(c - a), DVec3::Y * 16.0);
        }
    }
}
