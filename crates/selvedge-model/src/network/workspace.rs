//! Room for all that a pass through the network writes: allocated on the first pass of a size, then
//! reused.
//!
//! Inference takes the latent vectors, the endpoint products of two blocks, and a few chunks of
//! rows for each thread. Training takes the activations of every layer as well.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use rayon::prelude::*;
use selvedge_cloth::Stop;

use crate::graph::connectivity::Connectivity;
use crate::graph::partition::{CHUNK, PARTITION_VERTICES, Partition};
use crate::kernels::aligned::Aligned;
use crate::kernels::dropout::{Dropout, RowMasks};
use crate::kernels::real::Real;
use crate::network::definition::Network;
use crate::network::kept::{BlockKept, Group, Part, Scratch, fit_chunks};
use crate::network::passes::Pass;
use crate::spec::OUTPUTS;

/// Groups of partitions, each with a sum of gradients of its own. More groups are more sums to add,
/// fewer keep fewer threads busy.
const GROUPS: usize = 8;

/// Room for all that a pass writes: allocated on the first pass of a size, then reused.
#[derive(Default)]
pub struct Workspace<T> {
    pub(super) parts: Vec<Part<T>>,
    /// Endpoint products for the even blocks and for the odd ones, `[vertices, 2 latent]`.
    pub(super) endpoint_products: [Aligned<T>; 2],
    pub(super) output: Aligned<T>,
    pub(super) scratch: Vec<Mutex<Scratch<T>>>,
    pub(super) groups: Vec<Group<T>>,
    /// Gradients of the sums of the first arc layer, `[arcs, latent]`.
    pub(super) by_sums: Aligned<T>,
    /// Masks of nodes and of arcs in the last pass.
    pub(super) dropout: [RowMasks; 2],
    /// True while the activations of a training pass wait for its backward pass.
    pub(super) kept: bool,
    /// Wanted where nobody needs the pass any more.
    pub(super) stop: Stop,
}

impl<T: Real> Workspace<T> {
    /// An empty workspace.
    pub fn new() -> Self {
        Self::default()
    }

    /// Lets [`Network::forward_packed`] and [`Network::backward_packed`] end early, with an error,
    /// from when `stop` is wanted.
    pub fn stop_by(&mut self, stop: Stop) {
        self.stop = stop;
    }

    /// Makes room for a forward pass.
    pub(super) fn fit(&mut self, network: &Network, graph: &Connectivity, pass: Pass<'_>) {
        let (latent, vertices) = (network.spec().latent, graph.vertex_count());
        self.kept = matches!(pass, Pass::Training(_));
        self.fit_dropout(graph, pass, network.spec().window() * latent);
        for products in &mut self.endpoint_products {
            products.resize(vertices * 2 * latent);
        }
        self.output.resize(vertices * OUTPUTS);
        let threads = rayon::current_num_threads().max(1);
        self.scratch.resize_with(threads, Mutex::default);
        for scratch in &mut self.scratch {
            let scratch = scratch.get_mut().unwrap_or_else(PoisonError::into_inner);
            scratch.fit(network);
        }
        let dropout = self
            .dropout
            .each_ref()
            .map(|masks| masks.active().is_some());
        self.parts
            .resize_with(graph.partitions.len(), Part::default);
        for (part, rows) in self.parts.iter_mut().zip(&graph.partitions) {
            part.fit(network, rows, self.kept.then_some(dropout));
        }
    }

    /// Prepares the masks of rows with that many values in all frames.
    fn fit_dropout(&mut self, graph: &Connectivity, pass: Pass<'_>, values: usize) {
        let cloths = graph.cloths();
        let (rate, seeds) = match pass {
            Pass::Training(Some(dropout)) if dropout.rate > 0.0 => {
                assert_eq!(dropout.seeds.len(), cloths.len(), "seeds of cloths");
                (dropout.rate, dropout.seeds)
            }
            _ => (0.0, &[][..]),
        };
        for (kind, masks) in self.dropout.iter_mut().enumerate() {
            let rows = seeds.iter().zip(cloths).map(|(&seed, cloth)| {
                let count = [cloth.vertices, cloth.arcs][kind];
                (Dropout::row_seeds(seed)[kind], count)
            });
            masks.fit(rate, rows, values);
        }
    }

