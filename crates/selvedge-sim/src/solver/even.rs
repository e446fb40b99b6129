//! Factors of the stiffness of hinges, once per mesh. With [`even_bending`] a cloth of irregular
//! triangles bends alike in every direction and along its border, as a plate does.
//!
//! [`even_bending`]: selvedge_cloth::PhysicsSettings::even_bending

use std::array::from_fn;
use std::collections::BTreeSet;

use glam::{DVec2, DVec3};
use selvedge_cloth::{Edge, EdgeId, FaceId, Scene, Topology, VertexId};
use selvedge_contact::number::{Dual, DualVector, Number, Vector};

use crate::lists::Lists;

/// Energy of a plate of Poisson's ratio -1/3, which hinges have, in D/2 per area: coefficients of
/// κuu², κvv², 2 κuu κvv, κuv², 2 κuu κuv and 2 κvv κuv.
const PLATE: [f64; 6] = [1.0, 1.0, -1.0 / 3.0, 8.0 / 3.0, 0.0, 0.0];
/// Sweeps over the six conditions of a vertex: as many as leave little of the error, and factors
/// near 1.
const SWEEPS: usize = 10;
/// Bounds of a factor; and how far the mean factor around a vertex may be from 1: beyond, all there are 1.
const BOUNDS: [f64; 2] = [0.3, 2.0];
const MOST_SHIFT: f64 = 0.6;
/// Square of a patch's energies, over that of a plate, which is small beside any that it can have:
/// where symmetry leaves none, nothing is divided by 0.
const NOTHING: f64 = 1e-6;

/// Points whose derivatives are taken together.
const TOGETHER: usize = 4;

/// Energy of a hinge, for an area of one; its factor per area that it answers for; at the edge of a
/// clamp the products of a curvature across it.
type Hinge<N> = ([N; 6], N, Option<[N; 6]>);

/// The factor of each edge of a scene's mesh, `[edges]`: that of its seams, times what makes bending
/// even. `[eq:even-bending]`
pub(crate) fn factors(scene: &Scene) -> Vec<f64> {
    let points = scene.mesh.pattern().points().iter();
    let points: Vec<DVec3> = points.map(|point| point.extend(0.0)).collect();
    factors_at::<f64>(scene, &points)
}

/// Adds to `by_points` what derivatives by the factors are by the points of the pattern. Points of
/// which no edge has two near it are moved at once.
pub(crate) fn pull_factors(scene: &Scene, by_factors: &[f64], by_points: &mut [DVec2]) {
    if !scene.physics.even_bending {
        return;
    }
    let (topology, pattern) = (scene.mesh.topology(), scene.mesh.pattern());
    let (corners, around) = (topology.face_indices(), faces_around(topology));
    let grown = |faces: Vec<u32>| {
        let vertices = faces.iter().flat_map(|face| corners[*face as usize]);
        let grown: BTreeSet<u32> = vertices
            .flat_map(|v| around.of(v as usize))
            .copied()
            .collect();
        Vec::from_iter(grown)
    };
    let points_near = |edge: &Edge| {
        let faces = [Some(edge.faces.0), edge.faces.1].into_iter().flatten();
        let faces = grown(grown(faces.map(|face| face.0).collect())).into_iter();
        let points = faces.flat_map(|face| pattern.corner_points(FaceId(face)));
        points.map(|point| point as usize).collect()
    };
    let near: Vec<BTreeSet<usize>> = topology.edges().iter().map(points_near).collect();
    let mut edges_near = vec![Vec::new(); by_points.len()];
    for (edge, points) in near.iter().enumerate() {
        points
            .iter()
            .for_each(|point| edges_near[*point].push(edge));
    }
    let mut groups = vec![usize::MAX; by_points.len()];
    for (point, edges) in edges_near.iter().enumerate() {
        let others = edges.iter().flat_map(|edge| &near[*edge]);
        let taken: BTreeSet<usize> = others.map(|other| groups[*other]).collect();
        groups[point] = (0..).find(|group| !taken.contains(group)).unwrap_or(0);
    }
    for first in (0..=groups.iter().copied().max().unwrap_or(0)).step_by(TOGETHER) {
        let place = |(point, group): (&DVec2, &usize)| {
            let rate = |k: usize| [DVec3::X, DVec3::Y][k % 2] * f64::from(first + k / 2 == *group);
            DualVector::<{ 2 * TOGETHER }>::new(point.extend(0.0), from_fn(rate))
        };
        let moved: Vec<_> = pattern.points().iter().zip(&groups).map(place).collect();
        let factors = factors_at::<Dual<{ 2 * TOGETHER }>>(scene, &moved);
        for ((factor, by), near) in factors.iter().zip(by_factors).zip(&near) {
            for &point in near {
                if (first..first + TOGETHER).contains(&groups[point]) {
                    let k = 2 * (groups[point] - first);
                    by_points[point] += DVec2::new(factor.rates[k], factor.rates[k + 1]) * *by;
                }
            }
        }
    }
}

