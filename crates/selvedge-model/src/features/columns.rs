//! The input columns of the network, those of a node and those of an arc (paper §5.1, §5.2),
//! computed from the positions of two frames in one local frame.
//!
//! The tables below are the only list of columns: widths, the layout of the normaliser and the
//! check of a weight file derive from them. Everything is f32 and written into slices of the
//! caller; nothing is allocated. Normalisation is not done here.
//!
//! Bending angle: 0 where two faces are flat and on the boundary, ±π where they fold onto each
//! other, positive for a ridge seen from the side of the normals: the negative of
//! [`selvedge_cloth::geometry::dihedral_angle`].

use glam::Vec3;

use crate::graph::frame::Yaw;
use crate::graph::surroundings::Near;
use crate::graph::{ClothGraph, Hinge};
use crate::spec::{EdgeFeature, ModelSpec, NodeFeature};

/// One column of the network's input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// Quantity and component.
    pub name: &'static str,
    /// Its unit; empty for a plain number.
    pub unit: &'static str,
}

macro_rules! columns {
    ($unit:literal: $($name:literal),+) => {
        &[$(Column { name: $name, unit: $unit }),+]
    };
}

impl NodeFeature {
    /// Its columns, in order.
    pub const fn columns(self) -> &'static [Column] {
        match self {
            Self::Velocity => columns!["m/frame": "velocity x", "velocity y", "velocity z"],
            Self::ExternalForce => {
                columns!["N": "external force x", "external force y", "external force z"]
            }
            Self::KineticEnergy => columns!["kg m²/frame²": "kinetic energy"],
            Self::NodeType => columns!["": "free", "handle", "type 2 (unused)",
                "type 3 (unused)", "type 4 (unused)", "type 5 (unused)", "type 6 (unused)",
                "type 7 (unused)", "type 8 (unused)"],
            Self::ExternalAcceleration => columns!["m/frame²": "external acceleration x",
                "external acceleration y", "external acceleration z"],
            Self::HandleAcceleration => columns!["m/frame²": "handle acceleration x",
                "handle acceleration y", "handle acceleration z"],
            Self::Nearness => columns!["": "nearness x", "nearness y", "nearness z"],
            Self::ContactAcceleration => columns!["m/frame²": "contact acceleration x",
                "contact acceleration y", "contact acceleration z"],
            Self::ContactVelocity => columns!["m/frame": "contact velocity x",
                "contact velocity y", "contact velocity z"],
        }
    }

    /// Number of columns.
    pub const fn width(self) -> usize {
        self.columns().len()
    }
}

impl EdgeFeature {
    /// Its columns, in order.
    pub const fn columns(self) -> &'static [Column] {
        match self {
            Self::Vector => columns!["m": "vector x", "vector y", "vector z", "length"],
            Self::RestVector => {
                columns!["m": "rest vector x", "rest vector y", "rest vector z", "rest length"]
            }
            Self::MaterialVector => {
                columns!["m": "material vector u", "material vector v", "material length"]
            }
            Self::Elongation => columns!["m": "elongation"],
            Self::BendingAngle => columns!["rad": "bending angle"],
            Self::PatternLength => columns!["m": "pattern length"],
            Self::Strain => columns!["": "strain"],
            Self::StretchAcceleration => columns!["m/frame²": "stretch acceleration x",
                "stretch acceleration y", "stretch acceleration z"],
            Self::BendAcceleration => columns!["m/frame²": "bend acceleration"],
        }
    }

    /// Number of columns.
    pub const fn width(self) -> usize {
        self.columns().len()
    }
}

/// The columns of a vertex, `[node_width]`.
pub fn node_columns(spec: &ModelSpec) -> Vec<Column> {
    let features = spec.node_features.iter();
    features.flat_map(|f| f.columns()).copied().collect()
}

/// The columns of an arc, `[edge_width]`.
pub fn edge_columns(spec: &ModelSpec) -> Vec<Column> {
    let features = spec.edge_features.iter();
    features.flat_map(|f| f.columns()).copied().collect()
}

