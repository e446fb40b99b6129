//! Constrained Delaunay triangulation of a sheet, and the relaxation that makes it even.
//!
//! In a relaxation step each inner vertex moves to the mean of the circumcentres of its faces,
//! weighted by their areas (Chen and Holst 2011, Efficient mesh optimization schemes based on
//! optimal Delaunay triangulations, §3: the minimum of the interpolation error of x² over the
//! vertex's star), over the fourth power of the spacing where it is graded, and all is
//! triangulated anew. Like Lloyd's iteration it comes near equal spacing
//! without lining vertices up. No mathematical library is called: results are the same everywhere.

use std::collections::BTreeSet;

use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use spade::{ConstrainedDelaunayTriangulation, Point2, Triangulation};

use super::boundary::{Boundary, is_within};
use super::shapes::Cut;
use crate::error::SceneError;
use crate::geometry::signed_area_2d;
use crate::geometry::unit;

/// Relaxation steps between two looks at the faces.
const ROUND: usize = 6;
/// Looks at most: what is not mended by then is as good as this outline and count allow.
const MOST_ROUNDS: usize = 20;
/// Cosine of 30°, the smallest angle that the relaxation aims at.
const LARGEST_COSINE: f64 = 0.866_025_403_784_438_6;
/// Range of edge lengths that the relaxation aims at, in mean edge lengths.
const EDGE_RANGE: std::ops::RangeInclusive<f64> = 0.6..=1.5;
/// Largest shake of the vertices of a bad face along each axis, in mean edge lengths.
const SHAKE: f64 = 0.3;

/// The boundary's points and then the `inside` ones, relaxed within a cut.
///
/// Faces that are bad after a round of steps belong to a defect that further steps would keep:
/// their inner vertices are shaken, and the sheet is relaxed again. The best round wins.
pub(super) fn relaxed(
    cut: &Cut,
    boundary: &Boundary,
    inside: Vec<DVec2>,
    rng: &mut ChaCha8Rng,
) -> Result<Vec<DVec2>, SceneError> {
    let first_inner = boundary.points.len();
    let mut points = boundary.points.clone();
    points.extend(inside);
    let mut faces = triangulate(&points, &boundary.segments)?;
    let (mut best, mut fewest_bad) = (points.clone(), usize::MAX);
    for _ in 0..MOST_ROUNDS {
        for _ in 0..ROUND {
            relax_once(cut, &mut points, &faces, first_inner);
            faces = triangulate(&points, &boundary.segments)?;
        }
        let mean = mean_edge(cut, &points, &faces);
        let bad = faces
            .iter()
            .filter(|face| is_bad(cut, corners(&points, face), mean));
        let bad: Vec<&[u32; 3]> = bad.collect();
        if bad.len() < fewest_bad {
            fewest_bad = bad.len();
            best.clone_from(&points);
        }
        if bad.is_empty() {
            break;
        }
        let shaken: BTreeSet<usize> = bad.into_iter().flatten().map(|&v| v as usize).collect();
        for vertex in shaken.into_iter().filter(|&v| v >= first_inner) {
            let shake = DVec2::new(unit(rng) - 0.5, unit(rng) - 0.5);
            let most = 2.0 * SHAKE * mean * cut.part(points[vertex]);
            move_within(&cut.loops, &mut points[vertex], most * shake);
        }
        faces = triangulate(&points, &boundary.segments)?;
    }
    Ok(best)
}

fn move_within(loops: &[Vec<DVec2>], point: &mut DVec2, step: DVec2) {
    if is_within(loops, *point + step) {
        *point += step;
    }
}

fn corners(points: &[DVec2], face: &[u32; 3]) -> [DVec2; 3] {
    face.map(|v| points[v as usize])
}

/// The spacing in the middle of a face, over that of an even mesh.
fn at_middle(cut: &Cut, [a, b, c]: [DVec2; 3]) -> f64 {
    cut.part((a + b + c) / 3.0)
}

fn mean_edge(cut: &Cut, points: &[DVec2], faces: &[[u32; 3]]) -> f64 {
    let mut sum = 0.0;
    for face in faces {
        let [a, b, c] = corners(points, face);
        sum += (a.distance(b) + b.distance(c) + c.distance(a)) / at_middle(cut, [a, b, c]);
    }
    sum / (3 * faces.len()) as f64
}

