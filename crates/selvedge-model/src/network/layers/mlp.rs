//! The multi-layer perceptron of the paper: Linear, ReLU, Linear, ReLU, Linear, and a LayerNorm on
//! its output, which the decoder does without.
//!
//! The first layer takes its inputs in parts, rows of one array each. An arc update adds to their
//! sums what it computes by vertex (`block.rs`); on the way back the perceptron leaves the gradient
//! of the sums.

use std::ops::Range;

use crate::kernels::gemm::{Columns, Epilogue, Term, multiply};
use crate::kernels::norm::{Normalised, layer_norm, layer_norm_backward};
use crate::kernels::real::Real;
use crate::kernels::rows::add_column_sums;
use crate::network::kept::{Activations, ModuleGradient};
use crate::network::packed::{LayerWeights, Packer, Piece};
use crate::network::parameters::{LayerNorm, Layout, Linear};

/// Places of the weights of a perceptron.
#[derive(Clone, Debug)]
pub(crate) struct Mlp {
    pub(crate) first: Linear,
    second: Linear,
    third: Linear,
    norm: Option<LayerNorm>,
    /// The parts of the first layer's input.
    parts: Vec<Piece>,
    /// Matrices of the second and of the third layer.
    pieces: [Piece; 2],
}

/// Activations that are written.
pub(crate) type Tile<'a, T> = [&'a mut [T]; 4];

impl Mlp {
    /// A perceptron with a LayerNorm, inputs → `latent` → `latent` → `latent`; its inputs are those
    /// of [`Self::plain`].
    pub(crate) fn normalised(
        layout: &mut Layout,
        path: &str,
        parts: &[Range<usize>],
        latent: usize,
    ) -> Self {
        let mlp = Self::plain(layout, path, parts, latent, latent);
        Self {
            norm: Some(layout.layer_norm(&format!("{path}.5"), latent)),
            ..mlp
        }
    }

    /// A perceptron without LayerNorm, inputs → `latent` → `latent` → `outputs`. The columns of
    /// `parts`, in order, end with its last input; those before or between are the caller's.
    pub(crate) fn plain(
        layout: &mut Layout,
        path: &str,
        parts: &[Range<usize>],
        latent: usize,
        outputs: usize,
    ) -> Self {
        let inputs = parts.last().map_or(0, |last| last.end);
        let first = layout.linear(&format!("{path}.0"), inputs, latent);
        let second = layout.linear(&format!("{path}.2"), latent, latent);
        let third = layout.linear(&format!("{path}.4"), latent, outputs);
        let size = &mut layout.size;
        let pieces = [&second, &third].map(|linear| Piece::whole(size, linear));
        let parts = parts
            .iter()
            .map(|columns| Piece::new(size, &first, columns));
        Self {
            parts: parts.collect(),
            first,
            second,
            third,
            norm: None,
            pieces,
        }
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for piece in self.parts.iter().chain(&self.pieces) {
            piece.pack(packer);
        }
    }

    /// Numbers in a row of each of the activations.
    fn widths(&self) -> [usize; 4] {
        let [normal, deviation] = match &self.norm {
            Some(norm) => [norm.weight.len(), 1],
            None => [0, 0],
        };
        [self.first.outputs, self.second.outputs, normal, deviation]
    }

    /// Makes room for the activations of so many rows.
    pub(crate) fn fit<T: Real>(&self, activations: &mut Activations<T>, rows: usize) {
        for (array, width) in activations.iter_mut().zip(self.widths()) {
            array.resize(rows * width);
        }
    }