/// Widths of the groups of node columns that share a unit and a scale, as the normaliser wants
/// them; their sum is the node width.
pub fn node_groups(spec: &ModelSpec) -> Vec<usize> {
    spec.node_features.iter().map(|f| f.width()).collect()
}

/// Widths of the groups of edge columns that share a unit and a scale; their sum is the edge width.
pub fn edge_groups(spec: &ModelSpec) -> Vec<usize> {
    spec.edge_features.iter().map(|f| f.width()).collect()
}

/// One frame of the network's window.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Pose<'a> {
    /// World positions one frame earlier `[m]`, `[vertices]`.
    pub(crate) previous: &'a [Vec3],
    /// World positions in this frame `[m]`, `[vertices]`.
    pub(crate) current: &'a [Vec3],
    /// World positions of the handles one frame later `[m]`, `[handles]`.
    pub(crate) next_handles: &'a [Vec3],
    /// The local frame that features are expressed in: that of the *newest* frame of the window.
    pub(crate) yaw: Yaw,
}

/// The columns of one feature in rows of `width` columns.
#[derive(Clone, Copy)]
pub(super) struct FeatureColumns<R> {
    pub(super) rows: R,
    pub(super) width: usize,
    pub(super) first: usize,
}

impl FeatureColumns<&mut [f32]> {
    #[inline]
    fn put<const N: usize>(&mut self, row: usize, values: [f32; N]) {
        let start = row * self.width + self.first;
        self.rows[start..start + N].copy_from_slice(&values);
    }

    #[inline]
    fn add(&mut self, row: usize, value: Vec3) {
        let start = row * self.width + self.first;
        for (x, y) in self.rows[start..start + 3].iter_mut().zip(value.to_array()) {
            *x += y;
        }
    }
}

/// Fills `nodes` (`[vertices, node_width]`) and `arcs` (`[arcs, edge_width]`) with the features of
/// every vertex and of every arc, in the graph's order.
///
/// # Panics
/// When a slice does not have the size of the cloth.
pub(crate) fn features(
    spec: &ModelSpec,
    graph: &ClothGraph,
    pose: Pose<'_>,
    nodes: &mut [f32],
    arcs: &mut [f32],
) {
    let (vertices, width) = (graph.vertex_count(), spec.node_width());
    assert_eq!(pose.previous.len(), vertices, "previous positions");
    assert_eq!(pose.current.len(), vertices, "current positions");
    assert_eq!(nodes.len(), vertices * width, "node features");
    let near = near(spec, graph, pose);
    let mut first = 0;
    for &feature in &spec.node_features {
        let rows = &mut *nodes;
        let columns = FeatureColumns { rows, width, first };
        match feature {
            NodeFeature::Velocity => velocity(pose, columns),
            NodeFeature::ExternalForce => external_force(graph, pose, |_| 1.0, columns),
            NodeFeature::ExternalAcceleration => {
                external_force(graph, pose, |v| per_force(graph, v), columns);
            }
            NodeFeature::KineticEnergy => kinetic_energy(graph, pose, columns),
            NodeFeature::NodeType => node_type(graph, columns),
            NodeFeature::HandleAcceleration => handle_acceleration(graph, pose, columns),
            NodeFeature::Nearness => of_near(&near, pose, |near| near.nearness, columns),
            NodeFeature::ContactAcceleration => of_near(&near, pose, |near| near.push, columns),
            NodeFeature::ContactVelocity => of_near(&near, pose, |near| near.velocity, columns),
        }
        first += feature.width();
    }
    let width = spec.edge_width();
    assert_eq!(arcs.len(), graph.arc_count() * width, "edge features");
    first = 0;
    for &feature in &spec.edge_features {
        let rows = &mut *arcs;
        let columns = FeatureColumns { rows, width, first };
        match feature {
            EdgeFeature::Vector => vector(graph, pose, columns),
            EdgeFeature::RestVector => rest_vector(graph, columns),
            EdgeFeature::MaterialVector => material_vector(graph, columns),
            EdgeFeature::Elongation => {
                let rest = graph.rest_lengths();
                each_edge(graph, pose, columns, |e, length| length - rest[e]);
            }
            EdgeFeature::BendingAngle => bending(graph, pose, |_, angle| [angle; 2], columns),
            EdgeFeature::PatternLength => {
                let springs = &graph.weave().springs;
                each_edge(graph, pose, columns, |e, _| springs[e].length);
            }
            EdgeFeature::Strain => {
                let springs = &graph.weave().springs;
                each_edge(graph, pose, columns, |e, length| springs[e].strain(length));
            }
            EdgeFeature::StretchAcceleration => stretch_acceleration(graph, pose, columns),
            EdgeFeature::BendAcceleration => bend_acceleration(graph, pose, columns),
        }
        first += feature.width();
    }
}