fn is_bad(cut: &Cut, corners: [DVec2; 3], mean: f64) -> bool {
    let mean = mean * at_middle(cut, corners);
    (0..3).any(|k| {
        let to_next = corners[(k + 1) % 3] - corners[k];
        let to_last = corners[(k + 2) % 3] - corners[k];
        let (next, last) = (to_next.length(), to_last.length());
        let pointed = to_next.dot(to_last) > LARGEST_COSINE * next * last;
        pointed || !EDGE_RANGE.contains(&(next / mean))
    })
}

fn relax_once(cut: &Cut, points: &mut [DVec2], faces: &[[u32; 3]], first_inner: usize) {
    let mut sums = vec![(DVec2::ZERO, 0.0); points.len()];
    for face in faces {
        let [a, b, c] = corners(points, face);
        let area = signed_area_2d(a, b, c) / at_middle(cut, [a, b, c]).powi(4);
        let offset = area * circumcenter(a, b, c);
        for vertex in face {
            let (sum, weight) = &mut sums[*vertex as usize];
            *sum += offset;
            *weight += area;
        }
    }
    for (point, (sum, weight)) in points.iter_mut().zip(sums).skip(first_inner) {
        let step = sum / weight - *point;
        move_within(&cut.loops, point, step);
    }
}

/// The point as far from `a` as from `b` and `c`.
fn circumcenter(a: DVec2, b: DVec2, c: DVec2) -> DVec2 {
    let (ab, ac) = (b - a, c - a);
    let (b2, c2) = (ab.length_squared(), ac.length_squared());
    let offset = DVec2::new(ac.y * b2 - ab.y * c2, ab.x * c2 - ac.x * b2);
    a + offset / (2.0 * ab.perp_dot(ac))
}

/// The triangles within the outline, counter-clockwise, each from its smallest vertex, in order,
/// `[faces, 3]`.
pub(super) fn triangulate(
    points: &[DVec2],
    segments: &[[usize; 2]],
) -> Result<Vec<[u32; 3]>, SceneError> {
    type Cdt = ConstrainedDelaunayTriangulation<Point2<f64>>;
    let failed = |why: String| SceneError(format!("the sheet cannot be triangulated: {why}"));
    let vertices = points.iter().map(|p| Point2::new(p.x, p.y)).collect();
    let mut crossings = 0;
    let cdt = Cdt::try_bulk_load_cdt(vertices, segments.to_vec(), |_| crossings += 1)
        .map_err(|error| failed(error.to_string()))?;
    if crossings > 0 {
        return Err(failed("the outline crosses itself".into()));
    }
    if cdt.num_vertices() != points.len() {
        return Err(failed("two vertices fell on one place".into()));
    }
    let within = faces_within(&cdt);
    let mut faces: Vec<[u32; 3]> = cdt
        .inner_faces()
        .filter(|face| within[face.fix().index()])
        .map(|face| {
            let mut corners = face.vertices().map(|v| v.index() as u32);
            let smallest = (0..3).min_by_key(|&k| corners[k]).unwrap_or(0);
            corners.rotate_left(smallest);
            corners
        })
        .collect();
    faces.sort_unstable();
    Ok(faces)
}

/// Marks the faces, by index, that lie within the outline: the outer face does not, and crossing a
/// segment of the outline changes sides.
fn faces_within(cdt: &ConstrainedDelaunayTriangulation<Point2<f64>>) -> Vec<bool> {
    let mut neighbours: Vec<Vec<(usize, bool)>> = vec![Vec::new(); cdt.num_all_faces()];
    for edge in cdt.undirected_edges() {
        let [left, right] =
            [edge.as_directed(), edge.as_directed().rev()].map(|side| side.face().fix().index());
        let crosses = edge.is_constraint_edge();
        neighbours[left].push((right, crosses));
        neighbours[right].push((left, crosses));
    }
    let mut within: Vec<Option<bool>> = vec![None; neighbours.len()];
    let outer = cdt.outer_face().fix().index();
    within[outer] = Some(false);
    let mut pending = vec![(outer, false)];
    while let Some((face, inside)) = pending.pop() {
        for &(next, crosses) in &neighbours[face] {
            if within[next].is_none() {
                within[next] = Some(inside != crosses);
                pending.push((next, inside != crosses));
            }
        }
    }
    within
        .into_iter()
        .map(|inside| inside == Some(true))
        .collect()
}
