//! The multi-layer perceptron of the paper: Linear, ReLU, Linear, ReLU, Linear, and a LayerNorm on
//! its output, which the decoder does without.
//!
//! The sums of the first layer are the caller's: an arc update splits them by vertex (`block.rs`).
//! The perceptron takes them from there, and leaves their gradient on the way back.

use crate::kernels::gemm::{Columns, Epilogue, Term, multiply};
use crate::kernels::norm::{Normalised, layer_norm, layer_norm_backward};
use crate::kernels::outer::{Sums, add_outer};
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
    /// Matrices of the second and of the third layer.
    pieces: [Piece; 2],
}

/// Activations that are written.
pub(crate) type Tile<'a, T> = [&'a mut [T]; 4];

impl Mlp {
    /// A perceptron with a LayerNorm, `inputs` → `latent` → `latent` → `latent`.
    pub(crate) fn normalised(
        layout: &mut Layout,
        path: &str,
        inputs: usize,
        latent: usize,
    ) -> Self {
        let mlp = Self::plain(layout, path, inputs, latent, latent);
        Self {
            norm: Some(layout.layer_norm(&format!("{path}.5"), latent)),
            ..mlp
        }
    }

    /// A perceptron without LayerNorm, `inputs` → `latent` → `latent` → `outputs`.
    pub(crate) fn plain(
        layout: &mut Layout,
        path: &str,
        inputs: usize,
        latent: usize,
        outputs: usize,
    ) -> Self {
        let first = layout.linear(&format!("{path}.0"), inputs, latent);
        let second = layout.linear(&format!("{path}.2"), latent, latent);
        let third = layout.linear(&format!("{path}.4"), latent, outputs);
        let pieces = [&second, &third].map(|linear| Piece::whole(&mut layout.size, linear));
        Self {
            first,
            second,
            third,
            norm: None,
            pieces,
        }
    }

    /// Packs all but the first layer, which is the caller's.
    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for piece in &self.pieces {
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

    /// The first layer with no other than its own inputs.
    pub(crate) fn first_layer<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        terms: &[Term<'_, T>],
        [hidden1, ..]: &mut Tile<'_, T>,
    ) {
        let epilogue = Epilogue::BiasRelu(weights.at(&self.first.bias));
        let columns = self.first.outputs;
        multiply(weights.instructions, terms, columns, epilogue, hidden1);
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
    /// the gradients of all weights except the first layer's matrix.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        [hidden1, hidden2, normal, inverse_deviation]: &Activations<T>,
        [output, hidden, pre_activation]: [&mut [T]; 3],
        gradient: &mut ModuleGradient<T>,
    ) {
        let (using, latent) = (weights.instructions, self.first.outputs);
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
        multiply(using, &[term], latent, mask, pre_activation);
        add_column_sums(using, gradient.at(&self.first.bias), pre_activation);
    }

    /// Adds the gradient of the first layer's matrix at the input columns from `from` on.
    pub(crate) fn first_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        from: usize,
        pre_activation: Columns<'_, T>,
        input: Columns<'_, T>,
        gradient: &mut ModuleGradient<T>,
    ) {
        let sums = Sums {
            rows: gradient.at(&self.first.weight),
            stride: self.first.inputs,
            first: from,
        };
        add_outer(weights.instructions, sums, pre_activation, input);
    }
}

/// A perceptron whose first layer sees no other than its own inputs.
#[derive(Clone, Debug)]
pub(crate) struct WholeMlp {
    mlp: Mlp,
    first: Piece,
}

impl WholeMlp {
    pub(crate) fn new(layout: &mut Layout, mlp: Mlp) -> Self {
        let first = Piece::whole(&mut layout.size, &mlp.first);
        Self { mlp, first }
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        self.mlp.pack(packer);
        self.first.pack(packer);
    }

    /// Makes room for the activations of so many rows.
    pub(crate) fn fit<T: Real>(&self, activations: &mut Activations<T>, rows: usize) {
        self.mlp.fit(activations, rows);
    }

    /// From rows of inputs to `out`. Activations go where they are kept, else to `spare`.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: &[T],
        (kept, spare): (Option<&mut Activations<T>>, &mut Activations<T>),
        out: &mut [T],
    ) {
        let rows = input.len() / self.mlp.first.inputs;
        let mut tile = self.mlp.tile(kept, spare, rows);
        let terms = &[self.first.times(weights, input)];
        self.mlp.first_layer(weights, terms, &mut tile);
        self.mlp.forward(weights, tile, Normalised::Set(out));
    }

    /// As [`Mlp::backward`], and adds the gradient of the first layer's matrix.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, kept): (&[T], &Activations<T>),
        [output, hidden, pre_activation]: [&mut [T]; 3],
        gradient: &mut ModuleGradient<T>,
    ) {
        let through = [output, hidden, &mut *pre_activation];
        self.mlp.backward(weights, kept, through, gradient);
        let first = &self.mlp.first;
        let by_sums = Columns::all(&*pre_activation, first.outputs);
        let input = Columns::all(input, first.inputs);
        self.mlp
            .first_backward(weights, 0, by_sums, input, gradient);
    }

    /// The gradient of the input from that of the sums of the first layer.
    pub(crate) fn input_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        pre_activation: &[T],
        to_input: &mut [T],
    ) {
        let terms = &[self.first.back(weights, pre_activation)];
        let (using, columns) = (weights.instructions, self.mlp.first.inputs);
        multiply(using, terms, columns, Epilogue::Set, to_input);
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
