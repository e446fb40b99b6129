//! A [`Network`] as schedules: which kernels and products take normalised features to accelerations, and
//! what they leave for the way back.
//!
//! It is the same network as `selvedge_model`'s, with the same split of the first edge layer, the same
//! weights in the same order; only what is done in one go differs. Rows are vertices or arcs of a
//! disjoint union, as many cloths as wanted.

mod backward;
mod block;
mod dropout;
mod encoder;
mod mlp;
mod record;
mod weights;

use selvedge_model::{Connectivity, Network};

use crate::device::{DeviceError, Loaded};
use crate::schedule::plan::{Plan, Region};
use crate::schedule::{Finish, Matrix, Onto, Product, Schedule};

pub use backward::{BackwardPass, backward};
use dropout::drop_out;
pub use dropout::{Dropout, DropoutSizes};
pub use encoder::{RowEncoder, row_encoders};
pub use record::{BlockRecord, EncoderRecord, GruRecord, MlpRecord, Record};
pub use weights::WeightArrays;

/// Columns of the output: an acceleration.
pub const OUTPUTS: usize = 3;

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
    /// The same edge the other way, `[arcs]`.
    pub twins: Region,
}

impl GraphArrays {
    /// Room for a union of so many vertices and arcs.
    pub fn new(plan: &mut Plan, vertices: usize, arcs: usize) -> Self {
        Self {
            vertices,
            arcs,
            senders: plan.indices("senders", arcs),
            receivers: plan.indices("receivers", arcs),
            first_arc: plan.indices("first arcs", vertices + 1),
            twins: plan.indices("twins", arcs),
        }
    }

    /// All of it.
    #[must_use]
    pub fn regions(&self) -> [Region; 4] {
        [self.senders, self.receivers, self.first_arc, self.twins]
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
            graph.twins(),
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
    /// `[steps, vertices, node width]`.
    pub nodes: Region,
    /// `[steps, arcs, edge width]`.
    pub edges: Region,
    /// Frames of vertices and of arcs.
    pub steps: [usize; 2],
}

impl InputArrays {
    /// Room for the features of so many frames.
    pub fn new(plan: &mut Plan, network: &Network, graph: &GraphArrays, steps: [usize; 2]) -> Self {
        let (spec, [nodes, edges]) = (network.spec(), steps);
        Self {
            nodes: plan.floats(
                "vertex features",
                nodes * graph.vertices * spec.node_width(),
            ),
            edges: plan.floats("arc features", edges * graph.arcs * spec.edge_width()),
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

/// States of the recurrent encoders in the arena: both layers of vertices `[vertices, latent]`, then of
/// arcs `[arcs, latent]`.
#[derive(Clone, Copy, Debug)]
pub struct StateArrays {
    /// Of vertices.
    pub nodes: [Region; 2],
    /// Of arcs.
    pub edges: [Region; 2],
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
            edges: room("states of arcs", graph.arcs),
        }
    }

    /// All of them.
    #[must_use]
    pub fn regions(&self) -> [Region; 4] {
        let ([a, b], [c, d]) = (self.nodes, self.edges);
        [a, b, c, d]
    }
}

/// What a forward pass leaves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Keep {
    /// The output.
    Output,
    /// The activations as well, for a backward pass.
    Activations(Option<Dropout>),
}

/// A forward pass.
#[derive(Clone, Copy, Debug)]
pub struct ForwardPass<'a> {
    /// The network.
    pub network: &'a Network,
    /// Its weights.
    pub weights: &'a WeightArrays,
    /// The arcs.
    pub graph: &'a GraphArrays,
    /// The features.
    pub input: &'a InputArrays,
    /// The states that the encoders go on from; they begin with zero without.
    pub start: Option<&'a StateArrays>,
    /// Where the encoders' last states are left, if wanted.
    pub end: Option<&'a StateArrays>,
    /// What is left.
    pub keep: Keep,
}

/// Adds a forward pass to a schedule, and what it needs to a plan. The packed weights must be those of
/// [`WeightArrays::pack`].
pub fn forward(plan: &mut Plan, schedule: &mut Schedule, pass: ForwardPass<'_>) -> Record {
    let spec = pass.network.spec();
    let (latent, graph) = (spec.latent, pass.graph);
    let mut lower = Lower {
        plan,
        schedule,
        weights: pass.weights,
        latent,
        keep: pass.keep,
    };
    let output = lower.plan.floats("output", graph.vertices * OUTPUTS);
    let mut nodes = lower
        .plan
        .floats("latent vertices", graph.vertices * latent);
    let mut edges = lower.plan.floats("latent arcs", graph.arcs * latent);
    let [node_encoder, edge_encoder] = lower.encode(&pass, [nodes, edges]);
    let mut blocks = Vec::new();
    for number in 0..spec.blocks {
        let record = lower.block(number, graph, [nodes, edges], blocks.last());
        [nodes, edges] = record.after;
        blocks.push(record);
    }
    let decoder = lower.decode(graph.vertices, nodes, output);
    Record {
        node_encoder,
        edge_encoder,
        blocks,
        decoder,
        nodes,
        output,
    }
}

/// A schedule under construction.
pub(crate) struct Lower<'a> {
    pub(crate) plan: &'a mut Plan,
    pub(crate) schedule: &'a mut Schedule,
    pub(crate) weights: &'a WeightArrays,
    pub(crate) latent: usize,
    pub(crate) keep: Keep,
}

impl Lower<'_> {
    /// Whether activations are kept.
    pub(crate) fn keeps(&self) -> bool {
        matches!(self.keep, Keep::Activations(_))
    }

    /// x Wᵀ for rows x `[rows, inputs]` and a weight `[outputs, inputs]`.
    pub(crate) fn linear(
        &mut self,
        [rows, inputs, outputs]: [usize; 3],
        (x, weight): (Matrix, Matrix),
        out: Matrix,
        onto: Onto,
        finish: Finish,
    ) {
        self.schedule.product(Product {
            size: [rows, outputs, inputs],
            a: x,
            b: weight.transpose(),
            c: out,
            onto,
            finish,
        });
    }
}

#[cfg(test)]
mod tests;
