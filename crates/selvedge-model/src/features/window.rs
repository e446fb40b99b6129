//! The normalised features of a window of frames, as the network takes them, and the way back of
//! their gradient. Training and rollouts share this code.

use glam::Vec3;
use selvedge_cloth::VertexId;

use crate::features::backward::{PoseGradient, features_backward};
use crate::features::columns::{Pose, features};
use crate::features::normalizer::Normalizer;
use crate::graph::ClothGraph;
use crate::graph::connectivity::Connectivity;
use crate::graph::frame::Yaw;
use crate::network::{Input, InputGradient};
use crate::spec::ModelSpec;

/// Positions that a window of one cloth is made from.
#[derive(Clone, Copy, Debug)]
pub struct Frames<'a, F> {
    /// Positions `[m]` in the frames before the window and in each frame of it, oldest first,
    /// `[history][vertices]` with [`ModelSpec::history`] frames.
    pub positions: &'a [F],
    /// Positions of the handles in the frame after the newest `[m]`, `[handles]`.
    pub next_handles: &'a [Vec3],
    /// The local frame of the newest frame.
    pub yaw: Yaw,
}

impl<F: AsRef<[Vec3]>> Frames<'_, F> {
    /// Frame `current` and the one before it, which features are made from.
    fn pose(&self, current: usize) -> Pose<'_> {
        let at = |number: usize| self.positions[number].as_ref();
        Pose {
            previous: at(current - 1),
            current: at(current),
            next_handles: self.next_handles,
            yaw: self.yaw,
        }
    }

    /// The numbers of the frames of the window.
    fn window(&self, spec: &ModelSpec) -> std::ops::Range<usize> {
        let history = self.positions.len();
        assert_eq!(history, spec.history(), "frames of a window");
        history - spec.window()..history
    }
}

/// Place of one cloth in a disjoint union.
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
    pub fn alone(graph: &ClothGraph) -> Self {
        Self {
            first_vertex: 0,
            vertex_count: graph.vertex_count(),
            first_arc: 0,
            arc_count: graph.arc_count(),
        }
    }

    /// The cloths `graphs` side by side, in order.
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
    pub arcs: Vec<f32>,
}

impl Window {
    /// Makes room for a union.
    pub fn fit(&mut self, spec: &ModelSpec, place: &Place) {
        let frames = spec.window();
        self.nodes
            .resize(frames * place.vertex_count * spec.node_width(), 0.0);
        self.arcs
            .resize(frames * place.arc_count * spec.edge_width(), 0.0);
    }

    /// Makes room for the union and writes the features of one cloth of it, not yet normalised.
    ///
    /// # Panics
    /// When there are not `history` frames.
    pub fn write<F: AsRef<[Vec3]>>(
        &mut self,
        spec: &ModelSpec,
        graph: &ClothGraph,
        frames: Frames<'_, F>,
        place: &Place,
    ) {
        self.fit(spec, place);
        let (node_width, edge_width) = (spec.node_width(), spec.edge_width());
        for (step, current) in frames.window(spec).enumerate() {
            let pose = frames.pose(current);
            let row = step * place.vertex_count + place.first_vertex;
            let nodes = &mut self.nodes[row * node_width..][..graph.vertex_count() * node_width];
            let row = step * place.arc_count + place.first_arc;
            let arcs = &mut self.arcs[row * edge_width..][..graph.arc_count() * edge_width];
            features(spec, graph, pose, nodes, arcs);
        }
    }

    /// Adds to `to` (`[history][vertices]`, in the world) the gradient of the positions that
    /// [`Self::write`] took, for a cloth by itself. `gradient` is that of the features before
    /// normalisation ([`Normalizer::scale_gradient`]).
    ///
    /// # Panics
    /// When there are not `history` frames, or `gradient` does not have the size of the cloth.
    pub fn backward<F: AsRef<[Vec3]>>(
        spec: &ModelSpec,
        graph: &ClothGraph,
        frames: Frames<'_, F>,
        gradient: &InputGradient<'_, f32>,
        to: &mut [Vec<Vec3>],
    ) {
        let nodes = graph.vertex_count() * spec.node_width();
        let edges = graph.arc_count() * spec.edge_width();
        for (step, current) in frames.window(spec).enumerate() {
            let pose = frames.pose(current);
            let (before, later) = to.split_at_mut(current);
            let mut by_pose = PoseGradient {
                previous: &mut before[current - 1],
                current: &mut later[0],
            };
            let nodes = &gradient.nodes[step * nodes..][..nodes];
            let arcs = &gradient.arcs[step * edges..][..edges];
            features_backward(spec, graph, pose, [nodes, arcs], &mut by_pose);
        }
    }

    /// The features for the network.
    pub fn input(&self) -> Input<'_, f32> {
        Input {
            nodes: &self.nodes,
            arcs: &self.arcs,
        }
    }

    /// The same room, for the gradient with respect to features.
    pub fn gradient(&mut self) -> InputGradient<'_, f32> {
        InputGradient {
            nodes: &mut self.nodes,
            arcs: &mut self.arcs,
        }
    }

    /// The first vertex with a feature that is not finite, or else the vertex that such an arc
    /// leads to. The network must not see one: a ReLU may make 0 of what is no number, on some
    /// processors and not on others.
    pub fn first_non_finite(&self, spec: &ModelSpec, graph: &Connectivity) -> Option<VertexId> {
        let row = |values: &[f32], width: usize, rows: usize| {
            let place = values.iter().position(|x| !x.is_finite())?;
            Some(place / width % rows)
        };
        let vertex = row(&self.nodes, spec.node_width(), graph.vertex_count());
        let vertex = vertex.or_else(|| {
            let arc = row(&self.arcs, spec.edge_width(), graph.arc_count())?;
            Some(graph.receivers[arc] as usize)
        });
        vertex.map(|vertex| VertexId(vertex as u32))
    }

    /// Normalises everything.
    pub fn normalize(&mut self, nodes: &Normalizer, edges: &Normalizer) {
        nodes.normalize(&mut self.nodes);
        edges.normalize(&mut self.arcs);
    }
}

#[cfg(test)]
mod tests;