fn velocity(pose: Pose<'_>, mut out: FeatureColumns<&mut [f32]>) {
    for (v, (&p, &q)) in pose.current.iter().zip(pose.previous).enumerate() {
        out.put(v, pose.yaw.to_local(p - q).to_array());
    }
}

/// Properties of the air that the external force depends on.
pub(super) struct Air {
    /// `[kg/m³]`.
    pub(super) density: f32,
    pub(super) drag: f32,
    /// `[m/s]`.
    wind: Vec3,
    /// From the way of three corners `[m/frame]` to their mean velocity `[m/s]`.
    pub(super) corner_rate: f32,
}

impl Air {
    /// The air around a cloth, if there is any that acts on it.
    pub(super) fn around(graph: &ClothGraph) -> Option<Self> {
        let environment = graph.environment();
        (environment.air_density != 0.0 || environment.air_drag != 0.0).then(|| Self {
            density: environment.air_density as f32,
            drag: environment.air_drag as f32,
            wind: environment.wind.as_vec3(),
            corner_rate: graph.frame_rate() as f32 / 3.0,
        })
    }

    /// Its velocity relative to a face `[m/s]`.
    pub(super) fn relative(&self, corners: [usize; 3], pose: Pose<'_>) -> Vec3 {
        let moves = corners.map(|v| pose.current[v] - pose.previous[v]);
        self.wind - self.corner_rate * moves.iter().sum::<Vec3>()
    }
}

/// Gravity on each vertex and, of each face, a third of the drag of the air on each corner
/// `[eq:external-force]`: f = m g + ⅓ Σ A (ρ |vₙ| vₙ n + c v_t) over the faces of a vertex, with
/// the air's velocity relative to the face v = wind - mean corner velocity `[m/s]`, vₙ = n·v,
/// v_t = v - vₙ n. Each vertex's is multiplied by its `scale`.
fn external_force(
    graph: &ClothGraph,
    pose: Pose<'_>,
    scale: impl Fn(usize) -> f32,
    mut out: FeatureColumns<&mut [f32]>,
) {
    let environment = graph.environment();
    let gravity = pose.yaw.to_local_f64(environment.gravity).as_vec3();
    for (v, &mass) in graph.cloth().vertex_mass().iter().enumerate() {
        out.put(v, (scale(v) * mass * gravity).to_array());
    }
    let Some(air) = Air::around(graph) else {
        return;
    };
    let faces = graph.topology().faces().iter();
    for (face, &area) in faces.zip(graph.cloth().face_area()) {
        let corners = face.map(|v| v.index());
        let [a, b, c] = corners.map(|v| pose.current[v]);
        let relative = air.relative(corners, pose);
        let normal = (b - a).cross(c - a).normalize_or_zero();
        let along = normal.dot(relative);
        let tangential = relative - along * normal;
        let force = air.density * along.abs() * along * normal + air.drag * tangential;
        let third = pose.yaw.to_local(area / 3.0 * force);
        for v in corners {
            out.add(v, scale(v) * third);
        }
    }
}

/// Acceleration of a vertex per force on it `[m/(frame² N)]`.
pub(super) fn per_force(graph: &ClothGraph, vertex: usize) -> f32 {
    let rate = graph.frame_rate() as f32;
    1.0 / (graph.cloth().vertex_mass()[vertex] * rate * rate)
}

