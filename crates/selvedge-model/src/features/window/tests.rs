//! A union of cloths holds, row for row, what each cloth gives by itself.

use super::*;
use crate::graph::ClothGraph;
use crate::graph::frame::Yaw;
use crate::spec::{EdgeFeature, Encoder, NodeFeature};
use crate::test_cloth::{parts, shaken};

/// A cloth, and its positions in the frames that a window of `window` needs.
fn cloth(side: usize, window: usize) -> (ClothGraph, Vec<Vec<Vec3>>) {
    let graph = parts(side, side as u64).graph();
    let frames = (0..=window as u64).map(|k| shaken(graph.cloth().rest_positions(), 0.01, k));
    let frames = frames.collect();
    (graph, frames)
}

fn of(positions: &[Vec<Vec3>], yaw: Yaw) -> Frames<'_, Vec<Vec3>> {
    Frames {
        positions,
        next_handles: &[],
        yaw,
    }
}

fn normalizer(width: usize) -> Normalizer {
    let mean = (0..width).map(|k| 0.01 * k as f64).collect();
    Normalizer::new(mean, vec![0.5; width]).expect("statistics")
}

fn normalized(spec: &ModelSpec, cloths: &[&(ClothGraph, Vec<Vec<Vec3>>)], yaw: Yaw) -> Window {
    let graphs: Vec<&ClothGraph> = cloths.iter().map(|(graph, _)| graph).collect();
    let mut window = Window::default();
    for ((graph, frames), place) in cloths.iter().zip(Place::side_by_side(&graphs)) {
        window.write(spec, graph, of(frames, yaw), &place);
    }
    window.normalize(
        &normalizer(spec.node_width()),
        &normalizer(spec.edge_width()),
    );
    window
}

/// Row blocks of `[window, rows of both cloths, width]` that belong to one of them.
fn rows_of(values: &[f32], window: usize, part: std::ops::Range<usize>) -> Vec<f32> {
    let step = values.len() / window;
    values
        .chunks_exact(step)
        .flat_map(|rows| rows[part.clone()].to_vec())
        .collect()
}

#[test]
fn a_union_holds_what_each_cloth_gives_by_itself() {
    for spec in [
        ModelSpec::physical(Encoder::Gru { window: 3 }, 4, 1),
        ModelSpec::mesh_graph_nets(4, 1),
    ] {
        let window = spec.window();
        let (small, large) = (cloth(3, window), cloth(4, window));
        let yaw = Yaw::from_angle(0.4);
        let together = normalized(&spec, &[&small, &large], yaw);
        let nodes = |cloth: &(ClothGraph, _)| cloth.0.vertex_count() * spec.node_width();
        let edges = |cloth: &(ClothGraph, _)| cloth.0.arc_count() * spec.edge_width();
        for (part, before) in [(&small, None), (&large, Some(&small))] {
            let alone = normalized(&spec, &[part], yaw);
            let first = before.map_or(0, nodes);
            let range = first..first + nodes(part);
            assert_eq!(rows_of(&together.nodes, window, range), alone.nodes);
            let first = before.map_or(0, edges);
            let range = first..first + edges(part);
            assert_eq!(rows_of(&together.arcs, window, range), alone.arcs);
        }
    }
}

#[test]
fn room_made_for_another_union_leaves_nothing_of_it() {
    let spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 4, 1);
    let (small, large) = (cloth(3, 2), cloth(4, 2));
    let mut window = normalized(&spec, &[&large, &small], Yaw::WORLD);
    let place = Place::alone(&small.0);
    window.write(&spec, &small.0, of(&small.1, Yaw::WORLD), &place);
    window.normalize(
        &normalizer(spec.node_width()),
        &normalizer(spec.edge_width()),
    );
    assert_eq!(window, normalized(&spec, &[&small], Yaw::WORLD));
}

/// Σ coefficient ∘ features.
fn objective(spec: &ModelSpec, graph: &ClothGraph, frames: Frames<'_, Vec<Vec3>>) -> f64 {
    let mut window = Window::default();
    let place = Place::alone(graph);
    window.write(spec, graph, frames, &place);
    let sum = |features: &[f32]| -> f64 {
        let rows = features.iter().enumerate();
        rows.map(|(k, &x)| f64::from(coefficient(k)) * f64::from(x))
            .sum()
    };
    sum(&window.nodes) + sum(&window.arcs)
}

