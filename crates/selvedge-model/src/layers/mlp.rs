//! The multi-layer perceptron of the paper: Linear, ReLU, Linear, ReLU, Linear, and a
//! LayerNorm on its output, without one in the decoder.
//!
//! The product of the first layer is the caller's: an edge update splits it by vertex
//! (`block.rs`). Here begins what comes after that product, and ends the gradient that goes to it.

use crate::kernels::{
    NormRows, add_bias, add_column_sums, bias_relu, layer_norm, layer_norm_backward, relu_backward,
};
use crate::layers::{TILE, resize};
use crate::parameters::{LayerNorm, LayoutBuilder, Linear};
use crate::product::{Matrix, MatrixMut, Store, multiply};
use crate::real::Real;

/// Where the weights of a perceptron lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Mlp {
    pub(crate) first: Linear,
    second: Linear,
    third: Linear,
    norm: Option<LayerNorm>,
}

/// Activations of all rows, kept for the backward pass.
#[derive(Default)]
pub(crate) struct MlpRecord<T> {
    pub(crate) hidden1: Vec<T>,
    pub(crate) hidden2: Vec<T>,
    pub(crate) normal: Vec<T>,
    pub(crate) inverse_deviation: Vec<T>,
}

/// The part of an [`MlpRecord`] that belongs to a tile.
pub(crate) struct MlpTile<'a, T> {
    /// In the forward pass: the product of the first layer, then its activation.
    pub(crate) hidden1: &'a mut [T],
    pub(crate) hidden2: &'a mut [T],
    /// The normalised output (without norm: unused).
    pub(crate) normal: &'a mut [T],
    pub(crate) inverse_deviation: &'a mut [T],
}

/// Gradients of a tile on their way back.
pub(crate) struct MlpScratch<T> {
    hidden2: Vec<T>,
    /// Gradient of the first layer's product, `[rows, latent]`: the result.
    pub(crate) first: Vec<T>,
}

impl<T: Real> MlpScratch<T> {
    pub(crate) fn new(latent: usize) -> Self {
        Self {
            hidden2: vec![T::ZERO; TILE * latent],
            first: vec![T::ZERO; TILE * latent],
        }
    }
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
        resize(&mut self.hidden1, rows * mlp.first.outputs);
        resize(&mut self.hidden2, rows * mlp.second.outputs);
        resize(&mut self.normal, rows * mlp.third.outputs);
        resize(&mut self.inverse_deviation, rows);
    }

    pub(crate) fn tile(&mut self, mlp: &Mlp, rows: &std::ops::Range<usize>) -> MlpTile<'_, T> {
        let of = |width: usize| rows.start * width..rows.end * width;
        MlpTile {
            hidden1: &mut self.hidden1[of(mlp.first.outputs)],
            hidden2: &mut self.hidden2[of(mlp.second.outputs)],
            normal: &mut self.normal[of(mlp.third.outputs)],
            inverse_deviation: &mut self.inverse_deviation[rows.clone()],
        }
    }
}

impl Mlp {
    /// A perceptron with a LayerNorm, `inputs` → `latent` → `latent` → `latent`.
    pub(crate) fn normalised(
        layout: &mut LayoutBuilder,
        path: &str,
        inputs: usize,
        latent: usize,
    ) -> Self {
        let mlp = Self::plain(layout, path, inputs, [latent, latent]);
        Self {
            norm: Some(layout.layer_norm(&format!("{path}.5"), latent)),
            ..mlp
        }
    }

    /// A perceptron without LayerNorm, `inputs` → `latent` → `latent` → `outputs`.
    pub(crate) fn plain(
        layout: &mut LayoutBuilder,
        path: &str,
        inputs: usize,
        [latent, outputs]: [usize; 2],
    ) -> Self {
        Self {
            first: layout.linear(&format!("{path}.0"), inputs, latent),
            second: layout.linear(&format!("{path}.2"), latent, latent),
            third: layout.linear(&format!("{path}.4"), latent, outputs),
            norm: None,
        }
    }

    /// The first layer's product with input columns `first..first + count` only.
    pub(crate) fn first_product<T: Real>(
        &self,
        weights: &[T],
        columns: (usize, usize),
        (input, store): (&[T], Store),
        hidden1: &mut [T],
    ) {
        let (first, count) = columns;
        let weight = Matrix::new(&weights[self.first.weight_range()], self.first.inputs);
        multiply(
            MatrixMut::new(hidden1, self.first.outputs),
            store,
            Matrix::new(input, count),
            weight.columns(first, count).transposed(),
        );
    }

