//! Everything that a pass through the network writes: made on the first pass of a size, then reused.
//!
//! To use a network takes the latent vectors, twice the products of their ends, and a few chunks of rows
//! for each thread; to learn takes the activations of every layer.

use std::sync::{Mutex, PoisonError};

use crate::graph::connectivity::Connectivity;
use crate::kernels::aligned::Aligned;
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::kernels::{ClothRows, Dropout, RowMasks};
use crate::network::layers::block::BlockRecord;
use crate::network::layers::encoder::EncoderRecord;
use crate::network::layers::mlp::MlpRecord;
use crate::network::layers::{GroupScratch, Scratch};
use crate::network::packed::PackedWeights;
use crate::network::{Network, OUTPUTS, Pass};

/// Groups of leaves whose gradients are summed by themselves, in any graph that has as many leaves.
/// More of them are more sums to add, fewer keep fewer threads busy.
const GROUPS: usize = 8;

/// The states of the recurrent encoders of vertices and arcs, both layers: what a streaming network
/// carries from frame to frame. Empty is zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EncoderState<T> {
    /// `[vertices, latent]` each.
    pub(crate) nodes: [Aligned<T>; 2],
    /// `[arcs, latent]` each.
    pub(crate) edges: [Aligned<T>; 2],
}

impl<T: Real> EncoderState<T> {
    /// The zero state.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The same number everywhere, for a graph of so many vertices and arcs.
    #[must_use]
    pub fn filled(value: T, counts: [usize; 2], latent: usize) -> Self {
        let mut state = Self::new();
        state.fit(counts, latent);
        for array in state.nodes.iter_mut().chain(&mut state.edges) {
            array.fill(value);
        }
        state
    }

    /// Both layers of vertices, then both of arcs; empty for zero.
    #[must_use]
    pub fn arrays(&self) -> [&[T]; 4] {
        let ([a, b], [c, d]) = (&self.nodes, &self.edges);
        [a, b, c, d]
    }

    /// Whether nothing is carried.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.nodes[0].is_empty()
    }

    /// Goes back to zero.
    pub fn clear(&mut self) {
        for array in self.nodes.iter_mut().chain(&mut self.edges) {
            array.clear();
        }
    }

    pub(crate) fn fit(&mut self, [vertices, arcs]: [usize; 2], latent: usize) {
        for (arrays, rows) in [(&mut self.nodes, vertices), (&mut self.edges, arcs)] {
            for array in arrays {
                array.resize(rows * latent);
            }
        }
    }
}

/// Everything that a pass writes: allocated on the first pass of a size, then reused.
#[derive(Default)]
pub struct Workspace<T> {
    pub(crate) instructions: Instructions,
    /// Those of the last [`Network::forward`] on plain weights.
    pub(crate) packed: Option<PackedWeights<T>>,
    pub(crate) nodes: Aligned<T>,
    pub(crate) edges: Aligned<T>,
    /// Products of the vertices that the next block's arcs gather, and those of this one's.
    pub(crate) at: [Aligned<T>; 2],
    pub(crate) node_encoder: EncoderRecord<T>,
    pub(crate) edge_encoder: EncoderRecord<T>,
    pub(crate) blocks: Vec<BlockRecord<T>>,
    pub(crate) decoder: MlpRecord<T>,
    pub(crate) output: Aligned<T>,
    pub(crate) scratch: Vec<Mutex<Scratch<T>>>,
    pub(crate) groups: Vec<Group<T>>,
    /// Gradients of the first edge layer's sums, `[arcs, latent]`.
    pub(crate) first: Aligned<T>,
    /// Gradients of the input, row by row.
    pub(crate) to_input: [Aligned<T>; 2],
    /// Masks of vertices and of arcs in the last pass.
    pub(crate) dropout: [RowMasks; 2],
    /// The encoders' states after the last pass, where the network streams.
    pub(crate) end: EncoderState<T>,
    /// Whether the activations are those of a training pass that no backward pass has used up.
    pub(crate) kept: bool,
}

/// The backward pass of a group of leaves.
#[derive(Default)]
pub(crate) struct Group<T> {
    pub(crate) scratch: GroupScratch<T>,
    /// Gradient of a module's weights.
    pub(crate) gradient: Aligned<T>,
}

