//! The input columns of a network that corrects physics, and its output as corrections of positions
//! and velocities.
//!
//! Each vertex has a frame of its own on the predicted cloth: along the threads, across them, and
//! the normal `[eq:thread-frame]`. Vectors of a vertex and of the arcs that arrive there are
//! written in it, so that a turned cloth has the same columns, and the same corrections turned.
//! Differences along an arc are divided by its length in the material, so that columns of a smooth
//! motion do not depend on the fineness of the mesh.
//!
//! The motion is shown as differences over substeps, of which the error of a formula is made,
//! divided by a scale of the vertex, so that slow and fast motions have the same columns, and
//! corrections in proportion. Beside its own a vertex sees sums over the arcs that arrive there,
//! weighted by circular functions of their directions in the material: gradients and second
//! derivatives of the motion.

use glam::{DVec3, Mat3, Vec3};
use selvedge_cloth::{FaceId, Material};

use crate::graph::ClothGraph;

pub(crate) use columns::NODE_COLUMNS;
pub use columns::correction_groups;
use columns::{
    OWN_COLUMNS, SCALAR_WEIGHTS, STILL_COLUMNS, SUM_COLUMNS, SUMMED_SCALARS, SUMMED_VECTORS,
    VECTOR_WEIGHTS,
};
use differences::SUBSTEP_VECTORS;
pub use differences::{FrameSubsteps, rough_fields};

mod columns;
mod differences;

/// Positions `[m]` and velocities `[m/s]`, `[vertices]` each.
#[derive(Clone, Copy, Debug)]
pub struct MotionState<'a> {
    /// Positions `[m]`.
    pub positions: &'a [DVec3],
    /// Velocities `[m/s]`.
    pub velocities: &'a [DVec3],
}

/// A frame that physics predicted, and what led there.
#[derive(Clone, Copy, Debug)]
pub struct PredictedFrame<'a> {
    /// Its substeps.
    pub substeps: FrameSubsteps<'a>,
    /// The state at the start of the frame.
    pub last: MotionState<'a>,
    /// The state at its end, by physics.
    pub predicted: MotionState<'a>,
    /// The wind of the frame `[m/s]`.
    pub wind: DVec3,
    /// Gravity `[m/s²]`.
    pub gravity: DVec3,
    /// True for each vertex that a handle holds, `[vertices]`.
    pub held: &'a [bool],
}

/// Properties of a material, as numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stiffness {
    /// Against stretching `[N/m]`.
    pub stretch: f64,
    /// Against bending `[N m]`.
    pub bend: f64,
    /// Mass per area `[kg/m²]`.
    pub density: f64,
}

impl Stiffness {
    /// The numbers of a material: means of its tables `[eq:mean-stiffness]`, stretching along and
    /// across the threads with the law's factor 2.
    #[must_use]
    pub fn of(material: &Material) -> Self {
        let rows = material.stretch.0.iter();
        let along_and_across = rows.flat_map(|row| [row[0], row[2]]);
        let count = 2.0 * material.stretch.0.len() as f64;
        let bend = material.bend.0.as_flattened();
        Self {
            stretch: 2.0 * along_and_across.sum::<f64>() / count,
            bend: bend.iter().sum::<f64>() / bend.len() as f64,
            density: material.density,
        }
    }
}

/// The columns of a cloth that do not change, and buffers.
#[derive(Clone, Debug)]
pub struct CorrectionColumns {
    /// Length of a frame `[s]`.
    dt: f64,
    /// Of both arcs of each edge: direction in the pattern as cos 2φ and sin 2φ, and logarithms of
    /// its length and of the two stiffnesses, `[edges, 2]`.
    still: Vec<[[f32; STILL_COLUMNS]; 2]>,
    /// Length of each edge in the material `[m]`, `[edges]`.
    lengths: Vec<f32>,
    /// Of each face: shares of its two edges from the first corner in the tangent along the
    /// threads, `[faces]`.
    along: Vec<[f32; 2]>,
    frames: Vec<Mat3>,
    /// Bending angle of each edge now and as predicted `[rad]`, `[edges]`.
    angles: Vec<[f32; 2]>,
    moves: Vec<Moves>,
    /// Scale of each vertex `[m]`, `[vertices]`.
    scales: Vec<f32>,
    /// Weights of the two arcs of each edge in the sums over the arcs of their receivers,
    /// `[edges, 2]`.
    weights: Vec<[[f32; VECTOR_WEIGHTS]; 2]>,
    /// Columns of the vertices, `[vertices, columns]`.
    pub nodes: Vec<f32>,
}

