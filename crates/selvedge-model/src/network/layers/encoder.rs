//! The encoder of nodes or of arcs: normalised features to latent rows, by a perceptron on the
//! current frame, or by a recurrent network on a window of frames.

use std::ops::Range;

use crate::graph::partition::{chunks, counted_from, of_rows};
use crate::graph::share::{Rows, SplitRows, split_rows};
use crate::kernels::dropout::RowMasks;
use crate::kernels::gemm::{Columns, Epilogue, multiply};
use crate::kernels::norm::Normalised;
use crate::kernels::real::Real;
use crate::network::layers::gru::{
    GruEncoder, GruGradients, GruInput, GruRecord, GruRecordRows, GruRows, States,
};
use crate::network::layers::mlp::{Mlp, MlpGradients, MlpRecord, MlpRows};
use crate::network::layers::scratch::{GroupWork, Scratch};
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::spec::Encoder;

/// Places of the weights of an encoder.
#[derive(Clone, Copy, Debug)]
pub(crate) enum EncoderLayers {
    /// A perceptron, with its first layer's matrix.
    Mlp(Mlp, Piece),
    Gru(GruEncoder),
}

/// Activations kept for the backward pass; only those that the encoder uses are filled.
#[derive(Default)]
pub(crate) struct EncoderRecord<T> {
    mlp: MlpRecord<T>,
    pub(crate) gru: GruRecord<T>,
}

/// The input of an encoder.
#[derive(Clone, Copy)]
pub(crate) struct EncoderInput<'a, T> {
    /// Frames of the window.
    pub(crate) window: usize,
    /// Features of all rows, `[window, all rows, width]`.
    pub(crate) features: &'a [T],
    /// Columns of the features.
    pub(crate) width: usize,
    pub(crate) dropout: Option<&'a RowMasks>,
    /// States that are carried over, `[all rows, latent]` each; empty for zero.
    pub(crate) start: States<&'a [T]>,
}

split_rows! {
    /// Rows that an encoder writes.
    pub(crate) struct EncoderRows<'a, T> {
        /// `[rows, latent]`.
        pub(crate) out: Rows<'a, T>,
        /// States of both layers at the end, `[rows, latent]`; empty where not wanted.
        pub(crate) end: [Rows<'a, T>; 2],
        pub(crate) record: EncoderRecordRows<'a, T>,
    }
}

split_rows! {
    /// Rows of an [`EncoderRecord`]; empty where nothing is kept.
    pub(crate) struct EncoderRecordRows<'a, T> {
        mlp: MlpRows<'a, T>,
        gru: GruRecordRows<'a, T>,
    }
}

split_rows! {
    /// Gradients at both ends of an encoder.
    pub(crate) struct EncoderGradients<'a, T> {
        /// In: with respect to the output, `[rows, latent]`; overwritten.
        pub(crate) output: Rows<'a, T>,
        /// Out: with respect to the input, `[rows, window width]`; empty where not wanted.
        pub(crate) input: Rows<'a, T>,
        /// Out: with respect to the carried states, `[rows, latent]`; empty where not wanted.
        pub(crate) start: [Rows<'a, T>; 2],
    }
}

/// Rows after the forward pass of an encoder.
#[derive(Clone)]
pub(crate) struct EncoderKept<'a, T> {
    /// The rows of a partition.
    pub(crate) rows: Range<usize>,
    pub(crate) record: &'a EncoderRecord<T>,
    /// Gradients of the states at the end, `[all rows, latent]`; empty for zero.
    pub(crate) end_gradient: States<&'a [T]>,
}

impl<T: Real> EncoderRecord<T> {
    /// Makes room for `rows` rows and `steps` frames.
    pub(crate) fn fit(
        &mut self,
        layers: &EncoderLayers,
        rows: usize,
        steps: usize,
        dropout: Option<&RowMasks>,
    ) {
        match layers {
            EncoderLayers::Mlp(mlp, ..) => self.mlp.fit(mlp, rows),
            EncoderLayers::Gru(gru) => self.gru.fit(gru, rows, steps, dropout),
        }
    }