impl<T: Real> Workspace<T> {
    /// An empty workspace.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// An empty workspace for passes on plain weights with these instructions.
    #[must_use]
    pub fn with_instructions(instructions: Instructions) -> Self {
        Self {
            instructions,
            ..Self::default()
        }
    }

    /// Numbers held for vertices and arcs.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let encoders = [&self.node_encoder, &self.edge_encoder];
        let blocks = self.blocks.iter().map(BlockRecord::number_count);
        let [even, odd] = &self.at;
        let flat = [
            &self.nodes,
            &self.edges,
            &self.first,
            &self.output,
            even,
            odd,
        ];
        let states = self.end.nodes.iter().chain(&self.end.edges);
        encoders.iter().map(|e| e.number_count()).sum::<usize>()
            + blocks.sum::<usize>()
            + self.decoder.number_count()
            + flat
                .into_iter()
                .chain(states)
                .map(|array| array.len())
                .sum::<usize>()
    }

    /// The states that a streaming network's encoders ended the last pass with.
    #[must_use]
    pub fn end_state(&self) -> &EncoderState<T> {
        &self.end
    }

    /// Takes the end state and leaves another one's room.
    pub(crate) fn swap_end_state(&mut self, other: &mut EncoderState<T>) {
        std::mem::swap(&mut self.end, other);
    }

    /// Makes room for a forward pass whose input has `windows` frames of vertices and arcs.
    pub(crate) fn fit(
        &mut self,
        network: &Network,
        graph: &Connectivity,
        pass: Pass<'_>,
        windows: [usize; 2],
    ) {
        let spec = network.spec();
        let (vertices, arcs, latent) = (graph.vertex_count(), graph.arc_count(), spec.latent);
        self.kept = matches!(pass, Pass::Training(_));
        self.fit_dropout(graph, pass, windows.map(|frames| frames * latent));
        self.nodes.resize(vertices * latent);
        self.edges.resize(arcs * latent);
        self.at[0].resize(vertices * 2 * latent);
        self.at[1].resize(vertices * 2 * latent);
        self.output.resize(vertices * OUTPUTS);
        if network.streams() {
            self.end.fit([vertices, arcs], latent);
        }
        let (joined, states) = network.scratch_widths();
        self.scratch
            .resize_with(rayon::current_num_threads().max(1), Mutex::default);
        for scratch in &mut self.scratch {
            let scratch = scratch.get_mut().unwrap_or_else(PoisonError::into_inner);
            scratch.fit(latent, joined, states);
        }
        if self.kept {
            network.fit_records(self, [vertices, arcs], windows);
        }
    }

    /// Prepares the masks of rows with so many values in all frames.
    fn fit_dropout(&mut self, graph: &Connectivity, pass: Pass<'_>, values: [usize; 2]) {
        let none = Dropout {
            rate: 0.0,
            seeds: &[],
        };
        let Dropout { rate, seeds } = match pass {
            Pass::Training(Some(dropout)) if dropout.rate > 0.0 => dropout,
            _ => none,
        };
        let cloths = graph.cloths();
        let seeded = if rate > 0.0 { cloths.len() } else { 0 };
        assert_eq!(seeds.len(), seeded, "seeds of cloths");
        for (kind, masks) in self.dropout.iter_mut().enumerate() {
            let rows = seeds.iter().zip(cloths).map(|(&seed, cloth)| ClothRows {
                seed: Dropout::row_seeds(seed)[kind],
                rows: [cloth.vertices, cloth.arcs][kind],
            });
            masks.fit(rate, rows, values[kind]);
        }
    }

    /// Makes room for a backward pass.
    pub(crate) fn fit_groups(&mut self, network: &Network, leaves: usize) {
        let (joined, states) = network.scratch_widths();
        self.groups.resize_with(GROUPS.min(leaves), Group::default);
        for group in &mut self.groups {
            group.scratch.fit(network.spec().latent, joined, states);
        }
    }

    /// Does something with the scratch of this thread.
    pub(crate) fn with_scratch(all: &[Mutex<Scratch<T>>], work: impl FnOnce(&mut Scratch<T>)) {
        let thread = rayon::current_thread_index().unwrap_or(0) % all.len();
        work(&mut lock(&all[thread]));
    }
}

fn lock<S>(mutex: &Mutex<S>) -> std::sync::MutexGuard<'_, S> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}