/// Turns of the frames about their own axes by half a turn, which a woven or knitted material does
/// not see.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct HalfTurns {
    /// The other way along the threads.
    pub along: bool,
    /// The other side up.
    pub over: bool,
}

impl HalfTurns {
    /// -1 where the cloth is turned over, else 1.
    fn side(self) -> f32 {
        if self.over { -1.0 } else { 1.0 }
    }
}

/// Parts of the columns of an edge's arcs.
struct OfEdge {
    /// Differences of predicted positions, velocities, shifts and changes, over the length.
    vectors: [Vec3; SUMMED_VECTORS],
    /// Strains now and as predicted.
    strains: [f32; 2],
}

/// Vectors of a vertex.
#[derive(Clone, Copy, Debug, Default)]
struct Moves {
    /// h v `[m]`, h the length of a frame.
    velocity: Vec3,
    /// Two that are compared along arcs: second and third differences of velocity `[m]`.
    compared: [Vec3; 2],
    /// The vertex's own, over its scale.
    own: [Vec3; SUBSTEP_VECTORS],
}

impl CorrectionColumns {
    /// Columns of the cloth of `graph`, whose material has `stiffness`; a frame lasts `dt` `[s]`.
    #[must_use]
    pub fn new(graph: &ClothGraph, stiffness: Stiffness, dt: f64) -> Self {
        Self::of_faces(graph, |_| stiffness, dt)
    }

    /// As [`Self::new`], of a cloth whose faces have a `stiffness` each; an arc has that of the
    /// face to its left, as it has its rest shape, and at a border that of its only face.
    #[must_use]
    pub fn of_faces(graph: &ClothGraph, stiffness: impl Fn(FaceId) -> Stiffness, dt: f64) -> Self {
        let pattern = graph.cloth().pattern();
        let lengths: Vec<f32> = pattern.edge_lengths().iter().map(|&l| l as f32).collect();
        let edges = graph.topology().edges().iter().zip(&lengths);
        let still = graph.material_vectors().into_iter().zip(edges);
        let still = still.map(|(arcs, (edge, &length))| {
            let (left, right) = edge.faces;
            [(arcs[0], left), (arcs[1], right.unwrap_or(left))].map(|(d, face)| {
                let stiffness = stiffness(face);
                let inertia = stiffness.density * f64::from(length * length) / (dt * dt);
                let bend = stiffness.bend / (inertia * f64::from(length * length));
                let square = d.length_squared();
                let inverse = if square > 0.0 { 1.0 / square } else { 0.0 };
                [
                    (d.x * d.x - d.y * d.y) * inverse,
                    2.0 * d.x * d.y * inverse,
                    length.ln(),
                    logarithm(stiffness.stretch / inertia),
                    logarithm(bend),
                ]
            })
        });
        let still = still.collect();
        let along = pattern.faces().map(|[a, b, c]| {
            let (p, q) = (b - a, c - a);
            let area = p.perp_dot(q);
            if area == 0.0 {
                [1.0, 0.0]
            } else {
                [q.y / area, -p.y / area]
            }
        });
        let vertices = graph.vertex_count();
        Self {
            dt,
            still,
            lengths,
            along: along.collect(),
            frames: vec![Mat3::IDENTITY; vertices],
            angles: vec![[0.0; 2]; graph.topology().edges().len()],
            moves: vec![Moves::default(); vertices],
            scales: vec![1.0; vertices],
            weights: sum_weights(graph),
            nodes: vec![0.0; vertices * NODE_COLUMNS],
        }
    }