/// The faces around each vertex.
fn faces_around(topology: &Topology) -> Lists {
    let corners = (0..).zip(topology.face_indices());
    let corners = corners.flat_map(|(face, corners)| corners.map(|v| (v, face)));
    Lists::group(topology.vertex_count(), &Vec::from_iter(corners))
}

/// The factors where these are the points of the pattern. Each hinge answers for an equal part of its
/// two faces; of a face that is held at the start for nothing, so that a clamp bends on its free side
/// alone. Around every vertex the factors nearest to 1 are taken with which the hinges of its faces have
/// the energy of a plate for any curvature, beside the edge of a clamp for that across it, the only one
/// that it leaves (Kaczmarz's sweeps); a hinge has the mean of those of its vertices.
fn factors_at<N: Number<Mask = bool>>(scene: &Scene, points: &[N::Vector]) -> Vec<N> {
    let mesh = &scene.mesh;
    let (topology, pattern) = (mesh.topology(), mesh.pattern());
    let zero = points[0].dot(points[0]).same(0.0);
    let of_seam =
        |edge: &Edge| zero.same(if pattern.is_seam(edge) { mesh.seam_stiffness() } else { 1.0 });
    let mut factors: Vec<N> = topology.edges().iter().map(of_seam).collect();
    if !scene.physics.even_bending {
        return factors;
    }
    let held = scene.handles.mask(topology.vertex_count());
    let is_free = |corners: &[u32; 3]| !corners.iter().all(|v| held[*v as usize]);
    let bends: Vec<bool> = topology.face_indices().iter().map(is_free).collect();
    let corners_of = |face: FaceId| pattern.corner_points(face).map(|p| points[p as usize]);
    let side = |edge: &Edge, face: FaceId| {
        let corners = topology.faces()[face.index()].iter();
        let is_end = |v: &VertexId| edge.vertices.iter().position(|end| end == v);
        let mut side = corners_of(face);
        for (corner, end) in corners_of(face).into_iter().zip(corners.map(is_end)) {
            side[end.unwrap_or(2)] = corner;
        }
        side
    };
    let edges = topology.edges().iter();
    let hinges: Vec<Option<Hinge<N>>> = edges
        .map(|edge| {
            let faces = [
                edge.faces.0,
                edge.faces.1.filter(|_| !pattern.is_seam(edge))?,
            ];
            let [one, other] = faces.map(|face| {
                let corners = side(edge, face);
                let share = f64::from(bends[face.index()]);
                (
                    turn::<N>(corners).map(|t| t * share),
                    area::<N>(corners),
                    share,
                )
            });
            let free = one.1 * one.2 + other.1 * other.2;
            if free.within(zero) {
                return None;
            }
            let [u, v, w] = from_fn(|k| one.0[k] + other.0[k]);
            let [from, to, _] = side(edge, faces[0]);
            let length = (to - from).dot(to - from).sqrt();
            // As soft as ke = 4 D makes it.
            let scale = length / free * (length / free) * 3.0;
            let energy = [u * u, v * v, u * v, w * w, u * w, v * w];
            let [x, y, _] = ((to - from) / length).components();
            let [a, b, c] = [y * y, x * x, -(x * y)];
            let across = [a * a, b * b, a * b * 2.0, c * c, a * c * 2.0, b * c * 2.0];
            Some((
                energy.map(|e| e * scale),
                (one.1 + other.1) * 3.0 / (free * free),
                (one.2 * other.2 == 0.0).then_some(across),
            ))
        })
        .collect();
    let is_inner = |e: &&EdgeId| topology.edges()[e.index()].faces.1.is_some();
    let part = |(face, edges): (u32, &[EdgeId; 3])| {
        let hinges = edges.iter().filter(is_inner).count().max(1);
        let share = f64::from(bends[face as usize]) / hinges as f64;
        area::<N>(corners_of(FaceId(face))) * share
    };
    let part: Vec<N> = (0..).zip(topology.face_edges()).map(part).collect();
    let around = faces_around(topology);
    let mut sums = vec![[zero; 2]; hinges.len()];
    let any: [[N; 6]; 6] = from_fn(|k| from_fn(|n| zero.same(f64::from(k == n))));
    for vertex in 0..topology.vertex_count() {
        let mut patch: Vec<(usize, N)> = Vec::new();
        for &face in around.of(vertex).iter().filter(|f| bends[**f as usize]) {
            for edge in topology.face_edges()[face as usize].map(|edge| edge.index()) {
                match patch.iter_mut().find(|(known, _)| *known == edge) {
                    Some((_, area)) => *area = *area + part[face as usize],
                    None if hinges[edge].is_some() => patch.push((edge, part[face as usize])),
                    None => (),
                }
            }
        }
        let clamps = patch.iter().filter_map(|(edge, _)| hinges[*edge]?.2);
        let clamps: Vec<[N; 6]> = clamps.collect();
        let curvatures = if clamps.is_empty() { &any[..] } else { &clamps };
        let factors = plate_like(&hinges, &patch, curvatures, zero);
        for ((edge, area), factor) in patch.iter().zip(factors) {
            let [by_area, whole] = sums[*edge];
            sums[*edge] = [by_area + *area * factor, whole + *area];
        }
    }
    for (edge, hinge) in hinges.iter().enumerate() {
        if let Some((_, per_area, _)) = hinge {
            let (left, right) = topology.edges()[edge].faces;
            let own = part[left.index()] + right.map_or(zero, |face| part[face.index()]);
            factors[edge] = own * *per_area * sums[edge][0] / sums[edge][1];
        }
    }
    factors
}

