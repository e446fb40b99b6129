//! Untangling: a cloth that meets itself is moved apart before contact begins, which keeps apart
//! only what is apart.
//!
//! Where an edge crosses a face, the curve along which the two layers cross ends at the edge, or
//! goes on in its other face. The edge and the face are moved against each other so that the curve
//! gets shorter (Volino and Magnenat-Thalmann 2006) `[eq:untangle]`, their neighbours with them, and
//! edges near by keep their lengths. Layers in one plane are moved apart along its normal, the later
//! piece to the front. Where all that leads nowhere the cloth around is smoothed, ever farther: what
//! is smooth does not meet itself. Only the exact test says that nothing meets.

use glam::DVec3;
use selvedge_cloth::{Scene, Topology};
use selvedge_contact::{Candidates, CollisionMesh, Intersection};

use super::{FitError, FitProgress, Listener, of_neighbours, springs, tell};
use crate::edges::FreeEdge;

/// Passes at most, those without fewer pairs after which the cloth is smoothed, and times that it
/// is before it is given up.
const PASSES: u32 = 4000;
const PATIENCE: u32 = 60;
const SMOOTHINGS: usize = 10;
/// Way of a vertex in a pass, as a part of the mean edge.
const STEP: f64 = 0.05;
/// Cosine of an edge with the normal of a face that it crosses from which it counts as steeper.
const SLANT: f64 = 0.2;
/// Rings of neighbours that move with what crosses, and the edges of which keep their lengths.
const RINGS: usize = 3;
/// Cosine of two normals from which faces count as being in one plane.
const PARALLEL: f64 = 0.9999;
/// Part of what an edge lacks that it is corrected by in a pass.
const KEEP: f64 = 0.3;
/// Pairs that an error names.
const NAMED: usize = 3;

/// A cloth that no longer meets itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Untangled {
    /// Positions `[m]`, `[vertices]`.
    pub positions: Vec<DVec3>,
    /// Pairs of faces that met at the start.
    pub before: usize,
    /// Vertices that were moved.
    pub moved: usize,
    /// Farthest way of a vertex `[m]`.
    pub farthest: f64,
}

/// Moves the cloth of `scene` apart where it meets itself; its handles stay, and bodies are not
/// looked at.
///
/// # Errors
/// A scene that does not validate; [`FitError::Stopped`]; [`FitError::Tangled`].
pub fn untangle(scene: &Scene, progress: Listener<'_>) -> Result<Untangled, FitError> {
    scene.validate()?;
    let topology = scene.mesh.topology();
    let start = scene.mesh.positions();
    let mut positions = start.to_vec();
    let surface = CollisionMesh::new(topology, &[]);
    let candidates = Candidates::new(&surface, &positions, true);
    let meeting = |positions: &[DVec3]| candidates.intersections(&surface, positions);
    let mut met = meeting(&positions);
    let before = met.len();
    let mut knot = Knot::new(scene);
    let (mut fewest, mut waited, mut smoothed) = (before, 0, 0);
    for number in 0..PASSES {
        if met.is_empty() || smoothed > SMOOTHINGS {
            break;
        }
        tell(
            progress,
            FitProgress {
                done: f64::from(number) / f64::from(PASSES),
                meeting: Some(met.len()),
                ..FitProgress::default()
            },
        )?;
        if waited < PATIENCE {
            knot.shorten(&mut positions, &met);
        } else {
            waited = 0;
            smoothed += 1;
            knot.smooth(&mut positions, &met, RINGS + smoothed);
        }
        met = meeting(&positions);
        waited += 1;
        if met.len() < fewest {
            (fewest, waited, smoothed) = (met.len(), 0, 0);
        }
    }
    if !met.is_empty() {
        return Err(tangled(topology, before, &met));
    }
    let ways = start.iter().zip(&positions).map(|(a, b)| a.distance(*b));
    Ok(Untangled {
        before,
        moved: ways.clone().filter(|way| *way > 0.0).count(),
        farthest: ways.fold(0.0, f64::max),
        positions,
    })
}

fn tangled(topology: &Topology, before: usize, met: &[Intersection]) -> FitError {
    let corners = |face: u32| topology.faces()[face as usize].map(|v| v.to_string());
    let pairs = met.iter().take(NAMED);
    let pairs = pairs.map(|pair| pair.faces.map(|face| corners(face).join("-")));
    let pairs: Vec<String> = pairs.map(|[a, b]| format!("{a} and {b}")).collect();
    FitError::Tangled {
        before,
        left: met.len(),
        pairs: pairs.join(", "),
    }
}

