//! The layers of the network, each with its backward pass beside its forward pass.
//!
//! All work on chunks of at most [`CHUNK`] rows, so that what a layer reads and writes stays in cache.

pub(crate) mod block;
pub(crate) mod encoder;
pub(crate) mod gru;
pub(crate) mod mlp;
#[cfg(test)]
mod pytorch;

use std::ops::Range;

use crate::graph::partition::{CHUNK, LEAF_VERTICES, of_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::real::Real;
use crate::network::layers::mlp::MlpTile;

/// What a thread writes on its way through a leaf and nobody reads later.
#[derive(Default)]
pub(crate) struct Scratch<T> {
    pub(crate) tiles: TileScratch<T>,
    /// `[LEAF_VERTICES, latent]`.
    pub(crate) incoming: Aligned<T>,
    /// Inputs of an encoder side by side, `[CHUNK, window width]`.
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
        let rows = CHUNK.max(LEAF_VERTICES);
        let tiles = &mut self.tiles;
        for buffer in [&mut tiles.hidden1, &mut tiles.hidden2, &mut tiles.normal] {
            buffer.resize(rows * latent);
        }
        tiles.inverse_deviation.resize(rows);
        self.incoming.resize(LEAF_VERTICES * latent);
        self.joined.resize(rows * joined);
        for buffer in self.states.iter_mut().flatten() {
            buffer.resize(rows * states);
        }
    }
}

impl<T: Real> TileScratch<T> {
    /// Room for the normalised output of `rows` rows, `size` numbers, and for their deviations.
    pub(crate) fn norm_rows(&mut self, size: usize, rows: usize) -> (&mut [T], &mut [T]) {
        (
            &mut self.normal[..size],
            &mut self.inverse_deviation[..rows],
        )
    }

    /// The rows of a record, or of this where nothing is kept.
    pub(crate) fn tile<'a>(
        &'a mut self,
        record: [&'a mut [T]; 4],
        rows: &Range<usize>,
        latent: usize,
    ) -> MlpTile<'a, T> {
        let [hidden1, hidden2, normal, inverse_deviation] = record;
        if hidden1.is_empty() {
            let count = rows.len();
            return MlpTile {
                hidden1: &mut self.hidden1[..count * latent],
                hidden2: &mut self.hidden2[..count * latent],
                normal: &mut self.normal[..count * latent],
                inverse_deviation: &mut self.inverse_deviation[..count],
            };
        }
        // The decoder normalises nothing.
        let (of, count) = (of_rows(rows, latent), inverse_deviation.len());
        let normal_rows = if count == 0 { 0..0 } else { of.clone() };
        MlpTile {
            hidden1: &mut hidden1[of.clone()],
            hidden2: &mut hidden2[of],
            normal: &mut normal[normal_rows],
            inverse_deviation: &mut inverse_deviation[rows.start.min(count)..rows.end.min(count)],
        }
    }
}

/// The whole of `record`, or the first `length` of `scratch` where nothing is kept.
pub(crate) fn pick<'a, T>(record: &'a mut [T], scratch: &'a mut [T], length: usize) -> &'a mut [T] {
    if record.is_empty() {
        &mut scratch[..length]
    } else {
        record
    }
}

/// What a group of leaves writes on its way back and nobody reads later.
#[derive(Default)]
pub(crate) struct GroupScratch<T> {
    /// Gradients of a chunk's output, of the second and of the first layer's sums, `[CHUNK, latent]`.
    pub(crate) output: Aligned<T>,
    pub(crate) hidden: Aligned<T>,
    pub(crate) first: Aligned<T>,
    /// Gradients of the sums of messages, `[LEAF_VERTICES, latent]`.
    pub(crate) incoming: Aligned<T>,
    /// Inputs of an encoder side by side, `[CHUNK, window width]`.
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
        let rows = CHUNK.max(LEAF_VERTICES);
        for buffer in [&mut self.output, &mut self.hidden, &mut self.first] {
            buffer.resize(rows * latent);
        }
        self.incoming.resize(LEAF_VERTICES * latent);
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
