//! Factors of the stiffness of hinges, once per mesh. With [`even_bending`] a cloth of irregular
//! triangles bends alike in every direction and along its border, as a plate does.
//!
//! [`even_bending`]: selvedge_cloth::PhysicsSettings::even_bending

use glam::DVec2;
use selvedge_cloth::{Edge, EdgeId, EdgeSide, FaceId, Scene};

use crate::lists::Lists;

/// Energy of a plate of Poisson's ratio -1/3, which hinges have, in D/2 per area: coefficients of
/// κuu², κvv², 2 κuu κvv, κuv², 2 κuu κuv and 2 κvv κuv.
const PLATE: [f64; 6] = [1.0, 1.0, -1.0 / 3.0, 8.0 / 3.0, 0.0, 0.0];
/// Sweeps over the six conditions of a vertex: as many as leave little of the error, and factors
/// near 1.
const SWEEPS: usize = 10;
/// Bounds of a factor; and of the mean factor around a vertex: squares with diagonals cannot be even.
const BOUNDS: [f64; 2] = [0.3, 2.0];
const MOST_SHIFT: f64 = 0.3;

/// Energy of a hinge, for an area of one; its factor per area that it answers for; at the edge of a
/// clamp the products of a curvature across it.
type Hinge = ([f64; 6], f64, Option<[f64; 6]>);

/// The factor of each edge of a scene's mesh, `[edges]`: that of its seams, times what makes bending
/// even. Each hinge answers for an equal part of its two faces; of a face that is held at the start
/// for nothing, so that a clamp bends on its free side alone. Around every vertex the factors
/// nearest to 1 are taken with which the hinges of its faces have the energy of a plate for any
/// curvature, beside the edge of a clamp for that across it, the only one that it leaves (Kaczmarz's
/// sweeps); a hinge has the mean of those of its vertices. `[eq:even-bending]`
pub(crate) fn factors(scene: &Scene) -> Vec<f64> {
    let mesh = &scene.mesh;
    let (topology, pattern) = (mesh.topology(), mesh.pattern());
    let of_seam = |edge: &Edge| {
        if pattern.is_seam(edge) { mesh.seam_stiffness() } else { 1.0 }
    };
    let mut factors: Vec<f64> = topology.edges().iter().map(of_seam).collect();
    if !scene.physics.even_bending {
        return factors;
    }
    let faces = topology.face_indices();
    let held = scene.handles.mask(topology.vertex_count());
    let is_free = |corners: &[u32; 3]| !corners.iter().all(|v| held[*v as usize]);
    let bends: Vec<bool> = faces.iter().map(is_free).collect();
    let edges = topology.edges().iter();
    let hinges: Vec<Option<Hinge>> = edges
        .map(|edge| {
            let (left, right) = pattern.sides(edge);
            let right = right.filter(|_| !pattern.is_seam(edge))?;
            let (first, second) = edge.faces;
            let sides = [(left, Some(first)), (right, second)];
            let sides = sides.map(|(side, face)| {
                let share = f64::from(face.is_some_and(|face| bends[face.index()]));
                let area = side.area();
                (turn(side).map(|t| share * t), share * area, area)
            });
            let [(one, one_area, left_area), (other, other_area, right_area)] = sides;
            let free = one_area + other_area;
            if free == 0.0 {
                return None;
            }
            let [u, v, w] = std::array::from_fn(|k| one[k] + other[k]);
            // As soft as ke = 4 D makes it.
            let scale = 3.0 * (left.length() / free).powi(2);
            let energy = [u * u, v * v, u * v, w * w, u * w, v * w];
            let along = (left.ends[1] - left.ends[0]) / left.length();
            let [a, b, c] = [along.y.powi(2), along.x.powi(2), -along.x * along.y];
            let across = [a * a, b * b, 2.0 * a * b, c * c, 2.0 * a * c, 2.0 * b * c];
            Some((
                energy.map(|e| e * scale),
                3.0 * (left_area + right_area) / free.powi(2),
                (one_area.min(other_area) == 0.0).then_some(across),
            ))
        })
        .collect();
    let areas = scene.rest_shape().face_area;
    let is_inner = |e: &&EdgeId| topology.edges()[e.index()].faces.1.is_some();
    let within = topology.face_edges().iter().zip(areas).zip(&bends);
    let part = |((edges, area), bends): ((&[EdgeId; 3], f64), &bool)| {
        let hinges = edges.iter().filter(is_inner).count().max(1);
        if *bends { area / hinges as f64 } else { 0.0 }
    };
    let part: Vec<f64> = within.map(part).collect();
    let of_face = |(face, corners): (u32, &[u32; 3])| corners.map(|v| (v, face));
    let corners: Vec<(u32, u32)> = (0..).zip(&faces).flat_map(of_face).collect();
    let around = Lists::group(topology.vertex_count(), &corners);
    let mut sums = vec![[0.0; 2]; hinges.len()];
    let any: [[f64; 6]; 6] = std::array::from_fn(|k| std::array::from_fn(|n| f64::from(k == n)));
    for vertex in 0..topology.vertex_count() {
        let mut patch: Vec<(usize, f64)> = Vec::new();
        for &face in around.of(vertex).iter().filter(|f| bends[**f as usize]) {
            for edge in topology.face_edges()[face as usize].map(|edge| edge.index()) {
                match patch.iter_mut().find(|(known, _)| *known == edge) {
                    Some((_, area)) => *area += part[face as usize],
                    None if hinges[edge].is_some() => patch.push((edge, part[face as usize])),
                    None => (),
                }
            }
        }
        let clamps = patch.iter().filter_map(|(edge, _)| hinges[*edge]?.2);
        let clamps: Vec<[f64; 6]> = clamps.collect();
        let curvatures = if clamps.is_empty() { &any[..] } else { &clamps };
        let factors = plate_like(&hinges, &patch, curvatures);
        for ((edge, area), factor) in patch.iter().zip(factors) {
            sums[*edge][0] += area * factor;
            sums[*edge][1] += area;
        }
    }
    for (edge, hinge) in hinges.iter().enumerate() {
        if let Some((_, per_area, _)) = hinge {
            let (left, right) = topology.edges()[edge].faces;
            let own = part[left.index()] + right.map_or(0.0, |face: FaceId| part[face.index()]);
            factors[edge] = own * per_area * sums[edge][0] / sums[edge][1];
        }
    }
    factors
}