fn coefficient(k: usize) -> f32 {
    ((k * 37 % 101) as f32 - 50.0) / 50.0
}

/// Each feature by itself, so that a large one hides no other.
fn each_feature(encoder: Encoder) -> Vec<ModelSpec> {
    let none = ModelSpec {
        node_features: [].into(),
        edge_features: [].into(),
        ..ModelSpec::physical(encoder, 4, 1)
    };
    let nodes = [
        NodeFeature::Velocity,
        NodeFeature::ExternalForce,
        NodeFeature::KineticEnergy,
        NodeFeature::ExternalAcceleration,
    ];
    let edges = [
        EdgeFeature::Vector,
        EdgeFeature::Elongation,
        EdgeFeature::BendingAngle,
        EdgeFeature::Strain,
        EdgeFeature::StretchAcceleration,
        EdgeFeature::BendAcceleration,
    ];
    let of_node = nodes.map(|feature| ModelSpec {
        node_features: [feature].into(),
        ..none.clone()
    });
    let of_edge = edges.map(|feature| ModelSpec {
        edge_features: [feature].into(),
        ..none.clone()
    });
    of_node.into_iter().chain(of_edge).collect()
}

#[test]
fn the_gradient_of_every_feature_matches_finite_differences() {
    let (graph, frames) = cloth(4, 4);
    let yaw = Yaw::from_angle(0.4);
    for spec in each_feature(Encoder::Gru { window: 2 }) {
        let frames = &frames[..spec.history()];
        let at = |positions: &[Vec<Vec3>]| objective(&spec, &graph, of(positions, yaw));
        let mut gradient = vec![vec![Vec3::ZERO; graph.vertex_count()]; frames.len()];
        let rows = |count: usize| (0..count).map(coefficient).collect::<Vec<f32>>();
        let mut nodes = rows(2 * graph.vertex_count() * spec.node_width());
        let mut edges = rows(2 * graph.arc_count() * spec.edge_width());
        let by_input = InputGradient {
            nodes: &mut nodes,
            arcs: &mut edges,
        };
        Window::backward(&spec, &graph, of(frames, yaw), &by_input, &mut gradient);
        let size = gradient.iter().flatten().map(|g| g.length_squared());
        let size = size.sum::<f32>().sqrt();
        assert!(size > 0.0, "{spec:?}");
        for frame in 0..frames.len() {
            for seed in 0..4 {
                let still = vec![Vec3::ZERO; graph.vertex_count()];
                let direction = shaken(&still, 1.0, seed);
                let step = 1e-3;
                let moved = |sign: f32| {
                    let mut moved = frames.to_vec();
                    for (p, d) in moved[frame].iter_mut().zip(&direction) {
                        *p += sign * step * *d;
                    }
                    at(&moved)
                };
                let slope = (moved(1.0) - moved(-1.0)) / (2.0 * f64::from(step));
                let found = gradient[frame].iter().zip(&direction);
                let found: f32 = found.map(|(g, d)| g.dot(*d)).sum();
                // Positions of 1 m in f32 are good to 6e-8 m in a step of 1e-3; third derivatives
                // of angles of edges of 0.3 m give as much.
                let error = (slope - f64::from(found)).abs();
                assert!(
                    error < 1e-3 * f64::from(size),
                    "{spec:?} frame {frame}: slope {slope}, gradient {found}, size {size}"
                );
            }
        }
    }
}

#[test]
fn the_vertex_of_a_feature_is_found_in_any_frame_of_the_window() {
    let graph = parts(4, 1).graph();
    let spec = ModelSpec::physical(Encoder::Gru { window: 3 }, 8, 1);
    let mut window = Window::default();
    window.fit(&spec, &Place::alone(&graph));
    let (arcs, graph) = (graph.arc_count(), graph.connectivity());
    let found = |window: &Window| window.first_non_finite(&spec, graph).map(VertexId::index);
    assert_eq!(found(&window), None);
    window.arcs[(2 * arcs + 7) * spec.edge_width() + 1] = f32::NAN;
    assert_eq!(found(&window), Some(graph.receivers[7] as usize));
    window.nodes[(graph.vertex_count() + 5) * spec.node_width() + 3] = f32::INFINITY;
    assert_eq!(found(&window), Some(5));
}
