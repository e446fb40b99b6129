//! The bounds of edges in `selvedge bench conformance`. A GPU goes through the edges colour by
//! colour, the processor in their order, so that the two end at different positions where
//! neighbours are out of bounds. Here single edges are, as far from each other that what one moves
//! touches no other: the two must agree, and both keep the bounds.

use std::sync::Arc;

use anyhow::ensure;
use glam::{DVec3, Vec3};
use selvedge_cloth::{HandleTargets, Stepper};
use selvedge_gpu::rollout::stepper::GpuStepper;
use selvedge_model::{ClothGraph, EdgeLimits, LearnedStepper, Model};

use super::{Bound, Checks, Conformance, ROLLOUT, worst};

/// The bounds of edges.
const LIMITS: EdgeLimits = EdgeLimits {
    least: 0.8,
    most: 1.25,
    sweeps: 20,
};

/// Length of the pulled edges, in parts of their length at rest.
const PULLED: f32 = 1.3;

/// The least number of pulled edges.
const LEAST_PULLED: usize = 5;

/// The range of all other edges.
const WITHIN: std::ops::Range<f32> = 0.82..1.23;

/// Most that an edge may be beyond its bounds, in parts of its length at rest: sweeps leave 1e-5,
/// rounding of positions of 1 m about as much on edges of 3 cm.
const BEYOND: f64 = 3e-5;

/// A model with other bounds of edges.
pub(super) fn limited(model: &Model, limits: Option<EdgeLimits>) -> anyhow::Result<Model> {
    let mut spec = model.spec().clone();
    spec.edge_limits = limits;
    let weights = model.weights().to_vec();
    let normalizers = model.normalizers().clone();
    Ok(Model::new(&spec, weights, normalizers, String::new())?)
}

/// Compares a frame from a cloth some of whose edges are pulled out of bounds; the model hardly
/// moves it.
pub(super) fn check(
    conformance: &Conformance<'_>,
    name: &str,
    model: &Model,
    graph: &ClothGraph,
    checks: &mut Checks,
) {
    let (apart, beyond) = match compare(conformance, model, graph) {
        Ok([apart, beyond]) => (Ok(apart), Ok(beyond)),
        Err(error) => (Err(error), Err(anyhow::anyhow!("there is no frame"))),
    };
    checks.add(name, "edges held, m", apart, Bound::Rounding(ROLLOUT));
    checks.add(name, "beyond their bounds", beyond, Bound::Always(BEYOND));
}

/// Returns the distance of vertices `[m]`, and the excess of edges over their bounds in parts of
/// their length.
fn compare(
    conformance: &Conformance<'_>,
    model: &Model,
    graph: &ClothGraph,
) -> anyhow::Result<[f64; 2]> {
    let model = Arc::new(limited(model, Some(LIMITS))?);
    let (start, pulled) = pulled(graph);
    ensure!(pulled >= LEAST_PULLED, "only {pulled} edges to pull");
    let start: [&[Vec3]; 1] = [&start];
    let (device, same) = (conformance.device, Arc::clone(&model));
    let mut gpu = GpuStepper::new(device, same, graph.clone(), &start, conformance.precision)?;
    let mut cpu = LearnedStepper::new(model, graph.clone(), &start)?;
    let held = graph.handles().select(start[0]);
    let held: Vec<DVec3> = held.iter().map(|p| p.as_dvec3()).collect();
    let targets = HandleTargets::at_frame_end(held)?;
    cpu.step(&targets)?;
    gpu.step(&targets)?;
    let pairs = cpu.positions().iter().zip(gpu.positions());
    let apart = worst(0.0, pairs.map(|(p, q)| f64::from(p.distance(*q))));
    let beyond = [cpu.positions(), gpu.positions()].map(|positions| beyond(graph, positions));
    Ok([apart, worst(0.0, beyond.into_iter())])
}

/// The rest pose with single edges pulled, and how many they are. None of a pulled edge's ends and
/// their neighbours is one of another's, and all other edges stay well within the bounds.
fn pulled(graph: &ClothGraph) -> (Vec<Vec3>, usize) {
    let edges: Vec<[usize; 2]> = ends(graph).collect();
    let mut at_vertex = vec![Vec::new(); graph.vertex_count()];
    for (edge, ends) in edges.iter().enumerate() {
        ends.iter().for_each(|&v| at_vertex[v].push(edge));
    }
    let mut positions = graph.rest_positions().to_vec();
    let (mut taken, mut count) = (vec![false; positions.len()], 0);
    for (edge, &[a, b]) in edges.iter().enumerate() {
        let near = at_vertex[a].iter().chain(&at_vertex[b]);
        let around = near.clone().flat_map(|&other| edges[other]);
        let held = [a, b].iter().any(|&v| graph.handle_mask()[v]);
        if held || around.clone().any(|v| taken[v]) {
            continue;
        }
        let before = [positions[a], positions[b]];
        let change = 0.5 * (PULLED - 1.0) * (before[1] - before[0]);
        (positions[a], positions[b]) = (before[0] - change, before[1] + change);
        let mut others = near.filter(|&&other| other != edge);
        if others.all(|&other| WITHIN.contains(&stretch(graph, &positions, other))) {
            around.for_each(|v| taken[v] = true);
            count += 1;
        } else {
            [positions[a], positions[b]] = before;
        }
    }
    (positions, count)
}

/// The largest excess of an edge over its bounds, in parts of its length at rest.
fn beyond(graph: &ClothGraph, positions: &[Vec3]) -> f64 {
    let all = (0..graph.topology().edges().len()).map(|edge| {
        let stretch = f64::from(stretch(graph, positions, edge));
        f64::max(LIMITS.least - stretch, stretch - LIMITS.most)
    });
    worst(0.0, all)
}

/// The length of an edge, in parts of that at rest.
fn stretch(graph: &ClothGraph, positions: &[Vec3], edge: usize) -> f32 {
    let [a, b] = graph.topology().edges()[edge].vertices.map(|v| v.index());
    positions[a].distance(positions[b]) / graph.rest_lengths()[edge]
}

/// Both ends of every edge.
fn ends(graph: &ClothGraph) -> impl Iterator<Item = [usize; 2]> {
    let edges = graph.topology().edges().iter();
    edges.map(|edge| edge.vertices.map(|v| v.index()))
}

#[cfg(test)]
mod tests {
    use super::super::super::cloths::hanging;
    use super::*;

    #[test]
    fn edges_are_pulled_that_share_no_vertex_and_only_they_are_out_of_bounds() {
        let graph = hanging(256).unwrap();
        let (positions, count) = pulled(&graph);
        let mut seen = vec![false; graph.vertex_count()];
        let mut out = 0;
        for (edge, ends) in ends(&graph).enumerate() {
            let stretch = f64::from(stretch(&graph, &positions, edge));
            if (LIMITS.least..LIMITS.most).contains(&stretch) {
                continue;
            }
            out += 1;
            assert!((stretch - f64::from(PULLED)).abs() < 1e-4);
            assert!(ends.iter().all(|&v| !std::mem::replace(&mut seen[v], true)));
        }
        assert!(out == count && count >= LEAST_PULLED, "{out} {count}");
    }
}
