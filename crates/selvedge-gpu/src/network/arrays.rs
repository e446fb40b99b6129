//! The arrays of a union that a network reads: its arcs, features of a window, states of encoders.

use selvedge_model::{Connectivity, Network};

use crate::device::{DeviceError, Loaded};
use crate::schedule::plan::{Plan, Region};

/// The arcs of a union in the arena.
#[derive(Clone, Copy, Debug)]
pub struct GraphArrays {
    /// Vertices of all cloths.
    pub vertices: usize,
    /// Arcs of all cloths.
    pub arcs: usize,
    /// The vertex that each arc comes from, `[arcs]`.
    pub senders: Region,
    /// The vertex that each arc arrives at, `[arcs]`.
    pub receivers: Region,
    /// The first arc into each vertex, `[vertices + 1]`.
    pub first_arc: Region,
    /// The arc of the same edge the other way, `[arcs]`.
    pub reverse_arcs: Region,
}

impl GraphArrays {
    /// Room for a union with so many vertices and arcs together.
    pub fn new(plan: &mut Plan, vertices: usize, arcs: usize) -> Self {
        Self {
            vertices,
            arcs,
            senders: plan.indices("senders", arcs),
            receivers: plan.indices("receivers", arcs),
            first_arc: plan.indices("first arcs", vertices + 1),
            reverse_arcs: plan.indices("reverse arcs", arcs),
        }
    }

    /// The arrays that [`Self::upload`] writes.
    #[must_use]
    pub fn regions(&self) -> [Region; 4] {
        [
            self.senders,
            self.receivers,
            self.first_arc,
            self.reverse_arcs,
        ]
    }

    /// Writes a graph there.
    ///
    /// # Errors
    /// When the device fails.
    ///
    /// # Panics
    /// When the graph has other sizes.
    pub fn upload(&self, loaded: &mut dyn Loaded, graph: &Connectivity) -> Result<(), DeviceError> {
        let found = [graph.vertex_count(), graph.arc_count()];
        assert_eq!(found, [self.vertices, self.arcs], "vertices and arcs");
        let arrays = [
            graph.senders(),
            graph.receivers(),
            graph.first_arc(),
            graph.reverse_arcs(),
        ];
        for (region, words) in self.regions().into_iter().zip(arrays) {
            loaded.upload(region, words)?;
        }
        Ok(())
    }
}

/// Normalised features of a window in the arena, oldest frame first.
#[derive(Clone, Copy, Debug)]
pub struct InputArrays {
    /// Features of vertices, `[steps, vertices, node width]`.
    pub nodes: Region,
    /// Features of arcs, `[steps, arcs, edge width]`.
    pub arcs: Region,
    /// Frames of vertices and of arcs.
    pub steps: [usize; 2],
}

impl InputArrays {
    /// Room for the features of `steps` frames of vertices and of arcs.
    pub fn new(plan: &mut Plan, network: &Network, graph: &GraphArrays, steps: [usize; 2]) -> Self {
        let (spec, [nodes, arcs]) = (network.spec(), steps);
        Self {
            nodes: plan.floats(
                "vertex features",
                nodes * graph.vertices * spec.node_width(),
            ),
            arcs: plan.floats("arc features", arcs * graph.arcs * spec.edge_width()),
            steps,
        }
    }

    /// Room for the features of a whole window.
    pub fn whole(plan: &mut Plan, network: &Network, graph: &GraphArrays) -> Self {
        let spec = network.spec();
        let steps = [spec.window(); 2];
        Self::new(plan, network, graph, steps)
    }
}

/// States of the recurrent encoders in the arena.
#[derive(Clone, Copy, Debug)]
pub struct StateArrays {
    /// Both layers of vertices, `[vertices, latent]` each.
    pub nodes: [Region; 2],
    /// Both layers of arcs, `[arcs, latent]` each.
    pub arcs: [Region; 2],
}

impl StateArrays {
    /// Room for the states of a union.
    pub fn new(plan: &mut Plan, network: &Network, graph: &GraphArrays) -> Self {
        let latent = network.spec().latent;
        let mut room = |name: &str, rows: usize| {
            [0, 1].map(|layer| plan.floats(format!("{name}, layer {layer}"), rows * latent))
        };
        Self {
            nodes: room("states of vertices", graph.vertices),
            arcs: room("states of arcs", graph.arcs),
        }
    }

    /// All four arrays.
    #[must_use]
    pub fn regions(&self) -> [Region; 4] {
        let ([a, b], [c, d]) = (self.nodes, self.arcs);
        [a, b, c, d]
    }
}
