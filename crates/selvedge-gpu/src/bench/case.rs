//! A network with its weights on a graph: what the benches load onto a device, and its arrays
//! there.

use selvedge_model::{Connectivity, Input, Network};

use crate::device::{Device, DeviceError, Loaded, Precision, largest_fit, require_memory};
use crate::kernels::Program;
use crate::network::{GraphArrays, InputArrays, WeightArrays};
use crate::schedule::Schedule;
use crate::schedule::plan::Plan;

/// A network with its weights on a graph.
#[derive(Clone, Copy)]
pub struct NetworkCase<'a> {
    /// The network.
    pub network: &'a Network,
    /// Its weights.
    pub weights: &'a [f32],
    /// The arcs.
    pub graph: &'a Connectivity,
}

impl NetworkCase<'_> {
    /// The sizes of the graph.
    pub(super) fn sizes(&self) -> GraphSizes {
        GraphSizes {
            vertices: self.graph.vertex_count(),
            arcs: self.graph.arc_count(),
        }
    }
}

/// Sizes of a graph.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct GraphSizes {
    pub(super) vertices: usize,
    pub(super) arcs: usize,
}

/// The arrays of a case in the arena.
pub(super) struct NetworkArrays {
    pub(super) weights: WeightArrays,
    pub(super) graph: GraphArrays,
    pub(super) input: InputArrays,
}

impl NetworkArrays {
    /// Room for a network on a graph of these sizes.
    pub(super) fn new(plan: &mut Plan, network: &Network, sizes: GraphSizes) -> Self {
        let graph = GraphArrays::new(plan, sizes.vertices, sizes.arcs);
        Self {
            weights: WeightArrays::new(plan, network),
            input: InputArrays::new(plan, network, &graph),
            graph,
        }
    }

    /// Writes normalised features, of as many frames as the pass takes.
    pub(super) fn put(
        &self,
        loaded: &mut dyn Loaded,
        input: Input<'_, f32>,
    ) -> Result<(), DeviceError> {
        loaded.put(self.input.nodes, input.nodes)?;
        loaded.put(self.input.arcs, input.arcs)
    }
}

/// A bench's memory, kernels and schedules, of which loading has to know these.
pub(super) trait Layout {
    /// The layout for a network on a graph of these sizes.
    fn new(network: &Network, sizes: GraphSizes) -> Self;

    /// The memory.
    fn plan(&self) -> &Plan;

    /// The kernels.
    fn program(&self) -> &Program;

    /// The arrays of the network.
    fn arrays(&self) -> &NetworkArrays;
}

/// Loads a case onto a device, with packed weights.
///
/// # Errors
/// Too little memory, with the size that would fit; a device that fails.
///
/// # Panics
/// When the number of weights is not that of the network.
pub(super) fn load<L: Layout>(
    device: &dyn Device,
    case: NetworkCase<'_>,
    precision: Precision,
) -> Result<(L, Box<dyn Loaded>), DeviceError> {
    let sizes = case.sizes();
    let layout = L::new(case.network, sizes);
    require_memory(device, "this network", layout.plan().bytes(), |free| {
        let bytes = |sizes| L::new(case.network, sizes).plan().bytes();
        vertices_that_fit(sizes, free, bytes)
    })?;
    let mut loaded = device.load(layout.program(), layout.plan(), precision)?;
    let arrays = layout.arrays();
    loaded.put(arrays.weights.flat(), case.weights)?;
    arrays.graph.upload(&mut *loaded, case.graph)?;
    let mut pack = Schedule::new("packing the weights");
    arrays.weights.pack(&mut pack);
    let pack = loaded.prepare(&pack)?;
    loaded.run(pack)?;
    Ok((layout, loaded))
}

/// The part of a graph that fits into `free` bytes, in words, where graphs of given sizes need
/// `bytes`.
fn vertices_that_fit(
    sizes: GraphSizes,
    free: usize,
    bytes: impl Fn(GraphSizes) -> usize,
) -> String {
    let part = |vertices: usize| GraphSizes {
        vertices,
        arcs: (sizes.arcs * vertices).div_ceil(sizes.vertices.max(1)),
    };
    let fits = |vertices: usize| bytes(part(vertices)) <= free;
    match largest_fit(sizes.vertices, fits) {
        0 => "not even one vertex would fit".to_owned(),
        low => format!(
            "about {low} vertices would fit, instead of {}",
            sizes.vertices
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn as_many_vertices_as_fit_are_named_with_their_share_of_the_arcs() {
        let bytes = |sizes: GraphSizes| 1000 + 10 * sizes.vertices + sizes.arcs;
        let sizes = GraphSizes {
            vertices: 100,
            arcs: 550,
        };
        let fit = |free: usize| vertices_that_fit(sizes, free, bytes);
        // 60 vertices have 330 arcs.
        assert_eq!(fit(1930), "about 60 vertices would fit, instead of 100");
        assert_eq!(fit(1929), "about 59 vertices would fit, instead of 100");
        assert_eq!(fit(1000), "not even one vertex would fit");
    }
}
