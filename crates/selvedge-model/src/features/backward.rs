//! From the gradient of a loss with respect to features to that with respect to the positions they
//! were computed from, for learning through several frames of a rollout.
//!
//! Each function is the transpose of the derivative of its namesake in `columns`, in the same order
//! of columns. Handles are treated like other vertices; the caller drops their gradient. A feature
//! that is not differentiable (an edge or a face without extent, air at rest) has gradient 0.

use glam::Vec3;

use super::columns::{Air, FeatureColumns, Pose, edge_ends, per_force, receivers};
use crate::graph::ClothGraph;
use crate::graph::geometry::bending_angle_with_gradient;
use crate::spec::{EdgeFeature, ModelSpec, NodeFeature};

/// Gradients with respect to the positions of a [`Pose`], in the world, `[vertices]`; added to.
pub(crate) struct PoseGradient<'a> {
    /// With respect to `previous`.
    pub(crate) previous: &'a mut [Vec3],
    /// With respect to `current`.
    pub(crate) current: &'a mut [Vec3],
}

type Rows<'a> = FeatureColumns<&'a [f32]>;

impl Rows<'_> {
    #[inline]
    fn get(&self, row: usize, column: usize) -> f32 {
        self.rows[row * self.width + self.first + column]
    }

    #[inline]
    fn vector(&self, row: usize) -> Vec3 {
        Vec3::from_slice(&self.rows[row * self.width + self.first..][..3])
    }
}

/// Adds to `to` the gradient with respect to the positions, given those with respect to what
/// [`features`](super::columns::features) fills: `nodes` (`[vertices, node_width]`) and `arcs`
/// (`[arcs, edge_width]`).
///
/// # Panics
/// When a slice does not have the size of the cloth.
pub(crate) fn features_backward(
    spec: &ModelSpec,
    graph: &ClothGraph,
    pose: Pose<'_>,
    [nodes, arcs]: [&[f32]; 2],
    to: &mut PoseGradient<'_>,
) {
    let (vertices, width) = (graph.vertex_count(), spec.node_width());
    assert_eq!(nodes.len(), vertices * width, "gradient of the nodes");
    assert_eq!(to.current.len(), vertices, "gradient of the positions");
    let (mut first, rows) = (0, nodes);
    for &feature in &spec.node_features {
        let rows = Rows { rows, width, first };
        match feature {
            NodeFeature::Velocity => velocity(pose, rows, to),
            NodeFeature::ExternalForce => external_force(graph, pose, |_| 1.0, rows, to),
            NodeFeature::ExternalAcceleration => {
                external_force(graph, pose, |v| per_force(graph, v), rows, to);
            }
            NodeFeature::KineticEnergy => kinetic_energy(graph, pose, rows, to),
            // Of handles alone.
            NodeFeature::NodeType | NodeFeature::HandleAcceleration => {}
            // Taken as given: the nearest point jumps.
            NodeFeature::Nearness
            | NodeFeature::ContactAcceleration
            | NodeFeature::ContactVelocity => {}
        }
        first += feature.width();
    }
    let (width, rows, to) = (spec.edge_width(), arcs, &mut *to.current);
    assert_eq!(
        arcs.len(),
        graph.arc_count() * width,
        "gradient of the arcs"
    );
    first = 0;
    for &feature in &spec.edge_features {
        let rows = Rows { rows, width, first };
        match feature {
            EdgeFeature::Vector => vector(graph, pose, rows, to),
            EdgeFeature::RestVector | EdgeFeature::MaterialVector | EdgeFeature::PatternLength => {}
            EdgeFeature::Elongation => elongation(graph, pose, |_| 1.0, rows, to),
            EdgeFeature::Strain => {
                let springs = &graph.weave().springs;
                elongation(graph, pose, |edge| 1.0 / springs[edge].length, rows, to);
            }
            EdgeFeature::StretchAcceleration => stretch_acceleration(graph, pose, rows, to),
            EdgeFeature::BendingAngle => bending(graph, pose, |_, _| [1.0; 2], rows, to),
            EdgeFeature::BendAcceleration => bend_acceleration(graph, pose, rows, to),
        }
        first += feature.width();
    }
}

fn velocity(pose: Pose<'_>, rows: Rows<'_>, to: &mut PoseGradient<'_>) {
    for v in 0..to.current.len() {
        let by_world = pose.yaw.to_world(rows.vector(v));
        to.current[v] += by_world;
        to.previous[v] -= by_world;
    }
}

/// With u = A/3 Σ g over the corners, φ = u·(ρ |vₙ| vₙ n + c v_t), vₙ = n·v, n = N/|N|:
/// ∂φ/∂v = (2ρ |vₙ| - c) (u·n) n + c u, ∂φ/∂n = (2ρ |vₙ| - c) (u·n) v + (ρ |vₙ| - c) vₙ u,
/// ∂φ/∂N = (1 - n nᵀ) ∂φ/∂n / |N| `[eq:external-force-gradient]`.
fn external_force(
    graph: &ClothGraph,
    pose: Pose<'_>,
    scale: impl Fn(usize) -> f32,
    rows: Rows<'_>,
    to: &mut PoseGradient<'_>,
) {
    let Some(air) = Air::around(graph) else {
        return;
    };
    let faces = graph.topology().faces().iter();
    for (face, &area) in faces.zip(graph.cloth().face_area()) {
        let corners = face.map(|v| v.index());
        let [a, b, c] = corners.map(|v| pose.current[v]);
        let relative = air.relative(corners, pose);
        let (by_b, by_c) = (b - a, c - a);
        let across = by_b.cross(by_c);
        let size = across.length();
        if size == 0.0 {
            continue;
        }
        let normal = across / size;
        let along = normal.dot(relative);
        let sum: Vec3 = corners.iter().map(|&v| scale(v) * rows.vector(v)).sum();
        let force = pose.yaw.to_world(area / 3.0 * sum);
        let slope = (2.0 * air.density * along.abs() - air.drag) * force.dot(normal);
        let by_relative = slope * normal + air.drag * force;
        let by_normal = slope * relative + (air.density * along.abs() - air.drag) * along * force;
        let by_across = (by_normal - normal.dot(by_normal) * normal) / size;
        let (to_b, to_c) = (by_c.cross(by_across), by_across.cross(by_b));
        let by_move = -air.corner_rate * by_relative;
        for (v, by_corner) in corners.into_iter().zip([-to_b - to_c, to_b, to_c]) {
            to.current[v] += by_corner + by_move;
            to.previous[v] -= by_move;
        }
    }
}

