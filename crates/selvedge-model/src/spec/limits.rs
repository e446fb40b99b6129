//! Bounds of the edge lengths of a learned cloth. A network's error at one edge can grow from frame
//! to frame; bounded edges stop that.
//!
//! Position-based: after each frame every edge that is longer or shorter than its bounds is brought
//! back to them, its ends moving against each other in inverse proportion to their masses, edge by
//! edge, in several sweeps `[eq:edge-limits]`. Handles do not move. Momentum about free vertices is
//! kept. Violations that remain after the last sweep stay. An edge without a direction is skipped.

use glam::Vec3;
use serde::{Deserialize, Serialize};

use crate::graph::ClothGraph;

/// Bounds of the length of every edge, in parts of its length in the sagged rest pose.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EdgeLimits {
    /// Least length.
    pub least: f64,
    /// Greatest length.
    pub most: f64,
    /// Most sweeps over all edges.
    pub sweeps: u32,
}

impl EdgeLimits {
    /// Moves free vertices until every edge keeps its bounds, or the sweeps are used up. Returns
    /// the number of edges that were out of bounds before.
    ///
    /// # Panics
    /// When there are not as many positions as vertices.
    pub fn apply(&self, graph: &ClothGraph, positions: &mut [Vec3]) -> usize {
        assert_eq!(positions.len(), graph.vertex_count(), "positions");
        let first = self.sweep(graph, positions);
        let mut changed = first;
        for _ in 1..self.sweeps {
            if changed == 0 {
                break;
            }
            changed = self.sweep(graph, positions);
        }
        first
    }

    /// Corrects all edges once and returns the number of edges that were out of bounds.
    fn sweep(&self, graph: &ClothGraph, positions: &mut [Vec3]) -> usize {
        let (least, most) = (self.least as f32, self.most as f32);
        let (mask, mass) = (graph.handle_mask(), graph.vertex_mass());
        let inverse = |v: usize| if mask[v] { 0.0 } else { 1.0 / mass[v] };
        let mut changed = 0;
        for (edge, &rest) in graph.topology().edges().iter().zip(graph.rest_lengths()) {
            let [a, b] = edge.vertices.map(|v| v.index());
            let apart = positions[a] - positions[b];
            let length = apart.length();
            let wanted = length.clamp(least * rest, most * rest);
            let (of_a, of_b) = (inverse(a), inverse(b));
            let both = of_a + of_b;
            // The slack is the rounding of lengths of f32 positions about 1 m from the origin.
            let off = (wanted - length).abs() > 1e-5 * rest;
            if !off || both == 0.0 || length == 0.0 || !length.is_finite() {
                continue;
            }
            let change = (wanted - length) / (length * both) * apart;
            positions[a] += of_a * change;
            positions[b] -= of_b * change;
            changed += 1;
        }
        changed
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_cloth::{parts, shaken};

    const LIMITS: EdgeLimits = EdgeLimits {
        least: 0.8,
        most: 1.25,
        sweeps: 400,
    };

    fn worst(graph: &ClothGraph, positions: &[Vec3]) -> f32 {
        let edges = graph.topology().edges().iter().zip(graph.rest_lengths());
        let beyond = edges.map(|(edge, &rest)| {
            let [a, b] = edge.vertices.map(|v| positions[v.index()]);
            let stretch = a.distance(b) / rest;
            (stretch - LIMITS.most as f32).max(LIMITS.least as f32 - stretch)
        });
        beyond.fold(0.0, f32::max)
    }

    #[test]
    fn edges_come_back_within_bounds_and_handles_stay() {
        let graph = parts(8, 1).graph();
        let start = shaken(graph.rest_positions(), 0.04, 3);
        let mut limited = start.clone();
        for v in graph.handles().vertices() {
            limited[v.index()] = graph.rest_positions()[v.index()];
        }
        let before = worst(&graph, &limited);
        assert!(before > 0.1, "something to do");
        let handles = graph.handles().select(&limited);
        assert!(LIMITS.apply(&graph, &mut limited) > 10);
        assert_eq!(graph.handles().select(&limited), handles);
        // Sweeps stop when all are within the slack of 1e-5.
        assert!(worst(&graph, &limited) < 2e-5);
        let again = limited.clone();
        assert_eq!(LIMITS.apply(&graph, &mut limited), 0);
        assert_eq!(limited, again, "what is within bounds does not move");
    }

    #[test]
    fn momentum_is_kept_without_handles() {
        let none = selvedge_cloth::Handles::new(&[], 36).expect("none");
        let mut free = parts(6, 2);
        free.cloth = free.cloth.with_handles(none).expect("a cloth");
        let graph = free.graph();
        let start = shaken(graph.rest_positions(), 0.05, 4);
        let mut limited = start.clone();
        assert!(LIMITS.apply(&graph, &mut limited) > 0);
        let moved = limited.iter().zip(&start).zip(graph.vertex_mass());
        let impulse: Vec3 = moved.clone().map(|((p, q), &m)| m * (*p - *q)).sum();
        let scale: f32 = moved.map(|((p, q), &m)| m * p.distance(*q)).sum();
        // Opposite moves of equal weight, rounded to 6e-8 of positions, thousands of times.
        assert!(impulse.length() < 1e-3 * scale, "{impulse} of {scale}");
    }

    #[test]
    fn a_single_edge_ends_at_its_bound() {
        let graph = parts(2, 1).graph();
        let mut pulled = graph.rest_positions().to_vec();
        let free = (0..4)
            .find(|&v| !graph.handle_mask()[v])
            .expect("a free one");
        pulled[free] += Vec3::new(0.0, -0.9, 0.0);
        LIMITS.apply(&graph, &mut pulled);
        assert!(worst(&graph, &pulled) < 2e-5);
        let mut lost = vec![Vec3::NAN; 4];
        LIMITS.apply(&graph, &mut lost);
        assert!(
            lost[free].is_nan(),
            "what is not finite stays so, for the step to report"
        );
    }
}