    /// Makes room for a backward pass.
    pub(super) fn fit_groups(&mut self, network: &Network) {
        self.groups
            .resize_with(GROUPS.min(self.parts.len()), Group::default);
        for group in &mut self.groups {
            group.scratch.fit(network);
        }
    }
}

/// Does `work` with the scratch of this thread.
pub(super) fn with_scratch<T>(all: &[Mutex<Scratch<T>>], work: impl FnOnce(&mut Scratch<T>)) {
    let thread = rayon::current_thread_index().unwrap_or(0) % all.len();
    work(&mut all[thread].lock().unwrap_or_else(PoisonError::into_inner));
}

impl<T: Real> Part<T> {
    /// Makes room for a partition; for its activations where they are kept, with dropout or without
    /// between the layers of each encoder.
    fn fit(&mut self, network: &Network, rows: &Partition, kept: Option<[bool; 2]>) {
        let (latent, frames) = (network.spec().latent, network.spec().window());
        self.rows = rows.clone();
        self.nodes.resize(rows.vertices.len() * latent);
        self.arcs.resize(rows.arcs.len() * latent);
        let Some(dropout) = kept else {
            self.encoders = Default::default();
            self.blocks.clear();
            self.decoder = None;
            return;
        };
        for (kind, chunks_kept) in self.encoders.iter_mut().enumerate() {
            let rows = [&rows.vertices, &rows.arcs][kind];
            let encoder = &network.encoders[kind];
            fit_chunks(chunks_kept, rows, |kept, rows| {
                kept.fit(encoder, rows, frames, dropout[kind]);
            });
        }
        self.blocks
            .resize_with(network.blocks.len(), BlockKept::default);
        for (kept, block) in self.blocks.iter_mut().zip(&network.blocks) {
            kept.fit(block, rows);
        }
        let decoder = self.decoder.get_or_insert_default();
        network.decoder.fit(decoder, rows.vertices.len());
    }
}

impl<T: Real> Scratch<T> {
    /// Makes room for the rows of a network.
    fn fit(&mut self, network: &Network) {
        let spec = network.spec();
        let (latent, rows) = (spec.latent, CHUNK.max(PARTITION_VERTICES));
        let states = usize::from(spec.encoder.is_recurrent()) * latent;
        let [tiles @ .., deviations] = &mut self.tiles;
        tiles.iter_mut().for_each(|tile| tile.resize(rows * latent));
        deviations.resize(rows);
        self.incoming.resize(PARTITION_VERTICES * latent);
        self.gates.resize(rows * 4 * states);
        self.gru.fit_spare(rows, states);
        for buffer in &mut self.biases {
            buffer.resize(4 * states);
        }
    }
}

/// Deals partitions, of each of which `rows` has an item, to the groups in order, and does `work`
/// on those of a group one after the other, on all threads. A module whose gradient begins here has
/// the weights `begins`.
pub(super) fn by_group<T: Real, R: Send>(
    groups: &mut [Group<T>],
    begins: Option<&Range<usize>>,
    rows: impl IntoIterator<Item = R, IntoIter: ExactSizeIterator>,
    work: impl Fn(&mut Group<T>, R) + Sync,
) {
    let mut rows = rows.into_iter();
    let (partitions, count) = (rows.len(), groups.len());
    let deal = |(number, group)| {
        let size = (number + 1) * partitions / count - number * partitions / count;
        (group, rows.by_ref().take(size).collect::<Vec<R>>())
    };
    let dealt: Vec<(&mut Group<T>, Vec<R>)> = groups.iter_mut().enumerate().map(deal).collect();
    let dealt = dealt.into_par_iter().with_max_len(1);
    dealt.for_each(|(group, rows)| {
        if let Some(weights) = begins {
            group.gradient.begin(weights);
        }
        rows.into_iter().for_each(|rows| work(group, rows));
    });
}

/// Adds the groups' gradients of a module in their order.
pub(super) fn add_groups<T: Real>(groups: &[Group<T>], gradient: &mut [T]) {
    const PART: usize = 8 * 1024;
    let parts = gradient.par_chunks_mut(PART).enumerate();
    parts.for_each(|(number, sum)| {
        for group in groups {
            let part = &group.gradient.values[number * PART..][..sum.len()];
            for (x, &y) in sum.iter_mut().zip(part) {
                *x += y;
            }
        }
    });
}
