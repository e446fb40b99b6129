//! Room for values that a pass writes and no later pass reads.

use crate::graph::partition::{CHUNK, PARTITION_VERTICES};
use crate::kernels::aligned::Aligned;
use crate::kernels::real::Real;
use crate::network::layers::mlp::ACTIVATIONS;
use crate::network::parameters::ModuleGradient;

/// Room for a chunk of rows or a partition of vertices; one for each thread of a forward pass and
/// for each group of partitions of a backward pass.
#[derive(Default)]
pub(crate) struct Scratch<T> {
    /// Activations of a perceptron where they are not kept; in a backward pass the gradients of its
    /// output and of the sums of its second and of its first layer. `[CHUNK, latent]`, the last one
    /// `[CHUNK]`.
    pub(crate) tiles: [Aligned<T>; ACTIVATIONS],
    /// Sums of the messages that arrive, or their gradients, `[PARTITION_VERTICES, latent]`.
    pub(crate) incoming: Aligned<T>,
    /// Gradients of a frame of an encoder's input, `[CHUNK, width]`.
    pub(crate) input: Aligned<T>,
    /// Of both layers of a recurrent encoder the states before and after a step where they are not
    /// kept, or the gradients of a state, `[2 CHUNK, latent]`.
    pub(crate) states: [Aligned<T>; 2],
    /// Gradients of the sums of the gates, `[CHUNK, 4 latent]`.
    pub(crate) gates: Aligned<T>,
    /// Sums of columns of `gates` of both layers, `[4 latent]`.
    pub(crate) biases: [Aligned<T>; 2],
}

impl<T: Real> Scratch<T> {
    /// Makes room for rows of `latent` numbers; those of inputs have `width`, those of recurrent
    /// encoders `states` (0 where there are none).
    pub(crate) fn fit(&mut self, latent: usize, width: usize, states: usize) {
        let rows = CHUNK.max(PARTITION_VERTICES);
        let [tiles @ .., deviations] = &mut self.tiles;
        tiles.iter_mut().for_each(|tile| tile.resize(rows * latent));
        deviations.resize(rows);
        self.incoming.resize(PARTITION_VERTICES * latent);
        self.input.resize(rows * width);
        self.gates.resize(rows * 4 * states);
        for buffer in &mut self.states {
            buffer.resize(2 * rows * states);
        }
        for buffer in &mut self.biases {
            buffer.resize(4 * states);
        }
    }
}

/// The backward pass of a group of partitions through one module.
pub(crate) struct GroupWork<'a, T> {
    pub(crate) scratch: &'a mut Scratch<T>,
    /// Gradient of the module's weights, summed over the group.
    pub(crate) gradient: ModuleGradient<'a, T>,
}
