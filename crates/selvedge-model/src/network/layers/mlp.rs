//! The multi-layer perceptron of the paper: Linear, ReLU, Linear, ReLU, Linear, and a LayerNorm on
//! its output, which the decoder does without.
//!
//! The sums of the first layer are the caller's: an arc update splits them by vertex (`block.rs`).
//! The perceptron takes them from there, and leaves their gradient on the way back.

use crate::graph::share::Rows;
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Epilogue, Term, multiply};
use crate::kernels::norm::{Normalised, layer_norm, layer_norm_backward};
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

/// Activations of a chunk of rows: after the first and the second ReLU, both `[rows, latent]`; the
/// normalised output `[rows, outputs]` and 1 / its deviation `[rows]`, both empty without LayerNorm.
pub(crate) const ACTIVATIONS: usize = 4;

/// Activations of a chunk that are written.
pub(crate) type Tile<'a, T> = [&'a mut [T]; ACTIVATIONS];

/// The rows that are kept, or room for `rows` rows in `spare` where none are.
pub(crate) fn tile<'a, T>(
    kept: [Rows<'a, T>; ACTIVATIONS],
    spare: &'a mut [Aligned<T>; ACTIVATIONS],
    rows: usize,
) -> Tile<'a, T> {
    if !kept[0].is_empty() {
        return kept.map(|rows| rows.values);
    }
    let mut widths = kept.iter().map(Rows::width);
    let spare = spare.each_mut();
    spare.map(|array| &mut array[..rows * widths.next().unwrap_or(0)])
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

    /// Numbers in a row of each of the activations.
    pub(crate) fn widths(&self) -> [usize; ACTIVATIONS] {
        let [normal, deviation] = self.norm.map_or([0, 0], |norm| [norm.width, 1]);
        [self.first.outputs, self.second.outputs, normal, deviation]
    }

    /// The first layer, from its terms and its epilogue.
    pub(crate) fn first_layer<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        terms: &[Term<'_, T>],
        epilogue: Epilogue<'_, T>,
        [hidden1, ..]: &mut Tile<'_, T>,
    ) {
        let using = weights.instructions;
        multiply(using, terms, self.first.outputs, epilogue, hidden1);
    }

    /// From the first layer's activations to the output.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        [hidden1, hidden2, normal, inverse_deviation]: Tile<'_, T>,
        out: Normalised<'_, T>,
    ) {
        let (using, flat) = (weights.instructions, weights.flat);
        let [second, third] = &self.pieces;
        let epilogue = Epilogue::BiasRelu(&flat[self.second.bias_range()]);
        let term = second.times(weights, hidden1);
        multiply(using, &[term], self.second.outputs, epilogue, hidden2);
        let epilogue = Epilogue::Bias(&flat[self.third.bias_range()]);
        let term = third.times(weights, hidden2);
        let Some(norm) = &self.norm else {
            // A decoder's output is nothing's update.
            if let Normalised::Set(out) = out {
                multiply(using, &[term], self.third.outputs, epilogue, out);
            }
            return;
        };
        multiply(using, &[term], self.third.outputs, epilogue, normal);
        let rows = [normal, inverse_deviation];
        let (weight, shift) = (&flat[norm.weight_range()], &flat[norm.bias_range()]);
        layer_norm(using, rows, weight, shift, out);
    }

    /// From the gradient of the output `[rows, outputs]`, which is overwritten, to that of the sums
    /// of the first layer, with room for that of the second layer's, `[rows, latent]` both. Adds
    /// the gradients of all weights except the first layer's matrix.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        [hidden1, hidden2, normal, inverse_deviation]: [&[T]; ACTIVATIONS],
        [output, hidden, pre_activation]: [&mut [T]; 3],
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (using, latent) = (weights.instructions, self.first.outputs);
        let [second, third] = &self.pieces;
        if let Some(norm) = &self.norm {
            let weight = &weights.flat[norm.weight_range()];
            let kept = [normal, inverse_deviation];
            layer_norm_backward(using, output, kept, weight, gradient.layer_norm(norm));
        }
        gradient.add_linear(using, &self.third, output, hidden2);
        let (term, mask) = (third.back(weights, output), Epilogue::Mask(hidden2));
        multiply(using, &[term], latent, mask, hidden);
        gradient.add_linear(using, &self.second, hidden, hidden1);
        let (term, mask) = (second.back(weights, hidden), Epilogue::Mask(hidden1));
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
