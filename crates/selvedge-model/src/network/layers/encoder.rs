//! The encoder of nodes or of arcs: normalised features to latent rows, by a perceptron on the
//! current frame, or by a recurrent network on a window of frames.

use std::ops::Range;

use crate::graph::partition::{chunks, counted_from, of_rows};
use crate::graph::share::{Rows, SplitRows};
use crate::kernels::dropout::RowMasks;
use crate::kernels::gemm::{Columns, Epilogue, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::network::layers::gru::GruEncoder;
use crate::network::layers::mlp::{Mlp, tile};
use crate::network::layers::scratch::{GroupWork, Scratch};
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::network::saved::Saved;
use crate::spec::Encoder;

/// Places of the weights of an encoder.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EncoderLayers {
    /// A perceptron, with its first layer's matrix.
    Mlp(Mlp, Piece),
    Gru(GruEncoder),
}

/// Arrays that an encoder keeps for its backward pass: those of a perceptron, or those of
/// [`GruEncoder::widths`].
pub(crate) const KEPT: usize = 7;

/// Rows that an encoder writes: its output `[rows, latent]`; what it keeps.
pub(crate) type EncoderRows<'a, T> = (Rows<'a, T>, [Rows<'a, T>; KEPT]);

/// Gradients at both ends of an encoder. In: of the output, `[rows, latent]`, overwritten. Out: of
/// the input, `[rows, window width]`, empty where not wanted.
pub(crate) type EncoderGradients<'a, T> = (Rows<'a, T>, Rows<'a, T>);

#[derive(Clone, Copy)]
pub(crate) struct EncoderInput<'a, T> {
    /// Frames of the window.
    pub(crate) window: usize,
    /// Features of all rows, `[window, all rows, width]`.
    pub(crate) features: &'a [T],
    /// Columns of the features.
    pub(crate) width: usize,
    pub(crate) dropout: Option<&'a RowMasks>,
}

/// The input of a forward pass of an encoder that is taken back, and what is kept of it.
pub(crate) type EncoderKept<'a, T> = (EncoderInput<'a, T>, &'a Saved<T, KEPT>);

impl<'a, T> EncoderInput<'a, T> {
    /// The rows of a chunk in frame `step`.
    pub(crate) fn at(&self, step: usize, chunk: &Range<usize>) -> &'a [T] {
        let all = self.features.len() / self.window;
        &self.features[step * all..][of_rows(chunk, self.width)]
    }
}

impl EncoderLayers {
    pub(crate) fn new(
        module: &mut ModuleBuilder,
        path: &str,
        encoder: Encoder,
        width: usize,
        latent: usize,
    ) -> Self {
        match encoder {
            Encoder::Mlp { .. } => {
                let mlp = Mlp::normalised(module, path, width, latent);
                Self::Mlp(mlp, Piece::whole(&mut module.size, &mlp.first))
            }
            Encoder::Gru { .. } => Self::Gru(GruEncoder::new(module, path, width, latent)),
        }
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        match self {
            Self::Mlp(mlp, first) => {
                mlp.pack(packer);
                first.pack(packer);
            }
            Self::Gru(gru) => gru.pack(packer),
        }
    }

    /// Numbers in a row of each array that is kept of `steps` frames.
    pub(crate) fn widths(&self, steps: usize, dropout: Option<&RowMasks>) -> [usize; KEPT] {
        match self {
            Self::Mlp(mlp, _) => {
                let [a, b, c, d] = mlp.widths();
                [a, b, c, d, 0, 0, 0]
            }
            Self::Gru(gru) => gru.widths(steps, dropout.is_some()),
        }
    }

    /// Takes the rows `range` of the input to their latent rows.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        range: &Range<usize>,
        rows: &mut EncoderRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        for chunk in chunks(range.clone()) {
            let rows = rows.part(&counted_from(&chunk, range.start));
            match self {
                Self::Mlp(mlp, first) => {
                    let (out, [a, b, c, d, ..]) = rows;
                    let mut tile = tile([a, b, c, d], &mut scratch.tiles, chunk.len());
                    let terms = &[first.times(weights, input.at(0, &chunk))];
                    mlp.first_layer(weights, terms, mlp.first_epilogue(weights), &mut tile);
                    mlp.forward(weights, tile, Normalised::Set(out.values));
                }
                Self::Gru(gru) => gru.forward(weights, input, &chunk, rows, scratch),
            }
        }
    }

    /// Adds the gradients of all weights for the gradient of the latent rows `range`.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: EncoderKept<'_, T>,
        range: &Range<usize>,
        mut gradients: EncoderGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let (input, saved) = kept;
        for chunk in chunks(range.clone()) {
            let gradients = gradients.part(&counted_from(&chunk, range.start));
            match self {
                Self::Mlp(mlp, piece) => {
                    let (output, to_input) = gradients;
                    let (latent, width) = (output.width(), input.width);
                    let gradient = &mut group.gradient;
                    let size = output.len();
                    let [_, hidden, sums, _] = &mut group.scratch.tiles;
                    let (hidden, sums) = (&mut hidden[..size], &mut sums[..size]);
                    let [a, b, c, d, ..] = saved.at(&chunk);
                    let through = [output.values, hidden, &mut *sums];
                    mlp.backward(weights, [a, b, c, d], through, gradient);
                    let features = Columns::all(input.at(0, &chunk), width);
                    let by_sums = Columns::all(&*sums, latent);
                    mlp.first_backward(weights, 0, by_sums, features, gradient);
                    if !to_input.is_empty() {
                        let terms = &[piece.back(weights, sums)];
                        let (using, to_input) = (weights.instructions, to_input.values);
                        multiply(using, terms, width, Epilogue::Set, to_input);
                    }
                }
                Self::Gru(gru) => gru.backward(weights, kept, &chunk, gradients, group),
            }
        }
    }
}