    /// Scale of each vertex at the latest [`Self::write`] `[m]`, by which its corrections are
    /// measured.
    #[must_use]
    pub fn scales(&self) -> &[f32] {
        &self.scales
    }

    /// Fills [`Self::nodes`].
    pub fn write(&mut self, graph: &ClothGraph, frame: &PredictedFrame<'_>, turns: HalfTurns) {
        self.find_frames(graph, frame.predicted.positions, turns);
        self.find_differences(graph, frame);
        self.find_angles(graph, frame);
        self.write_nodes(frame);
        self.write_sums(graph, frame, turns);
    }

    /// The frames `[eq:thread-frame]`: n is the mean normal of the faces of a vertex, t their mean
    /// tangent along the threads less its part along n.
    fn find_frames(&mut self, graph: &ClothGraph, positions: &[DVec3], turns: HalfTurns) {
        self.frames.fill(Mat3::ZERO);
        for (face, share) in graph.topology().faces().iter().zip(&self.along) {
            let corners = face.map(|v| v.index());
            let [a, b, c] = corners.map(|v| positions[v]);
            let (p, q) = ((b - a).as_vec3(), (c - a).as_vec3());
            let normal = p.cross(q);
            let tangent = (share[0] * p + share[1] * q) * normal.length();
            for v in corners {
                self.frames[v].x_axis += tangent;
                self.frames[v].z_axis += normal;
            }
        }
        for frame in &mut self.frames {
            let normal = frame.z_axis.try_normalize().unwrap_or(Vec3::Z);
            let tangent = frame.x_axis - frame.x_axis.dot(normal) * normal;
            let tangent = tangent
                .try_normalize()
                .unwrap_or_else(|| normal.any_orthonormal_vector());
            let tangent = if turns.along { -tangent } else { tangent };
            let normal = if turns.over { -normal } else { normal };
            *frame = Mat3::from_cols(tangent, normal.cross(tangent), normal);
        }
    }

    fn find_angles(&mut self, graph: &ClothGraph, frame: &PredictedFrame<'_>) {
        for hinge in graph.hinges() {
            let ends = [hinge.from, hinge.to, hinge.left, hinge.right].map(|v| v as usize);
            let angle = |positions: &[DVec3]| bend(ends.map(|v| positions[v]));
            self.angles[hinge.edge as usize] = [
                angle(frame.last.positions),
                angle(frame.predicted.positions),
            ];
        }
    }

    fn write_nodes(&mut self, frame: &PredictedFrame<'_>) {
        let h = self.dt;
        let gravity = (h * h * frame.gravity).as_vec3();
        let wind = (h * frame.wind).as_vec3();
        let FrameSubsteps {
            earlier, fell_back, ..
        } = frame.substeps;
        let rows = self.nodes.chunks_exact_mut(NODE_COLUMNS);
        for (v, row) in rows.enumerate() {
            let moves = &self.moves[v];
            let axes = self.frames[v].transpose();
            let of_air = [wind - moves.velocity, gravity];
            let vectors = moves.own.iter().chain(&of_air);
            let (of_vectors, rest) = row.split_at_mut(3 * (SUBSTEP_VECTORS + 2));
            for (to, vector) in of_vectors.as_chunks_mut::<3>().0.iter_mut().zip(vectors) {
                *to = (axes * *vector).to_array();
            }
            rest[0] = f32::from(u8::from(frame.held[v]));
            rest[1] = f32::from(u8::from(earlier.is_some()));
            rest[2] = self.scales[v].ln();
            rest[3] = fell_back;
        }
    }

    /// Vectors and scalars of edge `number`, from its second vertex to its first.
    fn of_edge(&self, number: usize, edge: [usize; 2], frame: &PredictedFrame<'_>) -> OfEdge {
        let [a, b] = edge;
        let length = self.lengths[number];
        let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
        let between = |positions: &[DVec3]| (positions[a] - positions[b]).as_vec3();
        let now = between(frame.last.positions);
        let next = between(frame.predicted.positions);
        let (ma, mb) = (self.moves[a], self.moves[b]);
        let vectors = [
            next,
            ma.velocity - mb.velocity,
            ma.compared[0] - mb.compared[0],
            ma.compared[1] - mb.compared[1],
        ];
        OfEdge {
            vectors: vectors.map(|d| d * inverse),
            strains: [now, next].map(|d| d.length() * inverse - 1.0),
        }
    }

