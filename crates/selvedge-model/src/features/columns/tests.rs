//! Closed forms of the features; their invariances are in `tests/model/invariance.rs`.

use std::collections::BTreeSet;
use std::f32::consts::PI;

use glam::DVec3;
use selvedge_cloth::{Cloth, ClothArrays, Environment, Handles, Topology};

use super::*;
use crate::spec::Encoder;
use crate::test_cloth::{Hanging, parts, shaken};

fn physical() -> ModelSpec {
    ModelSpec::physical(Encoder::MLP, 8, 1)
}

/// Every feature that two frames are enough for.
fn everything() -> ModelSpec {
    let mut spec = physical();
    spec.edge_features.insert(EdgeFeature::MaterialVector);
    spec
}

struct Features {
    nodes: Vec<f32>,
    arcs: Vec<f32>,
}

fn features(spec: &ModelSpec, graph: &ClothGraph, pose: Pose<'_>) -> Features {
    let mut nodes = vec![f32::NAN; graph.vertex_count() * spec.node_width()];
    let mut arcs = vec![f32::NAN; graph.arc_count() * spec.edge_width()];
    super::features(spec, graph, pose, &mut nodes, &mut arcs);
    Features { nodes, arcs }
}

/// Features that two frames are enough for.
fn pose<'a>(previous: &'a [Vec3], current: &'a [Vec3], yaw: Yaw) -> Pose<'a> {
    Pose {
        previous,
        current,
        next_handles: &[],
        yaw,
    }
}

#[test]
fn a_handle_knows_its_next_move_and_a_free_vertex_nothing() {
    let mut graph = parts(3, 1).graph();
    let (previous, current) = moving(graph.cloth().rest_positions());
    let next: Vec<Vec3> = graph.handles().of(&shaken(&current, 0.02, 5)).collect();
    let yaw = Yaw::from_angle(0.4);
    let spec = ModelSpec {
        node_features: [NodeFeature::HandleAcceleration].into(),
        ..ModelSpec::mesh_graph_nets(4, 1)
    };
    let pose = Pose {
        next_handles: &next,
        ..pose(&previous, &current, yaw)
    };
    let first = graph.handles().vertices()[0].index();
    let wanted = yaw.to_local(next[0] - 2.0 * current[first] + previous[first]);
    let rows = |graph: &ClothGraph| -> Vec<Vec3> {
        let nodes = features(&spec, graph, pose).nodes;
        nodes.chunks(3).map(Vec3::from_slice).collect()
    };
    for (v, found) in rows(&graph).into_iter().enumerate() {
        let is_held = graph.handle_mask()[v];
        assert_eq!(found == Vec3::ZERO, !is_held, "{v}");
        assert!(
            v != first || found.distance(wanted) < 1e-6,
            "{found} {wanted}"
        );
    }
    graph.hold(|_| false);
    assert!(rows(&graph).into_iter().all(|row| row == Vec3::ZERO));
}

/// A pose that moves 1 cm per frame everywhere and is bent by as much.
fn moving(rest: &[Vec3]) -> (Vec<Vec3>, Vec<Vec3>) {
    (shaken(rest, 0.01, 8), shaken(rest, 0.01, 9))
}

/// Two unit triangles left and right of the edge 0 → 1 (along z), folded to the bending angle
/// `angle`: the wings fall away from the normals where it is positive.
fn fold(angle: f32) -> (ClothGraph, [Vec3; 4]) {
    let (sin, cos) = angle.sin_cos();
    let positions = [Vec3::ZERO, Vec3::Z, Vec3::X, Vec3::new(-cos, -sin, 0.0)];
    let arrays = ClothArrays {
        vertex_mass: vec![0.1; 4],
        face_area: vec![0.5; 2],
        material_coordinates: vec![glam::Vec2::ZERO; 4],
        rest_positions: positions.to_vec(),
    };
    let topology = Topology::new(4, &[[0, 1, 2], [1, 0, 3]]).expect("two triangles");
    let none = Handles::new(&[], 4).expect("none");
    let parts = Hanging {
        cloth: Cloth::new(topology, none, arrays).expect("a cloth"),
        environment: Environment::default(),
    };
    (parts.graph(), positions)
}

