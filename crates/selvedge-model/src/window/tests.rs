//! A union of cloths holds, row for row, what each cloth gives by itself.

use super::*;
use crate::graph::ClothGraph;
use crate::spec::Encoder;
use crate::test_cloth::{parts, shaken};

/// A cloth, and its positions in the frames that a window of `window` needs.
fn cloth(side: usize, window: usize) -> (ClothGraph, Vec<Vec<Vec3>>) {
    let graph = ClothGraph::new(parts(side, side as u64)).expect("a cloth");
    let frames = (0..=window as u64).map(|k| shaken(graph.rest_positions(), 0.01, k));
    let frames = frames.collect();
    (graph, frames)
}

fn normalizer(width: usize) -> Normalizer {
    let mean = (0..width).map(|k| 0.01 * k as f64).collect();
    Normalizer::new(mean, vec![0.5; width]).expect("statistics")
}

fn normalized(spec: &ModelSpec, cloths: &[&(ClothGraph, Vec<Vec<Vec3>>)], yaw: Yaw) -> Window {
    let graphs: Vec<&ClothGraph> = cloths.iter().map(|(graph, _)| graph).collect();
    let mut window = Window::default();
    for ((graph, frames), place) in cloths.iter().zip(Place::side_by_side(&graphs)) {
        window.fit(spec, &place);
        window.write(spec, graph, frames, yaw, &place);
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
            assert_eq!(rows_of(&together.edges, window, range), alone.edges);
        }
    }
}

#[test]
fn room_made_for_another_union_leaves_nothing_of_it() {
    let spec = ModelSpec::physical(Encoder::Gru { window: 2 }, 4, 1);
    let (small, large) = (cloth(3, 2), cloth(4, 2));
    let mut window = normalized(&spec, &[&large, &small], Yaw::WORLD);
    let place = Place::alone(&small.0);
    window.fit(&spec, &place);
    window.write(&spec, &small.0, &small.1, Yaw::WORLD, &place);
    window.normalize(
        &normalizer(spec.node_width()),
        &normalizer(spec.edge_width()),
    );
    assert_eq!(window, normalized(&spec, &[&small], Yaw::WORLD));
}