    /// From the first layer's product (in `tile.hidden1`) to the output of the perceptron.
    pub(crate) fn finish<T: Real>(&self, weights: &[T], tile: MlpTile<'_, T>, out: &mut [T]) {
        bias_relu(tile.hidden1, &weights[self.first.bias_range()]);
        forward_product(&self.second, weights, tile.hidden1, tile.hidden2);
        bias_relu(tile.hidden2, &weights[self.second.bias_range()]);
        let bias = &weights[self.third.bias_range()];
        match &self.norm {
            Some(norm) => {
                forward_product(&self.third, weights, tile.hidden2, tile.normal);
                let rows = NormRows {
                    normal: tile.normal,
                    inverse_deviation: tile.inverse_deviation,
                };
                let weight = &weights[norm.weight_range()];
                layer_norm(rows, bias, weight, &weights[norm.bias_range()], out);
            }
            None => {
                forward_product(&self.third, weights, tile.hidden2, out);
                add_bias(out, bias);
            }
        }
    }

    /// From the gradient of the output (which is overwritten) to that of the first layer's
    /// product, left in `scratch.first`; adds the gradients of all weights but the first layer's.
    pub(crate) fn finish_backward<T: Real>(
        &self,
        weights: &[T],
        tile: &MlpTile<'_, T>,
        output: &mut [T],
        scratch: &mut MlpScratch<T>,
        gradient: &mut [T],
    ) {
        let rows = tile.hidden1.len() / self.first.outputs;
        if let Some(norm) = &self.norm {
            // Weight and bias of a LayerNorm lie side by side.
            let (dw, ds) =
                gradient[norm.weight..norm.weight + 2 * norm.width].split_at_mut(norm.width);
            layer_norm_backward(
                output,
                (tile.normal, tile.inverse_deviation),
                &weights[norm.weight_range()],
                dw,
                ds,
            );
        }
        let hidden2 = &mut scratch.hidden2[..rows * self.second.outputs];
        backward_product(
            &self.third,
            weights,
            (output, tile.hidden2),
            gradient,
            hidden2,
        );
        relu_backward(hidden2, tile.hidden2);
        let first = &mut scratch.first[..rows * self.first.outputs];
        backward_product(
            &self.second,
            weights,
            (hidden2, tile.hidden1),
            gradient,
            first,
        );
        relu_backward(first, tile.hidden1);
        add_column_sums(&mut gradient[self.first.bias_range()], first);
    }

    /// The gradients of the first layer's weights at input columns `first..first + count`, and,
    /// where asked for, of those inputs.
    pub(crate) fn first_backward<T: Real>(
        &self,
        weights: &[T],
        columns: (usize, usize),
        (first_gradient, input): (&[T], &[T]),
        gradient: &mut [T],
        to_input: Option<(&mut [T], Store)>,
    ) {
        let (first, count) = columns;
        let width = self.first.outputs;
        let into = MatrixMut::new(&mut gradient[self.first.weight_range()], self.first.inputs);
        multiply(
            into.columns(first, count),
            Store::Add,
            Matrix::new(first_gradient, width).transposed(),
            Matrix::new(input, count),
        );
        if let Some((to_input, store)) = to_input {
            let weight = Matrix::new(&weights[self.first.weight_range()], self.first.inputs);
            multiply(
                MatrixMut::new(to_input, count),
                store,
                Matrix::new(first_gradient, width),
                weight.columns(first, count),
            );
        }
    }
}

/// out ← input Wᵀ.
pub(crate) fn forward_product<T: Real>(linear: &Linear, weights: &[T], input: &[T], out: &mut [T]) {
    multiply(
        MatrixMut::new(out, linear.outputs),
        Store::Replace,
        Matrix::new(input, linear.inputs),
        Matrix::new(&weights[linear.weight_range()], linear.inputs).transposed(),
    );
}

/// Adds the gradients of weight and bias for an output gradient and the layer's input, and sets
/// `to_input` to the gradient of the input.
pub(crate) fn backward_product<T: Real>(
    linear: &Linear,
    weights: &[T],
    (output, input): (&[T], &[T]),
    gradient: &mut [T],
    to_input: &mut [T],
) {
    add_column_sums(&mut gradient[linear.bias_range()], output);
    multiply(
        MatrixMut::new(&mut gradient[linear.weight_range()], linear.inputs),
        Store::Add,
        Matrix::new(output, linear.outputs).transposed(),
        Matrix::new(input, linear.inputs),
    );
    multiply(
        MatrixMut::new(to_input, linear.inputs),
        Store::Replace,
        Matrix::new(output, linear.outputs),
        Matrix::new(&weights[linear.weight_range()], linear.inputs),
    );
}