fn kinetic_energy(graph: &ClothGraph, pose: Pose<'_>, rows: Rows<'_>, to: &mut PoseGradient<'_>) {
    for (v, &mass) in graph.cloth().vertex_mass().iter().enumerate() {
        let momentum = mass * (pose.current[v] - pose.previous[v]);
        to.current[v] += rows.get(v, 0) * momentum;
        to.previous[v] -= rows.get(v, 0) * momentum;
    }
}

/// The vector between the two vertices of each edge and its length, in both arcs.
fn vector(graph: &ClothGraph, pose: Pose<'_>, rows: Rows<'_>, to: &mut [Vec3]) {
    let edges = graph.topology().edges().iter();
    for (edge, &arcs) in edges.zip(&graph.edge_arcs) {
        let ends = edge.vertices.map(|v| v.index());
        let [forward, back] = arcs.map(|arc| arc as usize);
        let by_difference = rows.vector(forward) - rows.vector(back);
        let by_length = rows.get(forward, 3) + rows.get(back, 3);
        let along = (pose.current[ends[0]] - pose.current[ends[1]]).normalize_or_zero();
        let by_edge = pose.yaw.to_world(by_difference) + by_length * along;
        to[ends[0]] += by_edge;
        to[ends[1]] -= by_edge;
    }
}

/// A quantity of each edge that grows by `scale` per length.
fn elongation(
    graph: &ClothGraph,
    pose: Pose<'_>,
    scale: impl Fn(usize) -> f32,
    rows: Rows<'_>,
    to: &mut [Vec3],
) {
    let edges = graph.topology().edges().iter().map(|edge| edge.vertices);
    let edges = edges.zip(edge_ends(graph, pose.current)).enumerate();
    for (edge, (ends, ((a, b), arcs))) in edges {
        let by_length: f32 = arcs.iter().map(|&arc| rows.get(arc as usize, 0)).sum();
        let by_edge = scale(edge) * by_length * (a - b).normalize_or_zero();
        to[ends[0].index()] += by_edge;
        to[ends[1].index()] -= by_edge;
    }
}

/// With the pull f at the length l along u, g the gradient of the force: f' (u·g) u + f/l (g - (u·g) u)
/// `[eq:edge-pull-gradient]`.
fn stretch_acceleration(graph: &ClothGraph, pose: Pose<'_>, rows: Rows<'_>, to: &mut [Vec3]) {
    let edges = graph.topology().edges().iter().map(|edge| edge.vertices);
    let ends = edges.zip(edge_ends(graph, pose.current));
    for ((vertices, ((a, b), arcs)), spring) in ends.zip(&graph.weave().springs) {
        let length = a.distance(b);
        if length == 0.0 {
            continue;
        }
        let along = (a - b) / length;
        let [pull, growth] = spring.pull(length);
        let [to_a, to_b] = vertices.map(|v| per_force(graph, v.index()));
        let [forward, back] = arcs.map(|arc| rows.vector(arc as usize));
        let by_force = pose.yaw.to_world(to_b * forward - to_a * back);
        let lengthwise = along.dot(by_force) * along;
        let by_edge = growth * lengthwise + pull / length * (by_force - lengthwise);
        to[vertices[0].index()] += by_edge;
        to[vertices[1].index()] -= by_edge;
    }
}

fn bend_acceleration(graph: &ClothGraph, pose: Pose<'_>, rows: Rows<'_>, to: &mut [Vec3]) {
    let slope = |number: usize, angle: f64| {
        let [_, growth] = graph.weave().torques[number].push(angle as f32);
        receivers(graph, &graph.hinges()[number]).map(|v| per_force(graph, v) * growth)
    };
    bending(graph, pose, slope, rows, to);
}

/// A quantity of the two arcs of each hinge that grows by `slope` (of its number and angle) per angle.
fn bending(
    graph: &ClothGraph,
    pose: Pose<'_>,
    slope: impl Fn(usize, f64) -> [f32; 2],
    rows: Rows<'_>,
    to: &mut [Vec3],
) {
    for (number, hinge) in graph.hinges().iter().enumerate() {
        let vertices = [hinge.from, hinge.to, hinge.left, hinge.right].map(|v| v as usize);
        let points = vertices.map(|v| pose.current[v].as_dvec3());
        let (angle, slopes) = bending_angle_with_gradient(points);
        let arcs = graph.edge_arcs[hinge.edge as usize].into_iter();
        let by_arc = arcs.zip(slope(number, angle));
        let by_angle: f32 = by_arc
            .map(|(arc, slope)| slope * rows.get(arc as usize, 0))
            .sum();
        for (v, slope) in vertices.into_iter().zip(slopes) {
            to[v] += by_angle * slope.as_vec3();
        }
    }
}