/// Factors within [`BOUNDS`] with which the hinges of a patch, so much area of each, have the energy of
/// a plate for these sums of products of curvatures.
fn plate_like<N: Number<Mask = bool>>(
    hinges: &[Option<Hinge<N>>],
    patch: &[(usize, N)],
    bends: &[[N; 6]],
    zero: N,
) -> Vec<N> {
    let product = |a: &[N], b: &[N]| a.iter().zip(b).fold(zero, |sum, (a, b)| sum + *a * *b);
    let whole = patch.iter().fold(zero, |sum, (_, area)| sum + *area);
    let mut factors = vec![zero.same(1.0); patch.len()];
    let row = |bend: &[N; 6]| {
        let energy = |edge: usize| hinges[edge].map_or(zero, |hinge| product(&hinge.0, bend));
        let parts = patch.iter();
        let parts = parts.map(|(edge, area)| energy(*edge) * *area / whole);
        let plate = PLATE.map(|entry| zero.same(entry));
        (parts.collect::<Vec<N>>(), product(&plate, bend))
    };
    let rows: Vec<(Vec<N>, N)> = bends.iter().map(row).collect();
    for _ in 0..SWEEPS {
        for (row, wanted) in &rows {
            let step = (*wanted - product(row, &factors)) / (product(row, row) + NOTHING);
            for (factor, entry) in factors.iter_mut().zip(row) {
                let next = *factor + step * *entry;
                *factor = next.at_least(BOUNDS[0]).at_most(BOUNDS[1]);
            }
        }
    }
    let parts = patch.iter().zip(&factors);
    let shift = parts.fold(zero, |sum, ((_, area), f)| sum + *area * (*f - 1.0));
    if (whole * MOST_SHIFT).below(shift.abs()) {
        factors.fill(zero.same(1.0));
    }
    factors
}

/// Area of a face.
fn area<N: Number>([a, b, c]: [N::Vector; 3]) -> N {
    let [.., twice] = (b - a).cross(c - a).components();
    twice.abs() * 0.5
}

/// What one face adds to the angle of its edge, whose ends come before its third corner, of each
/// curvature κuu, κvv, κuv `[m]`: with foot s and height h over an edge l along t,
/// (h κnn + 2 s κtn - s (l - s)/h κtt)/2, n towards the face.
fn turn<N: Number>([from, to, opposite]: [N::Vector; 3]) -> [N; 3] {
    let (edge, rise) = (to - from, opposite - from);
    let length = edge.dot(edge).sqrt();
    let t = edge / length;
    let foot = rise.dot(t);
    let over = rise - t * foot;
    let height = over.dot(over).sqrt().greater(length * 1e-3);
    let [n, t] = [over / height, t].map(Vector::components);
    let curvature = |a: [N; 3], b: [N; 3]| [a[0] * b[0], a[1] * b[1], a[0] * b[1] + a[1] * b[0]];
    let (nn, tn, tt) = (curvature(n, n), curvature(t, n), curvature(t, t));
    let back = foot * (length - foot) / height;
    from_fn(|k| (height * nn[k] + foot * tn[k] * 2.0 - back * tt[k]) * 0.5)
}
