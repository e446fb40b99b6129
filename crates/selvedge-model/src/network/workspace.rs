//! Room for all that a pass through the network writes: allocated on the first pass of a size, then
//! reused.
//!
//! Inference takes the latent vectors, the endpoint products of two blocks, and a few chunks of
//! rows for each thread. Training takes the activations of every layer as well.

use std::ops::Range;
use std::sync::{Mutex, PoisonError};

use selvedge_cloth::Stop;

use crate::graph::connectivity::Connectivity;
use crate::kernels::aligned::Aligned;
use crate::kernels::dropout::{ClothRows, Dropout, RowMasks};
use crate::kernels::real::Real;
use crate::network::arguments::Pass;
use crate::network::definition::Network;
use crate::network::layers::block::BlockSaved;
use crate::network::layers::encoder::KEPT;
use crate::network::layers::mlp::ACTIVATIONS;
use crate::network::layers::scratch::{GroupWork, Scratch};
use crate::network::parameters::ModuleGradient;
use crate::network::saved::Saved;
use crate::spec::OUTPUTS;

/// Groups of partitions, each with a sum of gradients of its own. More groups are more sums to add,
/// fewer keep fewer threads busy.
const GROUPS: usize = 8;

/// Room for all that a pass writes: allocated on the first pass of a size, then reused.
#[derive(Default)]
pub struct Workspace<T> {
    /// Latent vectors of the nodes, `[vertices, latent]`.
    pub(crate) nodes: Aligned<T>,
    /// Latent vectors of the arcs, `[arcs, latent]`.
    pub(crate) arcs: Aligned<T>,
    /// Endpoint products for the even blocks and for the odd ones, `[vertices, 2 latent]`.
    pub(crate) endpoint_products: [Aligned<T>; 2],
    pub(crate) node_encoder: Saved<T, KEPT>,
    pub(crate) arc_encoder: Saved<T, KEPT>,
    pub(crate) blocks: Vec<BlockSaved<T>>,
    pub(crate) decoder: Saved<T, ACTIVATIONS>,
    pub(crate) output: Aligned<T>,
    pub(crate) scratch: Vec<Mutex<Scratch<T>>>,
    pub(crate) groups: Vec<Group<T>>,
    /// Gradients of the sums of the first arc layer, `[arcs, latent]`.
    pub(crate) by_sums: Aligned<T>,
    /// Gradients of the input of the nodes and of the arcs, row by row.
    pub(crate) input_gradient: [Aligned<T>; 2],
    /// Masks of nodes and of arcs in the last pass.
    pub(crate) dropout: [RowMasks; 2],
    /// True while the activations of a training pass wait for its backward pass.
    pub(crate) kept: bool,
    /// Wanted where nobody needs the pass any more.
    pub(crate) stop: Stop,
}

/// The backward pass of a group of partitions.
#[derive(Default)]
pub(crate) struct Group<T> {
    pub(crate) scratch: Scratch<T>,
    /// Gradient of a module's weights.
    pub(crate) gradient: Aligned<T>,
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
    pub(crate) fn fit(&mut self, network: &Network, graph: &Connectivity, pass: Pass<'_>) {
        let (latent, frames) = (network.spec().latent, network.spec().window());
        let (vertices, arcs) = (graph.vertex_count(), graph.arc_count());
        self.kept = matches!(pass, Pass::Training(_));
        self.fit_dropout(graph, pass, [frames * latent; 2]);
        self.nodes.resize(vertices * latent);
        self.arcs.resize(arcs * latent);
        for products in &mut self.endpoint_products {
            products.resize(vertices * 2 * latent);
        }
        self.output.resize(vertices * OUTPUTS);
        let threads = rayon::current_num_threads().max(1);
        self.scratch.resize_with(threads, Mutex::default);
        for scratch in &mut self.scratch {
            let scratch = scratch.get_mut().unwrap_or_else(PoisonError::into_inner);
            fit_scratch(scratch, network);
        }
        self.fit_saved(network, graph, frames);
    }

    /// Prepares the masks of rows with that many values in all frames.
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

    /// Makes room for the activations of every layer, none where they are not kept.
    fn fit_saved(&mut self, network: &Network, graph: &Connectivity, frames: usize) {
        let rows = |count| if self.kept { count } else { 0 };
        let (vertices, arcs) = (rows(graph.vertex_count()), rows(graph.arc_count()));
        let [of_nodes, of_arcs] = &self.dropout;
        let widths = network.node_encoder.widths(frames, of_nodes.active());
        self.node_encoder.fit(vertices, widths);
        let widths = network.arc_encoder.widths(frames, of_arcs.active());
        self.arc_encoder.fit(arcs, widths);
        self.blocks
            .resize_with(network.blocks.len(), BlockSaved::default);
        for (saved, block) in self.blocks.iter_mut().zip(&network.blocks) {
            saved.fit(block, vertices, arcs);
        }
        self.decoder.fit(vertices, network.decoder.widths());
    }

    /// Makes room for a backward pass.
    pub(crate) fn fit_groups(&mut self, network: &Network, partitions: usize) {
        self.groups
            .resize_with(GROUPS.min(partitions), Group::default);
        for group in &mut self.groups {
            fit_scratch(&mut group.scratch, network);
        }
    }

    /// Does `work` with the scratch of this thread.
    pub(crate) fn with_scratch(all: &[Mutex<Scratch<T>>], work: impl FnOnce(&mut Scratch<T>)) {
        let thread = rayon::current_thread_index().unwrap_or(0) % all.len();
        work(&mut lock(&all[thread]));
    }
}

fn lock<S>(mutex: &Mutex<S>) -> std::sync::MutexGuard<'_, S> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl<T: Real> Group<T> {
    /// The scratch, and a gradient of zeros for the weights of a module.
    pub(crate) fn begin(&mut self, weights: &Range<usize>) -> GroupWork<'_, T> {
        self.gradient.resize(weights.len());
        self.gradient.fill(T::ZERO);
        self.resume(weights)
    }

    /// The scratch, and the gradient so far for the weights of a module.
    pub(crate) fn resume(&mut self, weights: &Range<usize>) -> GroupWork<'_, T> {
        GroupWork {
            scratch: &mut self.scratch,
            gradient: ModuleGradient::new(&mut self.gradient, weights.start),
        }
    }
}

fn fit_scratch<T: Real>(scratch: &mut Scratch<T>, network: &Network) {
    let spec = network.spec();
    let width = spec.node_width().max(spec.edge_width());
    let states = match spec.encoder.is_recurrent() {
        true => spec.latent,
        false => 0,
    };
    scratch.fit(spec.latent, width, states);
}
