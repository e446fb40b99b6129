//! The encoder of nodes or of arcs: normalised features to latent rows, by a perceptron on the
//! current frame, or by a recurrent network on a window of frames.

use std::ops::Range;
use std::slice::from_ref;

use crate::graph::partition::{CHUNK, chunks};
use crate::kernels::dropout::RowMasks;
use crate::kernels::gemm::Epilogue;
use crate::kernels::real::Real;
use crate::network::kept::{EncoderKept, Group, Scratch};
use crate::network::layers::gru::GruEncoder;
use crate::network::layers::mlp::Mlp;
use crate::network::packed::{LayerWeights, Packer};
use crate::network::parameters::Layout;
use crate::spec::Encoder;

/// Places of the weights of an encoder.
#[derive(Clone, Debug)]
pub(crate) enum EncoderLayers {
    Mlp(Mlp),
    Gru(GruEncoder),
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
            EncoderLayers::Mlp(mlp) => mlp.fit(&mut self.mlp, rows),
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
                let all = 0..width;
                Self::Mlp(Mlp::normalised(layout, path, from_ref(&all), latent))
            }
            Encoder::Gru { .. } => Self::Gru(GruEncoder::new(layout, path, width, latent)),
        }
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        match self {
            Self::Mlp(mlp) => mlp.pack(packer),
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
                Self::Mlp(mlp) => {
                    let kept = (kept.map(|kept| &mut kept.mlp), &mut scratch.tiles);
                    mlp.forward_whole(weights, input.at(0, &chunk), kept, out);
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
                Self::Mlp(mlp) => {
                    let Group { scratch, gradient } = &mut *group;
                    let [_, hidden, sums, _] = &mut scratch.tiles;
                    let (hidden, sums) = (&mut hidden[..output.len()], &mut sums[..output.len()]);
                    let kept = ([input.at(0, &chunk)], &kept.mlp);
                    mlp.backward(weights, kept, [output, hidden, &mut *sums], gradient);
                    if let Some(to_input) = to_input.next() {
                        mlp.input_backward(weights, 0, sums, Epilogue::Set, to_input);
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
