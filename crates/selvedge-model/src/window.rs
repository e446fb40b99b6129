//! The normalised features of a window of frames, as the network takes them; the same code in
//! training and in use.

use glam::Vec3;

use crate::features::{Pose, edge_features, node_features};
use crate::frame::Yaw;
use crate::graph::ClothGraph;
use crate::normalizer::Normalizer;
use crate::spec::ModelSpec;

/// Where one cloth stands in a disjoint union.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Place {
    /// Number of its first vertex.
    pub first_vertex: usize,
    /// Vertices of the whole union.
    pub vertex_count: usize,
    /// Number of its first arc.
    pub first_arc: usize,
    /// Arcs of the whole union.
    pub arc_count: usize,
}

impl Place {
    /// A cloth by itself.
    #[must_use]
    pub fn alone(graph: &ClothGraph) -> Self {
        Self {
            first_vertex: 0,
            vertex_count: graph.vertex_count(),
            first_arc: 0,
            arc_count: graph.arc_count(),
        }
    }

    /// The cloths `graphs` side by side, in order.
    #[must_use]
    pub fn side_by_side(graphs: &[&ClothGraph]) -> Vec<Self> {
        let vertex_count = graphs.iter().map(|g| g.vertex_count()).sum();
        let arc_count = graphs.iter().map(|g| g.arc_count()).sum();
        let (mut first_vertex, mut first_arc) = (0, 0);
        let place = |graph: &&ClothGraph| {
            let place = Self {
                first_vertex,
                vertex_count,
                first_arc,
                arc_count,
            };
            first_vertex += graph.vertex_count();
            first_arc += graph.arc_count();
            place
        };
        graphs.iter().map(place).collect()
    }
}

/// Features of a window of frames of all cloths of a union.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Window {
    /// `[window, vertices, node width]`.
    pub nodes: Vec<f32>,
    /// `[window, arcs, edge width]`.
    pub edges: Vec<f32>,
    /// What accelerations are measured from, `[vertices]`.
    reference: Vec<Vec3>,
}

impl Window {
    /// Makes room for a union.
    pub fn fit(&mut self, spec: &ModelSpec, place: &Place) {
        let window = spec.window();
        self.nodes
            .resize(window * place.vertex_count * spec.node_width(), 0.0);
        self.edges
            .resize(window * place.arc_count * spec.edge_width(), 0.0);
    }

    /// Writes the features of one cloth, not yet normalised: `frames` are its positions `[m]` in
    /// the frames before the window and in each frame of it, oldest first, `[history][vertices]`
    /// with [`ModelSpec::history`] frames.
    ///
    /// # Panics
    /// When there are not `history` frames, or [`Self::fit`] made room for another union.
    pub fn write<F: AsRef<[Vec3]>>(
        &mut self,
        spec: &ModelSpec,
        graph: &ClothGraph,
        frames: &[F],
        yaw: Yaw,
        place: &Place,
    ) {
        assert_eq!(frames.len(), spec.history(), "frames of a window");
        let earlier = frames.len() - spec.window();
        let (node_width, edge_width) = (spec.node_width(), spec.edge_width());
        for step in 0..spec.window() {
            let current = step + earlier;
            let (previous, now) = (frames[current - 1].as_ref(), frames[current].as_ref());
            let before = current.checked_sub(2).map(|before| frames[before].as_ref());
            let before = before.map(|before| {
                // The past acceleration as the network would have had to predict it.
                let handles = graph.handles().select(now);
                let (integration, reference) = (spec.integration, &mut self.reference);
                integration.reference(graph, [before, previous], &handles, yaw, reference);
                &*self.reference
            });
            let pose = Pose {
                before,
                previous,
                current: now,
                yaw,
            };
            let row = step * place.vertex_count + place.first_vertex;
            let rows = &mut self.nodes[row * node_width..][..graph.vertex_count() * node_width];
            node_features(spec, graph, pose, rows);
            let row = step * place.arc_count + place.first_arc;
            let rows = &mut self.edges[row * edge_width..][..graph.arc_count() * edge_width];
            edge_features(spec, graph, pose, rows);
        }
    }

    /// Normalises everything.
    pub fn normalize(&mut self, nodes: &Normalizer, edges: &Normalizer) {
        nodes.normalize(&mut self.nodes);
        edges.normalize(&mut self.edges);
    }
}

#[cfg(test)]
mod tests;
