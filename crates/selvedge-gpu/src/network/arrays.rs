//! The arrays of a union that a network reads: its arcs and features of a window.

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
    /// Frames of the window.
    pub steps: usize,
}

impl InputArrays {
    /// Room for the features of a window.
    pub fn new(plan: &mut Plan, network: &Network, graph: &GraphArrays) -> Self {
        let (spec, steps) = (network.spec(), network.spec().window());
        Self {
            nodes: plan.floats(
                "vertex features",
                steps * graph.vertices * spec.node_width(),
            ),
            arcs: plan.floats("arc features", steps * graph.arcs * spec.edge_width()),
            steps,
        }
    }
}