#[test]
fn every_column_has_a_name_of_its_own_and_a_group() {
    for spec in [physical(), everything(), ModelSpec::mesh_graph_nets(8, 1)] {
        assert_eq!(node_columns(&spec).len(), spec.node_width());
        assert_eq!(edge_columns(&spec).len(), spec.edge_width());
        assert_eq!(node_groups(&spec).iter().sum::<usize>(), spec.node_width());
        assert_eq!(edge_groups(&spec).iter().sum::<usize>(), spec.edge_width());
        let mut columns = node_columns(&spec);
        columns.extend(edge_columns(&spec));
        let names: BTreeSet<_> = columns.iter().map(|column| column.name).collect();
        assert_eq!(names.len(), columns.len());
    }
}

#[test]
fn an_arc_sees_its_sender_from_its_receiver_and_its_elongation() {
    let graph = parts(6, 3).graph();
    let (previous, current) = moving(graph.cloth().rest_positions());
    let pose = pose(&previous, &current, Yaw::from_angle(0.4));
    let spec = everything();
    let arcs = features(&spec, &graph, pose).arcs;
    let row = |arc: u32| &arcs[arc as usize * 13..][..13];
    for arc in 0..graph.arc_count() {
        let ends = [
            graph.connectivity().senders[arc],
            graph.connectivity().receivers[arc],
        ]
        .map(|v| current[v as usize]);
        let d = row(arc as u32);
        let world = pose.yaw.to_world(Vec3::new(d[0], d[1], d[2]));
        assert!(
            world.distance(ends[0] - ends[1]) < 1e-6,
            "sender - receiver"
        );
        assert_eq!(
            d[11],
            ends[0].distance(ends[1]) - d[7],
            "elongation against the rest length"
        );
    }
}

#[test]
fn the_rest_pose_at_rest_has_no_elongation_and_its_own_vectors() {
    let graph = parts(6, 4).graph();
    let rest = graph.cloth().rest_positions();
    let pose = pose(rest, rest, graph.frame().rest_yaw());
    for row in features(&everything(), &graph, pose).arcs.chunks(13) {
        assert_eq!(row[..4], row[4..8]);
        assert!(row[11].abs() < 1e-7, "elongation {}", row[11]);
    }
}

#[test]
fn bending_follows_its_closed_form_positive_for_a_ridge() {
    let spec = physical();
    for step in -31..=31 {
        let angle = 0.1 * step as f32;
        let (graph, positions) = fold(angle);
        let pose = pose(&positions, &positions, Yaw::WORLD);
        let arcs = features(&spec, &graph, pose).arcs;
        for (arc, row) in arcs.chunks(10).enumerate() {
            let interior = graph.topology().arcs()[arc].edge.0 == graph.hinges()[0].edge;
            let expected = if interior { angle } else { 0.0 };
            // A few roundings of numbers of order 1.
            assert!(
                (row[9] - expected).abs() < 5e-7,
                "{} for {expected}",
                row[9]
            );
        }
    }
    // The normals point up (+y) and the wing hangs down: a ridge.
    let (_, positions) = fold(0.5);
    let normal = (positions[1] - positions[0]).cross(positions[2] - positions[0]);
    assert!(normal.y > 0.0 && positions[3].y < 0.0);
}

#[test]
fn a_flat_hinge_is_plus_0_a_closed_one_plus_pi_and_a_degenerate_one_0() {
    let angle = |right: Vec3| {
        let (graph, mut positions) = fold(0.0);
        positions[3] = right;
        bending_angle(&graph.hinges()[0], &positions)
    };
    assert_eq!(angle(-Vec3::X).to_bits(), 0.0_f32.to_bits());
    assert_eq!(angle(Vec3::X), PI);
    assert_eq!(angle(Vec3::ZERO), 0.0);
}