/// Kinetic energy with the velocity per frame `[eq:kinetic-energy]`: m |v|² / 2.
fn kinetic_energy(graph: &ClothGraph, pose: Pose<'_>, mut out: FeatureColumns<&mut [f32]>) {
    let moves = pose.current.iter().zip(pose.previous);
    for (v, ((&p, &before), &mass)) in moves.zip(graph.cloth().vertex_mass()).enumerate() {
        out.put(v, [0.5 * mass * (p - before).length_squared()]);
    }
}

fn node_type(graph: &ClothGraph, mut out: FeatureColumns<&mut [f32]>) {
    const FREE: [f32; 9] = [1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    const HANDLE: [f32; 9] = [0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0];
    for (v, &handle) in graph.handle_mask().iter().enumerate() {
        out.put(v, if handle { HANDLE } else { FREE });
    }
}

fn handle_acceleration(graph: &ClothGraph, pose: Pose<'_>, mut out: FeatureColumns<&mut [f32]>) {
    for v in 0..graph.vertex_count() {
        out.put(v, [0.0; 3]);
    }
    let handles = graph.handles().vertices().iter().map(|v| v.index());
    for (v, &next) in handles.zip(pose.next_handles) {
        if graph.handle_mask()[v] {
            let change = (next - pose.current[v]) - (pose.current[v] - pose.previous[v]);
            out.put(v, pose.yaw.to_local(change).to_array());
        }
    }
}

/// What each vertex sees of what it could touch, where a feature is made from that and there is something.
fn near(spec: &ModelSpec, graph: &ClothGraph, pose: Pose<'_>) -> Vec<Near> {
    let seen = graph.surroundings().filter(|_| spec.sees_bodies());
    seen.map_or_else(Vec::new, |seen| seen.near(pose.previous, pose.current))
}

fn of_near(
    near: &[Near],
    pose: Pose<'_>,
    vector: impl Fn(&Near) -> Vec3,
    mut out: FeatureColumns<&mut [f32]>,
) {
    for v in 0..pose.current.len() {
        let seen = near.get(v).map_or(Vec3::ZERO, &vector);
        out.put(v, pose.yaw.to_local(seen).to_array());
    }
}

/// Position of the sender minus that of the receiver, and its length.
fn vector(graph: &ClothGraph, pose: Pose<'_>, mut out: FeatureColumns<&mut [f32]>) {
    for ((a, b), arcs) in edge_ends(graph, pose.current) {
        let d = pose.yaw.to_local(a - b);
        put_vector(&mut out, arcs, d, d.length());
    }
}

fn rest_vector(graph: &ClothGraph, mut out: FeatureColumns<&mut [f32]>) {
    let rest = graph.rest_vectors.iter().zip(graph.rest_lengths());
    for ((&d, &length), &arcs) in rest.zip(&graph.edge_arcs) {
        put_vector(&mut out, arcs, d, length);
    }
}

fn material_vector(graph: &ClothGraph, mut out: FeatureColumns<&mut [f32]>) {
    for (vectors, arcs) in graph.material_vectors().iter().zip(&graph.edge_arcs) {
        for (&arc, d) in arcs.iter().zip(vectors) {
            out.put(arc as usize, [d.x, d.y, d.length()]);
        }
    }
}

/// A quantity of each edge by its number and its length, in both arcs.
fn each_edge(
    graph: &ClothGraph,
    pose: Pose<'_>,
    mut out: FeatureColumns<&mut [f32]>,
    value: impl Fn(usize, f32) -> f32,
) {
    let ends = edge_ends(graph, pose.current);
    for (number, ((a, b), arcs)) in ends.enumerate() {
        let value = value(number, a.distance(b));
        for arc in arcs {
            out.put(arc as usize, [value]);
        }
    }
}

/// The pull of each edge's spring over the mass of the receiver, towards the sender.
fn stretch_acceleration(graph: &ClothGraph, pose: Pose<'_>, mut out: FeatureColumns<&mut [f32]>) {
    let edges = graph.topology().edges().iter().map(|edge| edge.vertices);
    let ends = edges.zip(edge_ends(graph, pose.current));
    for ((vertices, ((a, b), arcs)), spring) in ends.zip(&graph.weave().springs) {
        let d = a - b;
        let [pull, _] = spring.pull(d.length());
        let force = pull * pose.yaw.to_local(d).normalize_or_zero();
        let [to_a, to_b] = vertices.map(|v| per_force(graph, v.index()));
        let [forward, back] = arcs.map(|arc| arc as usize);
        out.put(forward, (to_b * force).to_array());
        out.put(back, (-to_a * force).to_array());
    }
}

fn bend_acceleration(graph: &ClothGraph, pose: Pose<'_>, out: FeatureColumns<&mut [f32]>) {
    let value = |number: usize, angle: f32| {
        let [push, _] = graph.weave().torques[number].push(angle);
        receivers(graph, &graph.hinges()[number]).map(|v| per_force(graph, v) * push)
    };
    bending(graph, pose, value, out);
}

/// The receivers of the two arcs of a hinge's edge.
pub(super) fn receivers(graph: &ClothGraph, hinge: &Hinge) -> [usize; 2] {
    let [first, second] = graph.topology().edges()[hinge.edge as usize].vertices;
    [second.index(), first.index()]
}

/// In the two arcs of each hinge what `value` makes of its number and its angle; 0 on the boundary.
fn bending(
    graph: &ClothGraph,
    pose: Pose<'_>,
    value: impl Fn(usize, f32) -> [f32; 2],
    mut out: FeatureColumns<&mut [f32]>,
) {
    for (edge, arcs) in graph.topology().edges().iter().zip(&graph.edge_arcs) {
        if edge.is_boundary() {
            for &arc in arcs {
                out.put(arc as usize, [0.0]);
            }
        }
    }
    for (number, hinge) in graph.hinges().iter().enumerate() {
        let values = value(number, bending_angle(hinge, pose.current));
        for (arc, value) in graph.edge_arcs[hinge.edge as usize].into_iter().zip(values) {
            out.put(arc as usize, [value]);
        }
    }
}

/// The bending angle of a hinge `[rad]`, in (-π, π] `[eq:bending-angle]`:
/// θ = atan2(-|e| n_l·r, n_l·n_r) with e = to - from, n_l = e × (left - from), r = right - from,
/// n_r = r × e. Positive where the right wing falls away from the normals. 0 for a degenerate face.
fn bending_angle(hinge: &Hinge, positions: &[Vec3]) -> f32 {
    let [from, to, left, right] =
        [hinge.from, hinge.to, hinge.left, hinge.right].map(|v| positions[v as usize]);
    let (along, to_right) = (to - from, right - from);
    let normal_left = along.cross(left - from);
    let normal_right = to_right.cross(along);
    // 0 - x, not -x: flat is +0 and a full fold +π.
    let sine = 0.0 - along.length() * normal_left.dot(to_right);
    sine.atan2(normal_left.dot(normal_right))
}

/// The positions of both ends of each edge, and its arcs.
pub(super) fn edge_ends<'a>(
    graph: &'a ClothGraph,
    positions: &'a [Vec3],
) -> impl Iterator<Item = ((Vec3, Vec3), [u32; 2])> + 'a {
    let edges = graph.topology().edges().iter();
    edges.zip(&graph.edge_arcs).map(|(edge, &arcs)| {
        let [a, b] = edge.vertices.map(|v| positions[v.index()]);
        ((a, b), arcs)
    })
}

/// `d` and `length` for the first arc, the opposite for its reverse.
#[inline]
fn put_vector(out: &mut FeatureColumns<&mut [f32]>, arcs: [u32; 2], d: Vec3, length: f32) {
    let [forward, back] = arcs;
    out.put(forward as usize, [d.x, d.y, d.z, length]);
    out.put(back as usize, [-d.x, -d.y, -d.z, length]);
}

#[cfg(test)]
mod tests;
