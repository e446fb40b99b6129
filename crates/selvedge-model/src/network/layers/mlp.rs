//! The multi-layer perceptron of the paper: Linear, ReLU, Linear, ReLU, Linear, and a
//! LayerNorm on its output, without one in the decoder.
//!
//! What goes into the first layer is the caller's: an edge update splits it by vertex
//! (`block.rs`). Here begins what comes after that layer's sums, and ends the gradient that goes to
//! them.

use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Finish, Term, multiply};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::{NormRows, Normalised, add_column_sums, layer_norm, layer_norm_backward};
use crate::network::packed::{LayerWeights, ModuleSize, Packer, Piece};
use crate::network::parameters::{LayerNorm, LayoutBuilder, Linear, ModuleGradient};

/// Where the weights of a perceptron lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mlp {
    pub(crate) first: Linear,
    second: Linear,
    third: Linear,
    norm: Option<LayerNorm>,
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

/// Activations of a tile that are written.
pub(crate) struct MlpTile<'a, T> {
    pub(crate) hidden1: &'a mut [T],
    pub(crate) hidden2: &'a mut [T],
    /// The normalised output (without norm: unused).
    pub(crate) normal: &'a mut [T],
    pub(crate) inverse_deviation: &'a mut [T],
}

/// Activations of a tile that are read.
#[derive(Clone, Copy)]
pub(crate) struct MlpKept<'a, T> {
    hidden1: &'a [T],
    hidden2: &'a [T],
    normal: &'a [T],
    inverse_deviation: &'a [T],
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

    /// Everything, with the widths of its rows.
    pub(crate) fn rows(&mut self, mlp: &Mlp) -> [(&mut [T], usize); 4] {
        [
            (&mut self.hidden1, mlp.first.outputs),
            (&mut self.hidden2, mlp.second.outputs),
            (&mut self.normal, mlp.third.outputs),
            (&mut self.inverse_deviation, 1),
        ]
    }

    pub(crate) fn tile(&self, mlp: &Mlp, rows: &std::ops::Range<usize>) -> MlpKept<'_, T> {
        let of = |width: usize| rows.start * width..rows.end * width;
        let normal = |width: usize| if mlp.norm.is_some() { of(width) } else { 0..0 };
        MlpKept {
            hidden1: &self.hidden1[of(mlp.first.outputs)],
            hidden2: &self.hidden2[of(mlp.second.outputs)],
            normal: &self.normal[normal(mlp.third.outputs)],
            inverse_deviation: &self.inverse_deviation[normal(1)],
        }
    }
}

impl Mlp {
    /// A perceptron with a LayerNorm, `inputs` → `latent` → `latent` → `latent`.
    pub(crate) fn normalised(
        (layout, size): (&mut LayoutBuilder, &mut ModuleSize),
        path: &str,
        inputs: usize,
        latent: usize,
    ) -> Self {
        let mlp = Self::plain((&mut *layout, size), path, inputs, [latent, latent]);
        Self {
            norm: Some(layout.layer_norm(&format!("{path}.5"), latent)),
            ..mlp
        }
    }

    /// A perceptron without LayerNorm, `inputs` → `latent` → `latent` → `outputs`.
    pub(crate) fn plain(
        (layout, size): (&mut LayoutBuilder, &mut ModuleSize),
        path: &str,
        inputs: usize,
        [latent, outputs]: [usize; 2],
    ) -> Self {
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

    /// The bias of the first layer, then ReLU.
    pub(crate) fn first_finish<'a, T>(&self, weights: LayerWeights<'a, T>) -> Finish<'a, T> {
        Finish::BiasRelu(&weights.flat[self.first.bias_range()])
    }

    /// The first layer: its terms, and what happens to their sums.
    pub(crate) fn first_layer<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        terms: &[Term<'_, T>],
        finish: Finish<'_, T>,
        tile: &mut MlpTile<'_, T>,
    ) {
        let columns = self.first.outputs;
        multiply(weights.instructions, terms, columns, finish, tile.hidden1);
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
        let finish = Finish::BiasRelu(&flat[self.second.bias_range()]);
        let term = second.times(weights, tile.hidden1);
        multiply(using, &[term], self.second.outputs, finish, tile.hidden2);
        let finish = Finish::Bias(&flat[self.third.bias_range()]);
        let term = third.times(weights, tile.hidden2);
        let Some(norm) = &self.norm else {
            // A decoder's output is nothing's update.
            if let Normalised::Set(out) = out {
                multiply(using, &[term], self.third.outputs, finish, out);
            }
            return;
        };
        multiply(using, &[term], self.third.outputs, finish, tile.normal);
        let rows = NormRows {
            normal: tile.normal,
            inverse_deviation: tile.inverse_deviation,
        };
        let (weight, shift) = (&flat[norm.weight_range()], &flat[norm.bias_range()]);
        layer_norm(using, rows, weight, shift, out);
    }

    /// From the gradient of the output (which is overwritten) to that of the first layer's sums, left
    /// in `first`; adds the gradients of all weights but those of the first layer's matrix. `hidden` is
    /// room for as many rows.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        kept: MlpKept<'_, T>,
        output: &mut [T],
        (hidden, first): (&mut [T], &mut [T]),
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (using, latent) = (weights.instructions, self.first.outputs);
        let [second, third] = &self.pieces;
        if let Some(norm) = &self.norm {
            layer_norm_backward(
                using,
                output,
                (kept.normal, kept.inverse_deviation),
                &weights.flat[norm.weight_range()],
                gradient.layer_norm(norm),
            );
        }
        gradient.add_linear(using, &self.third, output, kept.hidden2);
        let term = third.back(weights, output);
        multiply(using, &[term], latent, Finish::Mask(kept.hidden2), hidden);
        gradient.add_linear(using, &self.second, hidden, kept.hidden1);
        let term = second.back(weights, hidden);
        multiply(using, &[term], latent, Finish::Mask(kept.hidden1), first);
        add_column_sums(using, gradient.at(self.first.bias_range()), first);
    }

    /// Adds the gradient of the first layer's matrix at input columns `from..` for those rows.
    pub(crate) fn first_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        from: usize,
        (first, input): (Columns<'_, T>, Columns<'_, T>),
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let sums = Sums {
            rows: gradient.at(self.first.weight_range()),
            stride: self.first.inputs,
            first: from,
        };
        add_outer(weights.instructions, sums, first, input);
    }
}
