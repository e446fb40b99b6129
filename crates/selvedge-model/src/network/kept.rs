//! What passes write of a part of a graph: the rows that a training pass keeps for its way back, the
//! room of rows that nothing keeps, and the gradients of a module's weights.

use std::ops::Range;

use crate::graph::partition::{CHUNK, Partition, chunks};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::Columns;
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::rows::add_column_sums;
use crate::kernels::simd::Instructions;
use crate::network::parameters::Linear;

/// What a pass keeps of a partition.
#[derive(Default)]
pub(crate) struct Part<T> {
    pub(crate) rows: Partition,
    /// Latent vectors of the nodes, or their gradients, `[vertices, latent]`.
    pub(crate) nodes: Aligned<T>,
    /// Latent vectors of the arcs, or their gradients, `[arcs, latent]`.
    pub(crate) arcs: Aligned<T>,
    /// Activations of both encoders, chunk by chunk. These and the following are kept in training.
    pub(crate) encoders: [Vec<EncoderKept<T>>; 2],
    pub(crate) blocks: Vec<BlockKept<T>>,
    pub(crate) decoder: Option<Activations<T>>,
}

/// Activations of rows: after the first and the second ReLU, both `[rows, latent]`; the normalised
/// output `[rows, outputs]` and 1 / its deviation `[rows]`, both empty without LayerNorm.
pub(crate) type Activations<T> = [Aligned<T>; 4];

/// What is kept of a chunk of rows, and the room for what is not.
#[derive(Default)]
pub(crate) struct GruKept<T> {
    /// States of each layer, the initial one first, `[steps + 1, rows, hidden]`.
    pub(crate) states: [Aligned<T>; 2],
    /// Gates of each layer, `[steps, rows, 4 hidden]`.
    pub(crate) gates: [Aligned<T>; 2],
    /// The input of the second layer where dropout makes it differ from the first layer's states,
    /// `[steps, rows, hidden]`.
    pub(crate) between: Aligned<T>,
    /// The normalised output `[rows, hidden]`, and 1 / its deviation `[rows]`.
    pub(crate) norm: [Aligned<T>; 2],
}

/// What is kept of a chunk of rows for the backward pass: arrays of a perceptron, or of a recurrent
/// network.
#[derive(Default)]
pub(crate) struct EncoderKept<T> {
    pub(crate) mlp: Activations<T>,
    pub(crate) gru: GruKept<T>,
}

/// What is kept of a partition in one block for the backward pass.
#[derive(Default)]
pub(crate) struct BlockKept<T> {
    /// Latent nodes before the block, and the sums of the messages that arrive,
    /// `[vertices, latent]`.
    pub(crate) nodes: Aligned<T>,
    pub(crate) incoming: Aligned<T>,
    pub(crate) node: Activations<T>,
    /// Latent arcs before the block and activations of the arc update, chunk by chunk.
    pub(crate) arcs: Vec<(Aligned<T>, Activations<T>)>,
}

/// Room for a chunk of rows or a partition of vertices, for values that no later pass reads; one
/// for each thread of a forward pass and for each group of partitions of a backward pass.
#[derive(Default)]
pub(crate) struct Scratch<T> {
    /// Activations of a perceptron where they are not kept; in a backward pass the gradients of its
    /// output and of the sums of its second and of its first layer. `[CHUNK, latent]`, the last one
    /// `[CHUNK]`.
    pub(crate) tiles: Activations<T>,
    /// Sums of the messages that arrive, or their gradients, `[PARTITION_VERTICES, latent]`.
    pub(crate) incoming: Aligned<T>,
    /// Rows of a recurrent encoder where they are not kept; in a backward pass its states are the
    /// gradients of states.
    pub(crate) gru: GruKept<T>,
    /// Gradients of the sums of the gates, `[CHUNK, 4 latent]`.
    pub(crate) gates: Aligned<T>,
    /// Sums of columns of `gates` of both layers, `[4 latent]`.
    pub(crate) biases: [Aligned<T>; 2],
}

/// The backward pass of a group of partitions through one module.
#[derive(Default)]
pub(crate) struct Group<T> {
    pub(crate) scratch: Scratch<T>,
    pub(crate) gradient: ModuleGradient<T>,
}

/// The gradient of a module's weights, which are contiguous.
#[derive(Default)]
pub(crate) struct ModuleGradient<T> {
    pub(crate) values: Aligned<T>,
    /// Number of the first weight of the module.
    pub(crate) first: usize,
}

/// Makes room for what is kept of each chunk of `rows`.
pub(crate) fn fit_chunks<K: Default>(
    kept: &mut Vec<K>,
    rows: &Range<usize>,
    fit: impl Fn(&mut K, usize),
) {
    kept.resize_with(rows.len().div_ceil(CHUNK), K::default);
    for (kept, chunk) in kept.iter_mut().zip(chunks(rows.clone())) {
        fit(kept, chunk.len());
    }
}

impl<T: Real> ModuleGradient<T> {
    /// Begins with zeros for a module with these weights.
    pub(crate) fn begin(&mut self, weights: &Range<usize>) {
        self.first = weights.start;
        self.values.resize(weights.len());
        self.values.fill(T::ZERO);
    }

    /// The gradient of the weights of this place.
    pub(crate) fn at(&mut self, weights: &Range<usize>) -> &mut [T] {
        &mut self.values[weights.start - self.first..weights.end - self.first]
    }

    /// Adds the gradients of weight and bias for an output gradient and the layer's input.
    pub(crate) fn add_linear(
        &mut self,
        using: Instructions,
        linear: &Linear,
        output: &[T],
        input: &[T],
    ) {
        add_column_sums(using, self.at(&linear.bias), output);
        let by_output = Columns::all(output, linear.outputs);
        let input = Columns::all(input, linear.inputs);
        self.add_matrix(using, linear, 0, by_output, input);
    }

    /// Adds the gradient of the columns of a layer's matrix from `first` on, for the inputs of
    /// these columns.
    pub(crate) fn add_matrix(
        &mut self,
        using: Instructions,
        linear: &Linear,
        first: usize,
        by_output: Columns<'_, T>,
        input: Columns<'_, T>,
    ) {
        let sums = Sums {
            rows: self.at(&linear.weight),
            stride: linear.inputs,
            first,
        };
        add_outer(using, sums, by_output, input);
    }
}
