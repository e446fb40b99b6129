//! Room for values that a pass writes and no later pass reads.

use crate::graph::partition::{CHUNK, PARTITION_VERTICES};
use crate::kernels::aligned::Aligned;
use crate::kernels::norm::NormRows;
use crate::kernels::real::Real;
use crate::network::layers::mlp::{MlpRows, MlpTile};
use crate::network::parameters::ModuleGradient;

/// Room for the values of a partition's forward pass that no later pass reads; one for each thread.
#[derive(Default)]
pub(crate) struct Scratch<T> {
    pub(crate) tiles: TileScratch<T>,
    /// `[PARTITION_VERTICES, latent]`.
    pub(crate) incoming: Aligned<T>,
    /// Frames of an encoder's input side by side, `[CHUNK, window width]`.
    pub(crate) joined: Aligned<T>,
    /// States of both layers of a recurrent encoder, before and after, `[CHUNK, latent]`.
    pub(crate) states: [[Aligned<T>; 2]; 2],
}

/// Activations of a chunk where they are not kept.
#[derive(Default)]
pub(crate) struct TileScratch<T> {
    hidden1: Aligned<T>,
    hidden2: Aligned<T>,
    normal: Aligned<T>,
    inverse_deviation: Aligned<T>,
}

impl<T: Real> Scratch<T> {
    pub(crate) fn fit(&mut self, latent: usize, joined: usize, states: usize) {
        let rows = CHUNK.max(PARTITION_VERTICES);
        let tiles = &mut self.tiles;
        for buffer in [&mut tiles.hidden1, &mut tiles.hidden2, &mut tiles.normal] {
            buffer.resize(rows * latent);
        }
        tiles.inverse_deviation.resize(rows);
        self.incoming.resize(PARTITION_VERTICES * latent);
        self.joined.resize(rows * joined);
        for buffer in self.states.iter_mut().flatten() {
            buffer.resize(rows * states);
        }
    }
}

impl<T: Real> TileScratch<T> {
    /// Room for `rows` normalised rows of `width` numbers.
    pub(crate) fn norm_rows(&mut self, rows: usize, width: usize) -> NormRows<'_, T> {
        NormRows {
            normal: &mut self.normal[..rows * width],
            inverse_deviation: &mut self.inverse_deviation[..rows],
        }
    }

    /// The rows that are kept, or `rows` rows of this where none are.
    pub(crate) fn tile<'a>(
        &'a mut self,
        kept: MlpRows<'a, T>,
        rows: usize,
        latent: usize,
    ) -> MlpTile<'a, T> {
        if kept.hidden1.is_empty() {
            return MlpTile {
                hidden1: &mut self.hidden1[..rows * latent],
                hidden2: &mut self.hidden2[..rows * latent],
                normal: &mut self.normal[..rows * latent],
                inverse_deviation: &mut self.inverse_deviation[..rows],
            };
        }
        kept.into_tile()
    }
}

/// The whole of `record`, or the first `length` numbers of `scratch` where nothing is kept.
pub(crate) fn pick<'a, T>(record: &'a mut [T], scratch: &'a mut [T], length: usize) -> &'a mut [T] {
    if record.is_empty() {
        &mut scratch[..length]
    } else {
        record
    }
}

/// Room for the values of a backward pass that no later pass reads; one for each group of
/// partitions.
#[derive(Default)]
pub(crate) struct GroupScratch<T> {
    /// Gradient of a chunk's output, `[CHUNK, latent]`.
    pub(crate) output: Aligned<T>,
    /// Gradient of the second layer's sums, `[CHUNK, latent]`.
    pub(crate) hidden: Aligned<T>,
    /// Gradient of the first layer's sums, `[CHUNK, latent]`.
    pub(crate) pre_activation: Aligned<T>,
    /// Gradients of the sums of messages, `[PARTITION_VERTICES, latent]`.
    pub(crate) incoming: Aligned<T>,
    /// Frames of an encoder's input side by side, `[CHUNK, window width]`.
    pub(crate) joined: Aligned<T>,
    /// Gradients of the sums of the gates, `[CHUNK, 4 latent]`.
    pub(crate) gates: Aligned<T>,
    /// Gradients of the states of both layers, `[CHUNK, latent]`.
    pub(crate) states: [Aligned<T>; 2],
    /// Sums of columns of `gates` of both layers, `[4 latent]`.
    pub(crate) biases: [Aligned<T>; 2],
}

impl<T: Real> GroupScratch<T> {
    pub(crate) fn fit(&mut self, latent: usize, joined: usize, states: usize) {
        let rows = CHUNK.max(PARTITION_VERTICES);
        let chunks = [&mut self.output, &mut self.hidden, &mut self.pre_activation];
        for buffer in chunks {
            buffer.resize(rows * latent);
        }
        self.incoming.resize(PARTITION_VERTICES * latent);
        self.joined.resize(rows * joined);
        self.gates.resize(rows * 4 * states);
        for buffer in &mut self.states {
            buffer.resize(rows * states);
        }
        for buffer in &mut self.biases {
            buffer.resize(4 * states);
        }
    }
}

/// The backward pass of a group of partitions through one module.
pub(crate) struct GroupWork<'a, T> {
    pub(crate) scratch: &'a mut GroupScratch<T>,
    /// Gradient of the module's weights, summed over the group.
    pub(crate) gradient: ModuleGradient<'a, T>,
}