    /// The sums over the arcs that arrive at each vertex `[eq:arc-sums]`: in the world first, then
    /// turned into the frames.
    fn write_sums(&mut self, graph: &ClothGraph, frame: &PredictedFrame<'_>, turns: HalfTurns) {
        for row in self.nodes.chunks_exact_mut(NODE_COLUMNS) {
            row[OWN_COLUMNS..].fill(0.0);
        }
        let side = turns.side();
        for (number, edge) in graph.topology().edges().iter().enumerate() {
            let [a, b] = edge.vertices.map(|v| v.index());
            let OfEdge { vectors, strains } = self.of_edge(number, [a, b], frame);
            let [bent, bends] = self.angles[number].map(|angle| side * angle);
            let scalars = [strains[0], strains[1], bends, bends - bent];
            for ((weights, still), (receiver, sign)) in self.weights[number]
                .iter()
                .zip(&self.still[number])
                .zip([(b, 1.0), (a, -1.0)])
            {
                // Over the scale of the receiver, not over the length of the edge.
                let inverse = self.lengths[number] / self.scales[receiver];
                let factors = [1.0, 1.0, inverse, inverse].map(|factor| sign * factor);
                let row = &mut self.nodes[receiver * NODE_COLUMNS + OWN_COLUMNS..][..SUM_COLUMNS];
                let (of_vectors, rest) = row.split_at_mut(3 * SUMMED_VECTORS * VECTOR_WEIGHTS);
                let (of_scalars, means) = rest.split_at_mut(SUMMED_SCALARS * SCALAR_WEIGHTS);
                let to = of_vectors
                    .as_chunks_mut::<3>()
                    .0
                    .as_chunks_mut::<VECTOR_WEIGHTS>()
                    .0;
                for ((to, vector), factor) in to.iter_mut().zip(vectors).zip(factors) {
                    for (to, weight) in to.iter_mut().zip(weights) {
                        let part = vector * (factor * weight);
                        to[0] += part.x;
                        to[1] += part.y;
                        to[2] += part.z;
                    }
                }
                let to = of_scalars.as_chunks_mut::<SCALAR_WEIGHTS>().0;
                for (to, scalar) in to.iter_mut().zip(scalars) {
                    for (to, weight) in to.iter_mut().zip(&weights[2..]) {
                        *to += weight * scalar;
                    }
                }
                for (to, value) in means.iter_mut().zip(&still[2..]) {
                    *to += weights[2] * value;
                }
            }
        }
        self.turn_sums(turns);
    }

    /// Turns the sums of vectors into the frames of their vertices, and the directions of the
    /// weights with the half turns.
    fn turn_sums(&mut self, turns: HalfTurns) {
        // Half a turn of the frame takes φ to φ + π, a cloth turned over takes it to -φ.
        let (along, side) = (if turns.along { -1.0 } else { 1.0 }, turns.side());
        let signs = [along, along * side, 1.0, 1.0, side];
        let rows = self.nodes.chunks_exact_mut(NODE_COLUMNS);
        for (row, axes) in rows.zip(&self.frames) {
            let axes = axes.transpose();
            let row = &mut row[OWN_COLUMNS..];
            let (of_vectors, rest) = row.split_at_mut(3 * SUMMED_VECTORS * VECTOR_WEIGHTS);
            for (k, to) in of_vectors.as_chunks_mut::<3>().0.iter_mut().enumerate() {
                let vector = axes * Vec3::from_array(*to);
                *to = (signs[k % VECTOR_WEIGHTS] * vector).to_array();
            }
            let of_scalars = rest[..SUMMED_SCALARS * SCALAR_WEIGHTS].iter_mut();
            for (k, to) in of_scalars.enumerate() {
                *to *= signs[2 + k % SCALAR_WEIGHTS];
            }
        }
    }