    /// All rows, to be written.
    pub(crate) fn rows(&mut self, layers: &EncoderLayers) -> EncoderRecordRows<'_, T> {
        let mut rows = EncoderRecordRows::default();
        match layers {
            EncoderLayers::Mlp(mlp, ..) => rows.mlp = self.mlp.rows(mlp),
            EncoderLayers::Gru(gru) => rows.gru = self.gru.rows(gru),
        }
        rows
    }

    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        self.mlp.number_count() + self.gru.number_count()
    }
}

impl<'a, T> EncoderInput<'a, T> {
    /// Rows `rows` for a recurrent network.
    fn gru(&self, rows: &Range<usize>) -> GruInput<'a, T> {
        GruInput {
            features: self.features,
            all_rows: self.features.len() / (self.window * self.width),
            steps: self.window,
            first: rows.start,
            rows: rows.len(),
            dropout: self.dropout,
        }
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
            Encoder::Gru { .. } | Encoder::StreamingGru { .. } => {
                Self::Gru(GruEncoder::new(module, path, width, latent))
            }
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

    /// Takes the rows `range` of the input to their latent rows.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        range: Range<usize>,
        rows: &mut EncoderRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let latent = rows.out.width();
        for chunk in chunks(range.clone()) {
            let rows = rows.part(&counted_from(&chunk, range.start));
            match self {
                Self::Mlp(mlp, first) => {
                    let features = &input.features[of_rows(&chunk, input.width)];
                    let mut tile = scratch.tiles.tile(rows.record.mlp, chunk.len(), latent);
                    let terms = &[first.times(weights, features)];
                    mlp.first_layer(weights, terms, mlp.first_epilogue(weights), &mut tile);
                    mlp.forward(weights, tile, Normalised::Set(rows.out.values));
                }
                Self::Gru(gru) => {
                    let start = input.start.map(|states| part(states, &chunk, latent));
                    let rows = GruRows {
                        out: rows.out.values,
                        end: rows.end.map(|rows| rows.values),
                        record: rows.record.gru,
                    };
                    gru.forward(weights, input.gru(&chunk), start, rows, scratch);
                }
            }
        }
    }

    /// Adds the gradients of all weights for the gradient of a partition's latent rows.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        kept: EncoderKept<'_, T>,
        mut gradients: EncoderGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        for chunk in chunks(kept.rows.clone()) {
            let gradients = gradients.part(&counted_from(&chunk, kept.rows.start));
            match self {
                Self::Mlp(mlp, piece) => {
                    let (latent, width) = (gradients.output.width(), gradients.input.width());
                    let (scratch, gradient) = (&mut *group.scratch, &mut group.gradient);
                    let size = gradients.output.len();
                    let pre_activation = &mut scratch.pre_activation[..size];
                    let through = MlpGradients {
                        output: gradients.output.values,
                        hidden: &mut scratch.hidden[..size],
                        pre_activation: &mut *pre_activation,
                    };
                    let activations = kept.record.mlp.tile(mlp, &chunk);
                    mlp.backward(weights, activations, through, gradient);
                    let features = &input.features[of_rows(&chunk, input.width)];
                    let left = Columns::all(pre_activation, latent);
                    let right = Columns::all(features, width);
                    mlp.first_backward(weights, 0, left, right, gradient);
                    let to_input = gradients.input.values;
                    if !to_input.is_empty() {
                        let terms = &[piece.back(weights, pre_activation)];
                        let using = weights.instructions;
                        multiply(using, terms, width, Epilogue::Set, to_input);
                    }
                }
                Self::Gru(gru) => {
                    let width = gradients.output.width();
                    let gradients = GruGradients {
                        output: gradients.output.values,
                        input: gradients.input.values,
                        end: kept.end_gradient.map(|states| part(states, &chunk, width)),
                        start: gradients.start.map(|rows| rows.values),
                    };
                    let record = &kept.record.gru;
                    gru.backward(weights, input.gru(&chunk), record, gradients, group);
                }
            }
        }
    }
}

/// The rows `rows` of an array, or nothing of an empty one.
fn part<'a, T>(array: &'a [T], rows: &Range<usize>, width: usize) -> &'a [T] {
    array.get(of_rows(rows, width)).unwrap_or_default()
}
