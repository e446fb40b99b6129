//! The input columns of a network that corrects physics, and its output as corrections of positions
//! and velocities.
//!
//! Each vertex has a frame of its own on the predicted cloth: along the threads, across them, and
//! the normal `[eq:thread-frame]`. Vectors of a vertex and of the arcs that arrive there are
//! written in it, so that a turned cloth has the same columns, and the same corrections turned.
//! Differences along an arc are divided by its length in the material, so that columns of a smooth
//! motion do not depend on the fineness of the mesh.

use glam::{DVec3, Mat3, Vec3};

use crate::graph::ClothGraph;

/// Columns of a vertex.
pub(crate) const NODE_COLUMNS: usize = 20;
/// Columns of an arc.
pub(crate) const ARC_COLUMNS: usize = 24;
/// Columns of an arc that do not change: see [`StillColumns`].
const STILL_COLUMNS: usize = 5;

/// Widths of the groups of columns that share a unit and a scale, as the normaliser wants them: of
/// vertices, of arcs and of corrections.
#[must_use]
pub fn correction_groups() -> [Vec<usize>; 3] {
    [
        vec![3, 3, 3, 3, 3, 3, 1, 1],
        vec![3, 3, 3, 3, 3, 2, 2, 2, 1, 1, 1],
        vec![3, 3],
    ]
}

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
    /// The state one frame before the last; none at the start of a run.
    pub before: Option<MotionState<'a>>,
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
    /// Columns of the vertices, `[vertices, NODE_COLUMNS]`.
    pub nodes: Vec<f32>,
    /// Columns of the arcs, `[arcs, ARC_COLUMNS]`.
    pub arcs: Vec<f32>,
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

/// Vectors of a vertex `[m/frame]`.
#[derive(Clone, Copy, Debug, Default)]
struct Moves {
    /// h v.
    velocity: Vec3,
    /// x̂ - x - h v.
    shift: Vec3,
    /// h (v̂ - v).
    change: Vec3,
}

impl CorrectionColumns {
    /// Columns of the cloth of `graph`, whose material has `stiffness`; a frame lasts `dt` `[s]`.
    #[must_use]
    pub fn new(graph: &ClothGraph, stiffness: Stiffness, dt: f64) -> Self {
        let pattern = graph.cloth().pattern();
        let lengths: Vec<f32> = pattern.edge_lengths().iter().map(|&l| l as f32).collect();
        let still = graph.material_vectors().into_iter().zip(&lengths);
        let still = still.map(|(arcs, &length)| {
            let inertia = stiffness.density * f64::from(length * length) / (dt * dt);
            let bend = stiffness.bend / (inertia * f64::from(length * length));
            arcs.map(|d| {
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
            nodes: vec![0.0; vertices * NODE_COLUMNS],
            arcs: vec![0.0; graph.arc_count() * ARC_COLUMNS],
        }
    }

    /// Fills [`Self::nodes`] and [`Self::arcs`].
    pub fn write(&mut self, graph: &ClothGraph, frame: &PredictedFrame<'_>, turns: HalfTurns) {
        self.find_frames(graph, frame.predicted.positions, turns);
        self.find_moves(frame);
        self.find_angles(graph, frame);
        self.write_nodes(frame);
        self.write_arcs(graph, frame, turns);
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

    fn find_moves(&mut self, frame: &PredictedFrame<'_>) {
        let h = self.dt;
        let (last, next) = (frame.last, frame.predicted);
        for (v, moves) in self.moves.iter_mut().enumerate() {
            let velocity = h * last.velocities[v];
            *moves = Moves {
                velocity: velocity.as_vec3(),
                shift: (next.positions[v] - last.positions[v] - velocity).as_vec3(),
                change: (h * next.velocities[v] - velocity).as_vec3(),
            };
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
        let rows = self.nodes.as_chunks_mut::<NODE_COLUMNS>().0.iter_mut();
        for (v, row) in rows.enumerate() {
            let moves = self.moves[v];
            let axes = self.frames[v].transpose();
            let mut earlier = [Vec3::ZERO; 2];
            if let Some(before) = frame.before {
                let velocity = h * before.velocities[v];
                let now = frame.last;
                let shift = now.positions[v] - before.positions[v] - velocity;
                let change = h * now.velocities[v] - velocity;
                earlier = [shift.as_vec3(), change.as_vec3()];
            }
            let vectors = [
                moves.shift,
                moves.change,
                earlier[0],
                earlier[1],
                wind - moves.velocity,
                gravity,
            ];
            for (to, vector) in row.as_chunks_mut::<3>().0.iter_mut().zip(vectors) {
                *to = (axes * vector).to_array();
            }
            row[18] = f32::from(u8::from(frame.held[v]));
            row[19] = f32::from(u8::from(frame.before.is_some()));
        }
    }

    fn write_arcs(&mut self, graph: &ClothGraph, frame: &PredictedFrame<'_>, turns: HalfTurns) {
        let edges = graph.topology().edges().iter().zip(graph.edge_arcs());
        let rows = self.arcs.as_chunks_mut::<ARC_COLUMNS>().0;
        let side = if turns.over { -1.0 } else { 1.0 };
        for (number, (edge, arcs)) in edges.enumerate() {
            let [a, b] = edge.vertices.map(|v| v.index());
            let length = self.lengths[number];
            let inverse = if length > 0.0 { 1.0 / length } else { 0.0 };
            let between = |positions: &[DVec3]| (positions[a] - positions[b]).as_vec3();
            let (now, next) = (
                between(frame.last.positions),
                between(frame.predicted.positions),
            );
            let strains = [now, next].map(|d| d.length() * inverse - 1.0);
            let (ma, mb) = (self.moves[a], self.moves[b]);
            let vectors = [
                next,
                ma.velocity - mb.velocity,
                ma.shift - mb.shift,
                ma.change - mb.change,
            ]
            .map(|d| d * inverse);
            let [bent, bends] = self.angles[number].map(|angle| side * angle);
            // The first arc comes from a and arrives at b.
            let both = [(a, b, 1.0), (b, a, -1.0)];
            for ((&arc, still), (sender, receiver, sign)) in
                arcs.iter().zip(&self.still[number]).zip(both)
            {
                let row = &mut rows[arc as usize];
                let axes = self.frames[receiver].transpose();
                for (to, vector) in row.as_chunks_mut::<3>().0.iter_mut().zip(vectors) {
                    *to = (axes * (sign * vector)).to_array();
                }
                row[12..15].copy_from_slice(&(axes * self.frames[sender].z_axis).to_array());
                row[15..17].copy_from_slice(&strains);
                row[17] = bends;
                row[18] = bends - bent;
                row[19..24].copy_from_slice(still);
                row[20] *= side;
            }
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
    /// [`Self::write`]: the inverse of [`Self::apply`].
    pub fn target(&self, predicted: MotionState<'_>, truth: MotionState<'_>, rows: &mut Vec<f32>) {
        rows.clear();
        for (v, frame) in self.frames.iter().enumerate() {
            let axes = frame.transpose();
            let shift = truth.positions[v] - predicted.positions[v];
            let change = self.dt * (truth.velocities[v] - predicted.velocities[v]);
            for vector in [shift, change] {
                rows.extend((axes * vector.as_vec3()).to_array());
            }
        }
    }
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
