//! The arrays of a union that a network reads: its arcs, features of a window, states of encoders.

use selvedge_model::{Connectivity, FILTER_TIMES, Network};

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
    /// Places and shares of the cloths.
    pub places: ClothPlaces,
    /// The modes of the cloths, for a network with filters.
    pub modes: Option<ModeArrays>,
}

/// The cloths of a union among its vertices, in the arena.
#[derive(Clone, Copy, Debug)]
pub struct ClothPlaces {
    /// Cloths.
    pub cloths: usize,
    /// The first vertex of each cloth, and the end of the last, `[cloths + 1]`.
    pub first_vertex: Region,
    /// The number of the cloth of each vertex, `[vertices]`.
    pub cloth_of: Region,
    /// The share of each vertex in the area of its cloth, `[vertices]`.
    pub shares: Region,
}

/// The modes of the cloths of a union in the arena.
#[derive(Clone, Copy, Debug)]
pub struct ModeArrays {
    /// Cloths.
    pub cloths: usize,
    /// Modes of each cloth.
    pub count: usize,
    /// Modes at the vertices, `[vertices, count]`.
    pub values: Region,
    /// The same times the share of each vertex in the area of its cloth, `[vertices, count]`.
    pub weighted: Region,
    /// Part of each mode that is left at each time, `[cloths, count, times]`.
    pub decays: Region,
}

impl ClothPlaces {
    fn new(plan: &mut Plan, vertices: usize, cloths: usize) -> Self {
        Self {
            cloths,
            first_vertex: plan.indices("first vertices of cloths", cloths + 1),
            cloth_of: plan.indices("cloths of all vertices", vertices),
            shares: plan.floats("shares of area", vertices),
        }
    }

    fn upload(&self, loaded: &mut dyn Loaded, graph: &Connectivity) -> Result<(), DeviceError> {
        let first: Vec<u32> = graph.first_vertices().iter().map(|&v| v as u32).collect();
        let cloths = graph.cloths().iter().enumerate();
        let cloth_of: Vec<u32> = cloths
            .flat_map(|(number, cloth)| std::iter::repeat_n(number as u32, cloth.vertices))
            .collect();
        loaded.upload(self.first_vertex, &first)?;
        loaded.upload(self.cloth_of, &cloth_of)?;
        loaded.put(self.shares, graph.shares())
    }
}

impl ModeArrays {
    /// Modes of all cloths.
    #[must_use]
    pub fn rows(&self) -> usize {
        self.cloths * self.count
    }

    /// All arrays.
    #[must_use]
    pub fn regions(&self) -> [Region; 3] {
        [self.values, self.weighted, self.decays]
    }

    fn upload(&self, loaded: &mut dyn Loaded, graph: &Connectivity) -> Result<(), DeviceError> {
        let [values, weighted] = graph.modes();
        let floats = [
            (self.values, values),
            (self.weighted, weighted),
            (self.decays, graph.mode_decays()),
        ];
        for (region, numbers) in floats {
            loaded.put(region, numbers)?;
        }
        Ok(())
    }
}

impl GraphArrays {
    /// Room for a union of `cloths` with so many vertices and arcs together.
    pub fn new(plan: &mut Plan, vertices: usize, arcs: usize, cloths: usize) -> Self {
        Self {
            vertices,
            arcs,
            senders: plan.indices("senders", arcs),
            receivers: plan.indices("receivers", arcs),
            first_arc: plan.indices("first arcs", vertices + 1),
            reverse_arcs: plan.indices("reverse arcs", arcs),
            places: ClothPlaces::new(plan, vertices, cloths),
            modes: None,
        }
    }

    /// The same with room for `count` modes of each cloth, none where that is 0.
    #[must_use]
    pub fn with_modes(mut self, plan: &mut Plan, count: usize) -> Self {
        let cloths = self.places.cloths;
        self.modes = (count > 0).then(|| ModeArrays {
            cloths,
            count,
            values: plan.floats("modes", self.vertices * count),
            weighted: plan.floats("modes times areas", self.vertices * count),
            decays: plan.floats("decays of modes", cloths * count * FILTER_TIMES),
        });
        self
    }

    /// The arrays that [`Self::upload`] writes.
    #[must_use]
    pub fn regions(&self) -> Vec<Region> {
        let mut regions = self.connections().to_vec();
        let ClothPlaces {
            first_vertex,
            cloth_of,
            shares,
            ..
        } = self.places;
        regions.extend([first_vertex, cloth_of, shares]);
        regions.extend(self.modes.iter().flat_map(ModeArrays::regions));
        regions
    }

    fn connections(&self) -> [Region; 4] {
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
        for (region, words) in self.connections().into_iter().zip(arrays) {
            loaded.upload(region, words)?;
        }
        self.places.upload(loaded, graph)?;
        let modes = self.modes.map_or(0, |modes| modes.count);
        assert_eq!(graph.mode_count(), modes, "modes of a cloth");
        match &self.modes {
            Some(modes) => modes.upload(loaded, graph),
            None => Ok(()),
        }
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
        let steps = [spec.node_window(), spec.edge_window()];
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