/// What moves where a cloth meets itself.
struct Knot {
    faces: Vec<[u32; 3]>,
    edges: Vec<[usize; 2]>,
    /// Number of the piece of each vertex.
    pieces: Vec<u32>,
    held: Vec<bool>,
    springs: Vec<FreeEdge>,
    /// Way of a vertex in a pass `[m]`.
    step: f64,
    /// Way of each vertex in this pass `[m]`, and the sum of weights.
    ways: Vec<DVec3>,
}

impl Knot {
    fn new(scene: &Scene) -> Self {
        let topology = scene.mesh.topology();
        let start = scene.mesh.positions();
        let mut springs = springs(&scene.mesh, &scene.handles);
        for spring in &mut springs {
            // As it stands, which may be far from its pattern.
            let [a, b] = spring.ends.map(|v| start[v]);
            spring.length = a.distance(b);
        }
        let lengths: f64 = springs.iter().map(|spring| spring.length).sum();
        let edges = topology.edges().iter();
        Self {
            faces: topology.face_indices(),
            pieces: topology.sheets(),
            edges: edges.map(|e| e.vertices.map(|v| v.index())).collect(),
            held: scene.handles.mask(start.len()),
            step: STEP * lengths / (springs.len().max(1)) as f64,
            springs,
            ways: vec![DVec3::ZERO; start.len()],
        }
    }

    /// The vertices within `rings` edges of faces that meet.
    fn near(&self, met: &[Intersection], rings: usize) -> Vec<bool> {
        let mut near = vec![false; self.held.len()];
        for face in met.iter().flat_map(|pair| pair.faces) {
            for v in self.faces[face as usize] {
                near[v as usize] = true;
            }
        }
        for _ in 0..rings {
            let before = near.clone();
            for [a, b] in &self.edges {
                near[*a] |= before[*b];
                near[*b] |= before[*a];
            }
        }
        near
    }

    /// The `values` of vertices, those of free vertices that are `near` the mean of their
    /// neighbours'.
    fn mean(&self, values: &[DVec3], near: &[bool]) -> Vec<DVec3> {
        let mean = |(v, (sum, count)): (usize, (DVec3, u32))| {
            if near[v] && !self.held[v] { sum / f64::from(count) } else { values[v] }
        };
        let sums = of_neighbours(values, &self.edges).into_iter();
        sums.enumerate().map(mean).collect()
    }

    /// Smooths the cloth around faces that meet.
    fn smooth(&self, positions: &mut [DVec3], met: &[Intersection], rings: usize) {
        let near = self.near(met, rings);
        for _ in 0..rings {
            let means = self.mean(positions, &near);
            positions.copy_from_slice(&means);
        }
    }

    /// Moves edges and the faces that they cross so that the curve of their crossings gets shorter.
    fn shorten(&mut self, positions: &mut [DVec3], met: &[Intersection]) {
        self.ways.fill(DVec3::ZERO);
        for pair in met {
            self.part(positions, pair.faces);
            let [a, b] = pair.faces.map(|face| self.faces[face as usize]);
            self.push(positions, a, b);
            self.push(positions, b, a);
        }
        let near = self.near(met, RINGS);
        let mut ways = self.ways.clone();
        for _ in 0..RINGS - 1 {
            let means = self.mean(&ways, &near);
            for (way, mean) in ways.iter_mut().zip(means) {
                *way = 0.5 * (*way + mean);
            }
        }
        let longest = ways.iter().map(|way| way.length()).fold(0.0, f64::max);
        if longest > 0.0 {
            let places = positions.iter_mut().zip(&ways).zip(&self.held);
            for ((place, way), _) in places.filter(|(_, held)| !**held) {
                *place += *way * (self.step / longest);
            }
        }
        let is_near = |spring: &&FreeEdge| spring.ends.iter().all(|v| near[*v]);
        for spring in self.springs.iter().filter(is_near) {
            spring.correct(positions, KEEP);
        }
    }

    /// Adds the ways of two `faces` in one plane: of the later piece along the normal of the other,
    /// or of the later face.
    fn part(&mut self, positions: &[DVec3], faces: [u32; 2]) {
        let [a, b] = faces.map(|face| self.faces[face as usize]);
        let first = normal(positions, a);
        if first.dot(normal(positions, b)).abs() < PARALLEL {
            return;
        }
        let [piece, other] = [a[0], b[0]].map(|v| self.pieces[v as usize]);
        let way = if piece > other { -first } else { first };
        for (v, w) in a.into_iter().zip(b) {
            self.ways[v as usize] -= way;
            self.ways[w as usize] += way;
        }
    }