    /// Takes corrections in scales of their vertices, `[vertices, 6]`, to metres.
    pub fn to_metres(&self, rows: &mut [f32]) {
        for (row, scale) in rows.as_chunks_mut::<6>().0.iter_mut().zip(&self.scales) {
            row.iter_mut().for_each(|x| *x *= scale);
        }
    }

    /// Adds the corrections `rows` (`[vertices, 6]`: of positions, and of velocities times the
    /// length of the frame, both `[m]`, in the frames of the latest [`Self::write`]) to the
    /// positions `[m]` and velocities `[m/s]` of vertices that are not `held`, `[vertices]` each.
    pub fn apply(
        &self,
        rows: &[f32],
        held: &[bool],
        positions: &mut [DVec3],
        velocities: &mut [DVec3],
    ) {
        let rows = rows.as_chunks::<6>().0.iter();
        for (v, row) in rows.enumerate() {
            if held[v] {
                continue;
            }
            let axes = self.frames[v];
            let [shift, change] = [[row[0], row[1], row[2]], [row[3], row[4], row[5]]];
            positions[v] += (axes * Vec3::from_array(shift)).as_dvec3();
            velocities[v] += (axes * Vec3::from_array(change)).as_dvec3() / self.dt;
        }
    }

    /// The corrections that lead from the predicted state to `truth`, in the frames of the latest
    /// [`Self::write`] and scales of their vertices: the inverse of [`Self::to_metres`] and
    /// [`Self::apply`].
    pub fn target(&self, predicted: MotionState<'_>, truth: MotionState<'_>, rows: &mut Vec<f32>) {
        rows.clear();
        for (v, frame) in self.frames.iter().enumerate() {
            let axes = frame.transpose();
            let shift = truth.positions[v] - predicted.positions[v];
            let change = self.dt * (truth.velocities[v] - predicted.velocities[v]);
            let inverse = 1.0 / self.scales[v];
            for vector in [shift, change] {
                rows.extend((axes * vector.as_vec3() * inverse).to_array());
            }
        }
    }
}

/// Weights of the arcs in the sums over those of their receivers: circular functions of their
/// directions in the pattern over their number.
fn sum_weights(graph: &ClothGraph) -> Vec<[[f32; VECTOR_WEIGHTS]; 2]> {
    let first = graph.connectivity().first_arc();
    let parts = |vertex: usize| 1.0 / (first[vertex + 1] - first[vertex]).max(1) as f32;
    let edges = graph.topology().edges().iter();
    edges
        .zip(graph.material_vectors())
        .map(|(edge, vectors)| {
            let [a, b] = edge.vertices.map(|v| v.index());
            let of = |receiver: usize, vector: glam::Vec2| {
                let [c, s] = vector
                    .try_normalize()
                    .unwrap_or(glam::Vec2::ZERO)
                    .to_array();
                [c, s, 1.0, c * c - s * s, 2.0 * c * s].map(|weight| parts(receiver) * weight)
            };
            [of(b, vectors[0]), of(a, vectors[1])]
        })
        .collect()
}

/// The logarithm of a stiffness without unit; finite for none at all.
fn logarithm(stiffness: f64) -> f32 {
    stiffness.max(f64::from(f32::MIN_POSITIVE)).ln() as f32
}

/// The bending angle of a hinge `[rad]`, as the other features have it.
fn bend(corners: [DVec3; 4]) -> f32 {
    let [from, to, left, right] = corners;
    let (along, to_left, to_right) = (
        (to - from).as_vec3(),
        (left - from).as_vec3(),
        (right - from).as_vec3(),
    );
    let normal_left = along.cross(to_left);
    let normal_right = to_right.cross(along);
    let sine = 0.0 - along.length() * normal_left.dot(to_right);
    sine.atan2(normal_left.dot(normal_right))
}

#[cfg(test)]
pub(crate) mod tests;
