//! The encoder of nodes or of arcs: normalised features to latent rows, by a perceptron on the
//! current frame, or by a recurrent network on a window of frames.

use std::ops::Range;

use crate::graph::partition::{CHUNK, chunks};
use crate::kernels::dropout::RowMasks;
use crate::kernels::gemm::{Columns, Epilogue, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::network::layers::gru::{GruEncoder, GruKept};
use crate::network::layers::mlp::{Activations, Mlp};
use crate::network::packed::{LayerWeights, Packer, Piece};
use crate::network::parameters::Layout;
use crate::network::workspace::{Group, Scratch};
use crate::spec::Encoder;

/// Places of the weights of an encoder.
#[derive(Clone, Debug)]
pub(crate) enum EncoderLayers {
    /// A perceptron, with its first layer's matrix.
    Mlp(Mlp, Piece),
    Gru(GruEncoder),
}

/// What is kept of a chunk of rows for the backward pass: arrays of a perceptron, or of a recurrent
/// network.
#[derive(Default)]
pub(crate) struct EncoderKept<T> {
    mlp: Activations<T>,
    gru: GruKept<T>,
}

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

impl<'a, T> EncoderInput<'a, T> {
    /// The rows of a chunk in frame `step`.
    pub(crate) fn at(&self, step: usize, chunk: &Range<usize>) -> &'a [T] {
        let all = self.features.len() / self.window;
        &self.features[step * all..][chunk.start * self.width..chunk.end * self.width]
    }
}

impl<T: Real> EncoderKept<T> {
    /// Makes room for `rows` rows through so many frames.
    pub(crate) fn fit(
        &mut self,
        encoder: &EncoderLayers,
        rows: usize,
        frames: usize,
        dropout: bool,
    ) {
        match encoder {
            EncoderLayers::Mlp(mlp, _) => mlp.fit(&mut self.mlp, rows),
            EncoderLayers::Gru(gru) => gru.fit(&mut self.gru, rows, frames, dropout),
        }
    }
}

impl EncoderLayers {
    pub(crate) fn new(
        layout: &mut Layout,
        path: &str,
        encoder: Encoder,
        width: usize,
        latent: usize,
    ) -> Self {
        match encoder {
            Encoder::Mlp { .. } => {
                let mlp = Mlp::normalised(layout, path, width, latent);
                let first = Piece::whole(&mut layout.size, &mlp.first);
                Self::Mlp(mlp, first)
            }
            Encoder::Gru { .. } => Self::Gru(GruEncoder::new(layout, path, width, latent)),
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

    /// Takes the rows `range` of the input to their latent rows `out`.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        range: &Range<usize>,
        (out, kept): (&mut [T], &mut [EncoderKept<T>]),
        scratch: &mut Scratch<T>,
    ) {
        let latent = out.len() / range.len().max(1);
        let out = out.chunks_mut((CHUNK * latent).max(1));
        let mut kept = kept.iter_mut();
        for (chunk, out) in chunks(range.clone()).zip(out) {
            let kept = kept.next();
            match self {
                Self::Mlp(mlp, first) => {
                    let kept = kept.map(|kept| &mut kept.mlp);
                    let mut tile = mlp.tile(kept, &mut scratch.tiles, chunk.len());
                    let terms = &[first.times(weights, input.at(0, &chunk))];
                    mlp.first_layer(weights, terms, &mut tile);
                    mlp.forward(weights, tile, Normalised::Set(out));
                }
                Self::Gru(gru) => {
                    let kept = kept.map(|kept| &mut kept.gru);
                    gru.forward(weights, input, &chunk, (out, kept), scratch);
                }
            }
        }
    }

    /// Adds the gradients of all weights for the gradient `output` of the latent rows `range`,
    /// which is overwritten. Sets those of the input, frame by frame, `[rows, width]` each, where
    /// they are wanted.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, kept): (EncoderInput<'_, T>, &[EncoderKept<T>]),
        range: &Range<usize>,
        (output, mut to_input): (&mut [T], Vec<&mut [T]>),
        group: &mut Group<T>,
    ) {
        let (latent, width) = (output.len() / range.len().max(1), input.width);
        let output = output.chunks_mut((CHUNK * latent).max(1));
        for ((chunk, output), kept) in chunks(range.clone()).zip(output).zip(kept) {
            let rows = (chunk.start - range.start) * width..(chunk.end - range.start) * width;
            let mut to_input = to_input.iter_mut().map(|frame| &mut frame[rows.clone()]);
            match self {
                Self::Mlp(mlp, piece) => {
                    let Group { scratch, gradient } = &mut *group;
                    let [_, hidden, sums, _] = &mut scratch.tiles;
                    let (hidden, sums) = (&mut hidden[..output.len()], &mut sums[..output.len()]);
                    mlp.backward(weights, &kept.mlp, [output, hidden, &mut *sums], gradient);
                    let features = Columns::all(input.at(0, &chunk), width);
                    let by_sums = Columns::all(&*sums, latent);
                    mlp.first_backward(weights, 0, by_sums, features, gradient);
                    if let Some(to_input) = to_input.next() {
                        let terms = &[piece.back(weights, sums)];
                        let using = weights.instructions;
                        multiply(using, terms, width, Epilogue::Set, to_input);
                    }
                }
                Self::Gru(gru) => {
                    let (kept, to_input) = ((input, &kept.gru), to_input.collect());
                    gru.backward(weights, kept, &chunk, (output, to_input), group);
                }
            }
        }
    }
}