    /// Adds the ways by which the curve where faces `own` and `other` cross gets shorter the most,
    /// of its ends on edges of `own`.
    fn push(&mut self, positions: &[DVec3], own: [u32; 3], other: [u32; 3]) {
        let (across, own_normal) = (normal(positions, other), normal(positions, own));
        for k in 0..3 {
            let ends = [own[k], own[(k + 1) % 3]];
            if ends.iter().any(|end| other.contains(end)) {
                continue;
            }
            let Some((part, weights)) = crossing(positions, ends, other) else {
                continue;
            };
            let [p, q, third] = [ends[0], ends[1], own[(k + 2) % 3]].map(|v| positions[v as usize]);
            let edge = (q - p).normalize_or_zero();
            // Along the curve, from the edge into its face.
            let mut along = own_normal.cross(across).normalize_or_zero();
            if along.dot(third - p.lerp(q, part)) < 0.0 {
                along = -along;
            }
            let steep = edge.dot(across);
            let steep = steep.abs().max(SLANT).copysign(steep);
            let lift = across * (edge.dot(along) / steep);
            self.ways[ends[0] as usize] += (along - lift) * (1.0 - part);
            self.ways[ends[1] as usize] += (along - lift) * part;
            for (v, weight) in other.into_iter().zip(weights) {
                self.ways[v as usize] += lift * weight;
            }
        }
    }
}

fn normal(positions: &[DVec3], face: [u32; 3]) -> DVec3 {
    let [a, b, c] = face.map(|v| positions[v as usize]);
    (b - a).cross(c - a).normalize_or_zero()
}

/// Where an edge crosses a face: the part of the edge, and the weights of the corners.
fn crossing(positions: &[DVec3], edge: [u32; 2], face: [u32; 3]) -> Option<(f64, [f64; 3])> {
    let [p, q] = edge.map(|v| positions[v as usize]);
    let [a, b, c] = face.map(|v| positions[v as usize]);
    let normal = (b - a).cross(c - a);
    let (from, to) = ((p - a).dot(normal), (q - a).dot(normal));
    let part = from / (from - to);
    if !(0.0..=1.0).contains(&part) {
        return None;
    }
    let place = p.lerp(q, part);
    let area = normal.length_squared();
    let of = |u: DVec3, v: DVec3| (u - place).cross(v - place).dot(normal) / area;
    let weights = [of(b, c), of(c, a), of(a, b)];
    weights.iter().all(|w| *w >= 0.0).then_some((part, weights))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The way of every vertex against the slope of the curve's length, by differences.
    #[test]
    fn ways_are_the_steepest_descent_of_the_length_of_the_crossing() {
        let faces = [[0_u32, 1, 2], [3, 4, 5]];
        let length = |positions: &[DVec3]| {
            let mut ends = Vec::new();
            for [own, other] in [faces, [faces[1], faces[0]]] {
                for k in 0..3 {
                    let edge = [own[k], own[(k + 1) % 3]];
                    let [p, q] = edge.map(|v| positions[v as usize]);
                    ends.extend(crossing(positions, edge, other).map(|(part, _)| p.lerp(q, part)));
                }
            }
            assert_eq!(ends.len(), 2);
            ends[0].distance(ends[1])
        };
        let flat = [(0.0, 0.0, 0.0), (1.0, 0.1, 0.0), (0.2, 1.0, 0.1)];
        // One edge of each crosses the other; two edges of the second cross the first.
        let beside = [(0.3, 0.3, -0.5), (0.4, 0.5, 0.7), (1.5, 1.4, 0.2)];
        let through = [(0.3, 0.2, -0.4), (0.4, 0.3, 0.6), (0.5, 0.4, -0.5)];
        for upper in [beside, through] {
            let corners = flat.into_iter().chain(upper);
            let mut positions: Vec<DVec3> = corners.map(|(x, y, z)| DVec3::new(x, y, z)).collect();
            let mut knot = Knot {
                faces: faces.to_vec(),
                edges: Vec::new(),
                pieces: vec![0; 6],
                held: vec![false; 6],
                springs: Vec::new(),
                step: 0.0,
                ways: vec![DVec3::ZERO; 6],
            };
            knot.push(&positions, faces[0], faces[1]);
            knot.push(&positions, faces[1], faces[0]);
            for v in 0..6 {
                for axis in 0..3 {
                    let place = positions[v][axis];
                    let mut at = |by: f64| {
                        positions[v][axis] = place + by;
                        length(&positions)
                    };
                    let slope = (at(1e-6) - at(-1e-6)) / 2e-6;
                    at(0.0);
                    let found = knot.ways[v][axis];
                    assert!((found + slope).abs() < 1e-6, "{v} {axis}: {found} {slope}");
                }
            }
        }
    }
}