/// External force as the equations say it, in f64 and world axes, vertex by vertex.
fn slow_external_force(graph: &ClothGraph, pose: Pose<'_>, vertex: usize) -> DVec3 {
    let air = graph.environment();
    let mut force = f64::from(graph.cloth().vertex_mass()[vertex]) * air.gravity;
    for (face, &area) in graph
        .topology()
        .faces()
        .iter()
        .zip(graph.cloth().face_area())
    {
        if face.iter().all(|v| v.index() != vertex) {
            continue;
        }
        let at = |k: usize| pose.current[face[k].index()].as_dvec3();
        let speed =
            |k: usize| (at(k) - pose.previous[face[k].index()].as_dvec3()) * graph.frame_rate();
        let relative = air.wind - (speed(0) + speed(1) + speed(2)) / 3.0;
        let normal = (at(1) - at(0)).cross(at(2) - at(0)).normalize();
        let along = normal.dot(relative);
        let tangential = relative - along * normal;
        let pressure = air.air_density * along.abs() * along * normal;
        force += f64::from(area) / 3.0 * (pressure + air.air_drag * tangential);
    }
    force
}

#[test]
fn external_force_matches_a_slow_version_in_f64() {
    let graph = parts(7, 2).graph();
    let (previous, current) = moving(graph.cloth().rest_positions());
    let pose = pose(&previous, &current, Yaw::from_angle(-1.2));
    let nodes = features(&physical(), &graph, pose).nodes;
    for (v, row) in nodes.chunks(16).enumerate() {
        let expected = slow_external_force(&graph, pose, v);
        let found = pose.yaw.to_world(Vec3::from_slice(&row[3..6])).as_dvec3();
        // Forces of about 0.02 N from velocities of 0.6 m/s, these exact to 1e-5.
        assert!(found.distance(expected) < 1e-6, "{found} {expected}");
    }
}

#[test]
fn node_types_energies_and_velocities_are_what_they_say() {
    let graph = parts(4, 2).graph();
    let (previous, current) = moving(graph.cloth().rest_positions());
    let pose = pose(&previous, &current, Yaw::from_angle(2.0));
    let nodes = features(&physical(), &graph, pose).nodes;
    for (v, row) in nodes.chunks(16).enumerate() {
        let moved = (current[v] - previous[v]).as_dvec3();
        let velocity = Vec3::new(row[0], row[1], row[2]);
        assert!(pose.yaw.to_world(velocity).as_dvec3().distance(moved) < 1e-8);
        let energy = 0.5 * f64::from(graph.cloth().vertex_mass()[v]) * moved.length_squared();
        assert!((f64::from(row[6]) / energy - 1.0).abs() < 1e-6);
        let kind = usize::from(graph.handle_mask()[v]);
        assert!((0..9).all(|k| row[7 + k] == f32::from(u8::from(k == kind))));
    }
}

#[test]
fn leaving_features_out_leaves_the_columns_of_the_others_unchanged() {
    let graph = parts(5, 2).graph();
    let (previous, current) = moving(graph.cloth().rest_positions());
    let pose = pose(&previous, &current, Yaw::from_angle(0.3));
    let whole = features(&everything(), &graph, pose);
    let part = features(&ModelSpec::mesh_graph_nets(8, 1), &graph, pose);
    for (all, some) in whole.nodes.chunks(16).zip(part.nodes.chunks(12)) {
        assert_eq!((&all[..3], &all[7..]), (&some[..3], &some[3..]));
    }
    for (all, some) in whole.arcs.chunks(13).zip(part.arcs.chunks(7)) {
        assert_eq!((&all[..4], &all[8..11]), (&some[..4], &some[4..]));
    }
}