    /// The activations of `rows` rows, to be written where they are kept, else in `spare`.
    pub(crate) fn tile<'a, T: Real>(
        &self,
        kept: Option<&'a mut Activations<T>>,
        spare: &'a mut Activations<T>,
        rows: usize,
    ) -> Tile<'a, T> {
        let mut widths = self.widths().into_iter();
        let arrays = kept.unwrap_or(spare).each_mut();
        arrays.map(|array| &mut array[..rows * widths.next().unwrap_or(0)])
    }

    /// The first layer, from rows of each part of its input.
    pub(crate) fn first_layer<T: Real, const N: usize>(
        &self,
        weights: LayerWeights<'_, T>,
        rows: [&[T]; N],
        epilogue: Epilogue<'_, T>,
        hidden1: &mut [T],
    ) {
        let terms: [Term<'_, T>; N] =
            std::array::from_fn(|part| self.parts[part].times(weights, rows[part]));
        let columns = self.first.outputs;
        multiply(weights.instructions, &terms, columns, epilogue, hidden1);
    }

    /// The end of the first layer where all its inputs are in its parts.
    pub(crate) fn first_relu<'a, T>(&self, weights: LayerWeights<'a, T>) -> Epilogue<'a, T> {
        Epilogue::BiasRelu(weights.at(&self.first.bias))
    }

    /// From rows of the only part to `out`. Activations go where they are kept, else to `spare`.
    pub(crate) fn forward_whole<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: &[T],
        (kept, spare): (Option<&mut Activations<T>>, &mut Activations<T>),
        out: &mut [T],
    ) {
        let tile = self.tile(kept, spare, input.len() / self.first.inputs);
        self.first_layer(weights, [input], self.first_relu(weights), tile[0]);
        self.forward(weights, tile, Normalised::Set(out));
    }

    /// From the first layer's activations to the output.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        [hidden1, hidden2, normal, inverse_deviation]: Tile<'_, T>,
        out: Normalised<'_, T>,
    ) {
        let using = weights.instructions;
        let [second, third] = &self.pieces;
        let epilogue = Epilogue::BiasRelu(weights.at(&self.second.bias));
        let term = second.times(weights, hidden1);
        multiply(using, &[term], self.second.outputs, epilogue, hidden2);
        let epilogue = Epilogue::Bias(weights.at(&self.third.bias));
        let term = third.times(weights, hidden2);
        let Some(norm) = &self.norm else {
            // A decoder's output is nothing's update.
            if let Normalised::Set(out) = out {
                multiply(using, &[term], self.third.outputs, epilogue, out);
            }
            return;
        };
        multiply(using, &[term], self.third.outputs, epilogue, normal);
        let (weight, shift) = (weights.at(&norm.weight), weights.at(&norm.bias));
        layer_norm(using, [normal, inverse_deviation], weight, shift, out);
    }

    /// From the gradient of the output `[rows, outputs]`, which is overwritten, to that of the sums
    /// of the first layer, with room for that of the second layer's, `[rows, latent]` both. Adds
    /// the gradients of all weights, of the first layer's matrix for its parts with these `rows`.
    pub(crate) fn backward<T: Real, const N: usize>(
        &self,
        weights: LayerWeights<'_, T>,
        (rows, kept): ([&[T]; N], &Activations<T>),
        [output, hidden, by_sums]: [&mut [T]; 3],
        gradient: &mut ModuleGradient<T>,
    ) {
        let (using, latent) = (weights.instructions, self.first.outputs);
        let [hidden1, hidden2, normal, inverse_deviation] = kept;
        let [second, third] = &self.pieces;
        if let Some(norm) = &self.norm {
            let kept = [&**normal, inverse_deviation];
            norm.backward(weights, output, kept, gradient);
        }
        gradient.add_linear(using, &self.third, output, hidden2);
        let (term, mask) = (third.back(weights, output), Epilogue::Mask(hidden2));
        multiply(using, &[term], latent, mask, hidden);
        gradient.add_linear(using, &self.second, hidden, hidden1);
        let (term, mask) = (second.back(weights, hidden), Epilogue::Mask(hidden1));
        multiply(using, &[term], latent, mask, by_sums);
        add_column_sums(using, gradient.at(&self.first.bias), by_sums);
        let by_sums = Columns::all(&*by_sums, latent);
        for (part, rows) in self.parts.iter().zip(rows) {
            let rows = Columns::all(rows, part.inputs());
            gradient.add_matrix(using, &self.first, part.first, by_sums, rows);
        }
    }

    /// From the gradient of the sums of the first layer to that of the rows of a part.
    pub(crate) fn input_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        part: usize,
        by_sums: &[T],
        epilogue: Epilogue<'_, T>,
        to: &mut [T],
    ) {
        let part = &self.parts[part];
        let terms = &[part.back(weights, by_sums)];
        multiply(weights.instructions, terms, part.inputs(), epilogue, to);
    }
}

impl LayerNorm {
    /// Takes the gradient of the output back to the input, from what the forward pass kept. Adds
    /// those of weight and shift.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        output: &mut [T],
        kept: [&[T]; 2],
        gradient: &mut ModuleGradient<T>,
    ) {
        let both = gradient.at(&(self.weight.start..self.bias.end));
        let both = both.split_at_mut(self.weight.len()).into();
        let weight = weights.at(&self.weight);
        layer_norm_backward(weights.instructions, output, kept, weight, both);
    }
}
