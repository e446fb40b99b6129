//! The multi-layer perceptron of the paper: Linear, ReLU, Linear, ReLU, Linear, and a LayerNorm on
//! its output, which the decoder does without.
//!
//! The sums of the first layer are the caller's: an arc update splits them by vertex (`block.rs`).
//! The perceptron takes them from there, and leaves their gradient on the way back.

use std::ops::Range;

use crate::graph::share::{Rows, split_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Epilogue, Term, multiply};
use crate::kernels::norm::{NormKept, NormRows, Normalised, layer_norm, layer_norm_backward};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::rows::add_column_sums;
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::network::parameters::{LayerNorm, Linear, ModuleGradient};

/// Places of the weights of a perceptron.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mlp {
    pub(crate) first: Linear,
    second: Linear,
    third: Linear,
    norm: Option<LayerNorm>,
    /// Matrices of the second and of the third layer.
    pieces: [Piece; 2],
}

/// Activations of all rows, kept for the backward pass.
#[derive(Default)]
pub(crate) struct MlpRecord<T> {
    hidden1: Aligned<T>,
    hidden2: Aligned<T>,
    normal: Aligned<T>,
    inverse_deviation: Aligned<T>,
}

split_rows! {
    /// Rows of a [`MlpRecord`]; empty where nothing is kept.
    pub(crate) struct MlpRows<'a, T> {
        /// `[rows, latent]`.
        pub(crate) hidden1: Rows<'a, T>,
        /// `[rows, latent]`.
        pub(crate) hidden2: Rows<'a, T>,
        /// `[rows, outputs]`; empty without LayerNorm.
        pub(crate) normal: Rows<'a, T>,
        /// `[rows]`; empty without LayerNorm.
        pub(crate) inverse_deviation: Rows<'a, T>,
    }
}

/// Activations of a tile that are written.
pub(crate) struct MlpTile<'a, T> {
    /// After the first ReLU, `[rows, latent]`.
    pub(crate) hidden1: &'a mut [T],
    /// After the second ReLU, `[rows, latent]`.
    pub(crate) hidden2: &'a mut [T],
    /// The normalised output, `[rows, outputs]`; unused without LayerNorm.
    pub(crate) normal: &'a mut [T],
    /// 1 / deviation of each output row, `[rows]`; unused without LayerNorm.
    pub(crate) inverse_deviation: &'a mut [T],
}

impl<'a, T> MlpRows<'a, T> {
    /// The rows as a tile.
    pub(crate) fn into_tile(self) -> MlpTile<'a, T> {
        MlpTile {
            hidden1: self.hidden1.values,
            hidden2: self.hidden2.values,
            normal: self.normal.values,
            inverse_deviation: self.inverse_deviation.values,
        }
    }
}

/// Activations of a tile that are read.
#[derive(Clone, Copy)]
pub(crate) struct MlpKept<'a, T> {
    hidden1: &'a [T],
    hidden2: &'a [T],
    norm: NormKept<'a, T>,
}

/// Gradients of a tile on its way back.
pub(crate) struct MlpGradients<'a, T> {
    /// In: with respect to the output, `[rows, outputs]`; overwritten.
    pub(crate) output: &'a mut [T],
    /// Room for the gradient of the second layer's sums, `[rows, latent]`.
    pub(crate) hidden: &'a mut [T],
    /// Out: with respect to the first layer's sums, `[rows, latent]`.
    pub(crate) pre_activation: &'a mut [T],
}

impl<T: Real> MlpRecord<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let rows = [&self.hidden1, &self.hidden2, &self.normal];
        let held: usize = rows.iter().map(|numbers| numbers.len()).sum();
        held + self.inverse_deviation.len()
    }

    /// Makes room for `rows` rows.
    pub(crate) fn fit(&mut self, mlp: &Mlp, rows: usize) {
        self.hidden1.resize(rows * mlp.first.outputs);
        self.hidden2.resize(rows * mlp.second.outputs);
        let normal = if mlp.norm.is_some() { rows } else { 0 };
        self.normal.resize(normal * mlp.third.outputs);
        self.inverse_deviation.resize(normal);
    }

    /// All rows, to be written.
    pub(crate) fn rows(&mut self, mlp: &Mlp) -> MlpRows<'_, T> {
        MlpRows {
            hidden1: Rows::new(&mut self.hidden1, mlp.first.outputs),
            hidden2: Rows::new(&mut self.hidden2, mlp.second.outputs),
            normal: Rows::new(&mut self.normal, mlp.third.outputs),
            inverse_deviation: Rows::new(&mut self.inverse_deviation, 1),
        }
    }

    /// The rows of a tile, to be read.
    pub(crate) fn tile(&self, mlp: &Mlp, rows: &Range<usize>) -> MlpKept<'_, T> {
        let of = |width: usize| rows.start * width..rows.end * width;
        let normal = |width: usize| if mlp.norm.is_some() { of(width) } else { 0..0 };
        MlpKept {
            hidden1: &self.hidden1[of(mlp.first.outputs)],
            hidden2: &self.hidden2[of(mlp.second.outputs)],
            norm: NormKept {
                normal: &self.normal[normal(mlp.third.outputs)],
                inverse_deviation: &self.inverse_deviation[normal(1)],
            },
        }
    }
}