/// Factors within [`BOUNDS`] with which the hinges of a patch, so much area of each, have the energy of
/// a plate for these sums of products of curvatures.
fn plate_like(hinges: &[Option<Hinge>], patch: &[(usize, f64)], bends: &[[f64; 6]]) -> Vec<f64> {
    let product = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let whole: f64 = patch.iter().map(|(_, area)| area).sum();
    let mut factors = vec![1.0; patch.len()];
    let row = |bend: &[f64; 6]| {
        let energy = |edge: usize| hinges[edge].map_or(0.0, |hinge| product(&hinge.0, bend));
        let parts = patch.iter();
        let parts = parts.map(|(edge, area)| energy(*edge) * area / whole);
        (parts.collect::<Vec<f64>>(), product(&PLATE, bend))
    };
    let rows: Vec<(Vec<f64>, f64)> = bends.iter().map(row).collect();
    for _ in 0..SWEEPS {
        for (row, wanted) in &rows {
            let square = product(row, row).max(f64::MIN_POSITIVE);
            let step = (wanted - product(row, &factors)) / square;
            for (factor, entry) in factors.iter_mut().zip(row) {
                *factor = (*factor + step * entry).clamp(BOUNDS[0], BOUNDS[1]);
            }
        }
    }
    let parts = patch.iter().zip(&factors);
    let shift = parts.map(|((_, area), f)| area * (f - 1.0));
    if shift.sum::<f64>().abs() > MOST_SHIFT * whole {
        factors.fill(1.0);
    }
    factors
}

/// What one face adds to the angle of its edge, of each curvature κuu, κvv, κuv `[m]`: with foot s
/// and height h over an edge l along t, (h κnn + 2 s κtn - s (l - s)/h κtt)/2, n towards the face.
fn turn(side: EdgeSide<DVec2>) -> [f64; 3] {
    let (edge, rise) = (side.ends[1] - side.ends[0], side.opposite - side.ends[0]);
    let length = edge.length();
    let t = edge / length;
    let foot = rise.dot(t);
    let over = rise - t * foot;
    let height = over.length().max(1e-3 * length);
    let n = over / height;
    let curvature = |a: DVec2, b: DVec2| [a.x * b.x, a.y * b.y, a.x * b.y + a.y * b.x];
    let (nn, tn, tt) = (curvature(n, n), curvature(t, n), curvature(t, t));
    let back = foot * (length - foot) / height;
    std::array::from_fn(|k| 0.5 * (height * nn[k] + 2.0 * foot * tn[k] - back * tt[k]))
}