impl Mlp {
    /// A perceptron with a LayerNorm, `inputs` → `latent` → `latent` → `latent`.
    pub(crate) fn normalised(
        module: &mut ModuleBuilder,
        path: &str,
        inputs: usize,
        latent: usize,
    ) -> Self {
        let mlp = Self::plain(module, path, inputs, latent, latent);
        Self {
            norm: Some(module.layout.layer_norm(&format!("{path}.5"), latent)),
            ..mlp
        }
    }

    /// A perceptron without LayerNorm, `inputs` → `latent` → `latent` → `outputs`.
    pub(crate) fn plain(
        module: &mut ModuleBuilder,
        path: &str,
        inputs: usize,
        latent: usize,
        outputs: usize,
    ) -> Self {
        let (layout, size) = (&mut module.layout, &mut module.size);
        let first = layout.linear(&format!("{path}.0"), inputs, latent);
        let second = layout.linear(&format!("{path}.2"), latent, latent);
        let third = layout.linear(&format!("{path}.4"), latent, outputs);
        Self {
            first,
            second,
            third,
            norm: None,
            pieces: [Piece::whole(size, &second), Piece::whole(size, &third)],
        }
    }

    /// Packs all but the first layer, which is the caller's.
    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for piece in &self.pieces {
            piece.pack(packer);
        }
    }

    /// The epilogue of a first layer with no other than its own inputs: bias, then ReLU.
    pub(crate) fn first_epilogue<'a, T>(&self, weights: LayerWeights<'a, T>) -> Epilogue<'a, T> {
        Epilogue::BiasRelu(&weights.flat[self.first.bias_range()])
    }

    /// The first layer, from its terms and its epilogue.
    pub(crate) fn first_layer<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        terms: &[Term<'_, T>],
        epilogue: Epilogue<'_, T>,
        tile: &mut MlpTile<'_, T>,
    ) {
        let columns = self.first.outputs;
        multiply(weights.instructions, terms, columns, epilogue, tile.hidden1);
    }

    /// From the first layer's activations to the output.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        tile: MlpTile<'_, T>,
        out: Normalised<'_, T>,
    ) {
        let (using, flat) = (weights.instructions, weights.flat);
        let [second, third] = &self.pieces;
        let epilogue = Epilogue::BiasRelu(&flat[self.second.bias_range()]);
        let term = second.times(weights, tile.hidden1);
        multiply(using, &[term], self.second.outputs, epilogue, tile.hidden2);
        let epilogue = Epilogue::Bias(&flat[self.third.bias_range()]);
        let term = third.times(weights, tile.hidden2);
        let Some(norm) = &self.norm else {
            // A decoder's output is nothing's update.
            if let Normalised::Set(out) = out {
                multiply(using, &[term], self.third.outputs, epilogue, out);
            }
            return;
        };
        multiply(using, &[term], self.third.outputs, epilogue, tile.normal);
        let rows = NormRows {
            normal: tile.normal,
            inverse_deviation: tile.inverse_deviation,
        };
        let (weight, shift) = (&flat[norm.weight_range()], &flat[norm.bias_range()]);
        layer_norm(using, rows, weight, shift, out);
    }

    /// From the gradient of the output to the pre-activation gradient of the first layer. Adds the
    /// gradients of all weights except the first layer's matrix.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: MlpKept<'_, T>,
        gradients: MlpGradients<'_, T>,
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (using, latent) = (weights.instructions, self.first.outputs);
        let MlpGradients {
            output,
            hidden,
            pre_activation,
        } = gradients;
        let [second, third] = &self.pieces;
        if let Some(norm) = &self.norm {
            let weight = &weights.flat[norm.weight_range()];
            layer_norm_backward(using, output, kept.norm, weight, gradient.layer_norm(norm));
        }
        gradient.add_linear(using, &self.third, output, kept.hidden2);
        let (term, mask) = (third.back(weights, output), Epilogue::Mask(kept.hidden2));
        multiply(using, &[term], latent, mask, hidden);
        gradient.add_linear(using, &self.second, hidden, kept.hidden1);
        let (term, mask) = (second.back(weights, hidden), Epilogue::Mask(kept.hidden1));
        multiply(using, &[term], latent, mask, pre_activation);
        let bias = gradient.at(self.first.bias_range());
        add_column_sums(using, bias, pre_activation);
    }

    /// Adds the gradient of the first layer's matrix at the input columns from `from` on.
    pub(crate) fn first_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        from: usize,
        pre_activation: Columns<'_, T>,
        input: Columns<'_, T>,
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let sums = Sums {
            rows: gradient.at(self.first.weight_range()),
            stride: self.first.inputs,
            first: from,
        };
        add_outer(weights.instructions, sums, pre_activation, input);
    }
}
