//! The recurrent encoder: two layers of gated recurrent units over a window of frames, zero
//! initial state, dropout between the layers in training, then Linear and LayerNorm on the last
//! state.
//!
//! A tile's rows pass through the whole window before the next tile begins. Within a tile,
//! everything kept is step-major: `[steps, rows, width]`.

use crate::kernels::{
    GateGradients, Gates, NormRows, add, add_bias, add_column_sums, gru_gates, gru_gates_backward,
    layer_norm, layer_norm_backward,
};
use crate::layers::mlp::{backward_product, forward_product};
use crate::layers::{TILE, resize};
use crate::network::Dropout;
use crate::parameters::{GruLayer, LayerNorm, LayoutBuilder, Linear};
use crate::product::{Matrix, MatrixMut, Store, multiply};
use crate::real::Real;

/// Where the weights of a recurrent encoder lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GruEncoder {
    layers: [GruLayer; 2],
    linear: Linear,
    norm: LayerNorm,
    pub(crate) steps: usize,
}

/// Activations of all rows, tile after tile, kept for the backward pass.
#[derive(Default)]
pub(crate) struct GruRecord<T> {
    /// States of each layer, the zero state first: per tile `[steps + 1, rows, hidden]`.
    pub(crate) states: [Vec<T>; 2],
    /// Gates of each layer: per tile `[steps, rows, 4 hidden]`.
    pub(crate) kept: [Vec<T>; 2],
    /// What the second layer sees: per tile `[steps, rows, hidden]`.
    pub(crate) between: Vec<T>,
    /// Products with the input weights: per tile `[steps, rows, 3 hidden]`.
    pub(crate) from_input: Vec<T>,
    /// Product with the hidden weights: per tile `[rows, 3 hidden]`.
    pub(crate) from_hidden: Vec<T>,
    pub(crate) normal: Vec<T>,
    pub(crate) inverse_deviation: Vec<T>,
}

/// The part of a [`GruRecord`] that belongs to a tile.
pub(crate) struct GruTile<'a, T> {
    pub(crate) states: [&'a mut [T]; 2],
    pub(crate) kept: [&'a mut [T]; 2],
    pub(crate) between: &'a mut [T],
    pub(crate) from_input: &'a mut [T],
    pub(crate) from_hidden: &'a mut [T],
    pub(crate) normal: &'a mut [T],
    pub(crate) inverse_deviation: &'a mut [T],
}

/// Gradients of a tile on their way back.
pub(crate) struct GruScratch<T> {
    input: Vec<T>,
    hidden: Vec<T>,
    between: Vec<T>,
    state: Vec<T>,
}

/// The rows of a tile in the input `[steps, all rows, width]`.
#[derive(Clone, Copy)]
pub(crate) struct InputRows<'a, T> {
    pub(crate) input: &'a [T],
    pub(crate) all_rows: usize,
    pub(crate) first: usize,
    pub(crate) rows: usize,
}

impl<'a, T> InputRows<'a, T> {
    /// The tile's rows at `step`.
    pub(crate) fn at(&self, step: usize, width: usize) -> &'a [T] {
        let start = (step * self.all_rows + self.first) * width;
        &self.input[start..start + self.rows * width]
    }
}

impl<T: Real> GruScratch<T> {
    pub(crate) fn new(encoder: &GruEncoder) -> Self {
        let (steps, hidden) = (encoder.steps, encoder.linear.inputs);
        Self {
            input: vec![T::ZERO; steps * TILE * 3 * hidden],
            hidden: vec![T::ZERO; steps * TILE * 3 * hidden],
            between: vec![T::ZERO; steps * TILE * hidden],
            state: vec![T::ZERO; TILE * hidden],
        }
    }
}

impl<T: Real> GruRecord<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let twice = self.states.iter().chain(&self.kept);
        let once = [
            &self.between,
            &self.from_input,
            &self.from_hidden,
            &self.normal,
            &self.inverse_deviation,
        ];
        twice.chain(once).map(Vec::len).sum()
    }

    /// Makes room for `rows` rows.
    pub(crate) fn fit(&mut self, encoder: &GruEncoder, rows: usize) {
        let (steps, hidden) = (encoder.steps, encoder.linear.inputs);
        for layer in 0..2 {
            resize(&mut self.states[layer], rows * (steps + 1) * hidden);
            resize(&mut self.kept[layer], rows * steps * 4 * hidden);
        }
        resize(&mut self.between, rows * steps * hidden);
        resize(&mut self.from_input, rows * steps * 3 * hidden);
        resize(&mut self.from_hidden, rows * 3 * hidden);
        resize(&mut self.normal, rows * encoder.linear.outputs);
        resize(&mut self.inverse_deviation, rows);
    }

    pub(crate) fn tile(
        &mut self,
        encoder: &GruEncoder,
        rows: &std::ops::Range<usize>,
    ) -> GruTile<'_, T> {
        let (steps, hidden) = (encoder.steps, encoder.linear.inputs);
        let of = |width: usize| rows.start * width..rows.end * width;
        let [states0, states1] = &mut self.states;
        let [kept0, kept1] = &mut self.kept;
        GruTile {
            states: [states0, states1].map(|s| &mut s[of((steps + 1) * hidden)]),
            kept: [kept0, kept1].map(|k| &mut k[of(steps * 4 * hidden)]),
            between: &mut self.between[of(steps * hidden)],
            from_input: &mut self.from_input[of(steps * 3 * hidden)],
            from_hidden: &mut self.from_hidden[of(3 * hidden)],
            normal: &mut self.normal[of(encoder.linear.outputs)],
            inverse_deviation: &mut self.inverse_deviation[rows.clone()],
        }
    }
}

impl GruEncoder {
    pub(crate) fn new(
        layout: &mut LayoutBuilder,
        path: &str,
        [inputs, latent]: [usize; 2],
        steps: usize,
    ) -> Self {
        Self {
            layers: [
                layout.gru_layer(&format!("{path}.gru"), 0, [inputs, latent]),
                layout.gru_layer(&format!("{path}.gru"), 1, [latent, latent]),
            ],
            linear: layout.linear(&format!("{path}.linear"), latent, latent),
            norm: layout.layer_norm(&format!("{path}.norm"), latent),
            steps,
        }
    }

    /// Takes a tile through the window to its latent rows.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: &[T],
        input: InputRows<'_, T>,
        dropout: Option<Dropout>,
        tile: GruTile<'_, T>,
        out: &mut [T],
    ) {
        let [first, second] = &self.layers;
        let (rows, hidden) = (input.rows, first.hidden);
        for step in 0..self.steps {
            let gates = &mut tile.from_input[step * rows * 3 * hidden..][..rows * 3 * hidden];
            input_product(first, weights, input.at(step, first.inputs), gates);
        }
        let [states0, states1] = tile.states;
        let [kept0, kept1] = tile.kept;
        let layer0 = LayerRows {
            states: states0,
            kept: kept0,
        };
        run_layer(first, weights, tile.from_input, tile.from_hidden, layer0);
        tile.between.copy_from_slice(&states0[rows * hidden..]);
        if let Some(dropout) = dropout {
            dropout.apply(tile.between, input.first * self.steps * hidden);
        }
        input_product(second, weights, tile.between, tile.from_input);
        let layer1 = LayerRows {
            states: states1,
            kept: kept1,
        };
        run_layer(second, weights, tile.from_input, tile.from_hidden, layer1);
        let last = &states1[self.steps * rows * hidden..];
        forward_product(&self.linear, weights, last, tile.normal);
        let norm = NormRows {
            normal: tile.normal,
            inverse_deviation: tile.inverse_deviation,
        };
        layer_norm(
            norm,
            &weights[self.linear.bias_range()],
            &weights[self.norm.weight_range()],
            &weights[self.norm.bias_range()],
            out,
        );
    }

    /// Adds the gradients of all weights for the gradient of a tile's latent rows, which is
    /// overwritten.
    pub(crate) fn backward<T: Real>(
        &self,
        (weights, gradient): (&[T], &mut [T]),
        input: InputRows<'_, T>,
        dropout: Option<Dropout>,
        (tile, scratch): (&GruTile<'_, T>, &mut GruScratch<T>),
        output: &mut [T],
    ) {
        let [first, second] = &self.layers;
        let (rows, hidden, steps) = (input.rows, first.hidden, self.steps);
        let norm = &self.norm;
        let (dw, ds) = gradient[norm.weight..norm.weight + 2 * norm.width].split_at_mut(norm.width);
        let kept = (&*tile.normal, &*tile.inverse_deviation);
        layer_norm_backward(output, kept, &weights[norm.weight_range()], dw, ds);

        let to_input = &mut scratch.input[..steps * rows * 3 * hidden];
        let to_hidden = &mut scratch.hidden[..steps * rows * 3 * hidden];
        let between = &mut scratch.between[..steps * rows * hidden];
        let state = &mut scratch.state[..rows * hidden];
        let last = &tile.states[1][steps * rows * hidden..];
        backward_product(&self.linear, weights, (output, last), gradient, state);
        let from = LayerBack {
            states: tile.states[1],
            kept: tile.kept[1],
            later: None,
        };
        run_layer_backward(
            second,
            (weights, gradient),
            from,
            (state, to_input, to_hidden),
        );
        add_input_gradient(second, gradient, to_input, tile.between);
        multiply(
            MatrixMut::new(between, hidden),
            Store::Replace,
            Matrix::new(to_input, 3 * hidden),
            Matrix::new(&weights[second.weight_ih_range()], hidden),
        );
        if let Some(dropout) = dropout {
            dropout.apply(between, input.first * steps * hidden);
        }
        state.fill(T::ZERO);
        let from = LayerBack {
            states: tile.states[0],
            kept: tile.kept[0],
            later: Some(between),
        };
        run_layer_backward(
            first,
            (weights, gradient),
            from,
            (state, to_input, to_hidden),
        );
        add_column_sums(&mut gradient[first.bias_ih_range()], to_input);
        for step in 0..steps {
            let gates = &to_input[step * rows * 3 * hidden..][..rows * 3 * hidden];
            add_weight_gradient(first, gradient, gates, input.at(step, first.inputs));
        }
    }

    /// The gradient of the input rows of one step of the window, after [`Self::backward`] of a tile
    /// of `rows` rows.
    pub(crate) fn input_backward<T: Real>(
        &self,
        weights: &[T],
        scratch: &GruScratch<T>,
        (step, rows): (usize, usize),
        to_input: &mut [T],
    ) {
        let first = &self.layers[0];
        let gates = rows * 3 * first.hidden;
        multiply(
            MatrixMut::new(to_input, first.inputs),
            Store::Replace,
            Matrix::new(&scratch.input[step * gates..][..gates], 3 * first.hidden),
            Matrix::new(&weights[first.weight_ih_range()], first.inputs),
        );
    }
}

/// out ← input W_ihᵀ + b_ih.
fn input_product<T: Real>(layer: &GruLayer, weights: &[T], input: &[T], out: &mut [T]) {
    multiply(
        MatrixMut::new(out, 3 * layer.hidden),
        Store::Replace,
        Matrix::new(input, layer.inputs),
        Matrix::new(&weights[layer.weight_ih_range()], layer.inputs).transposed(),
    );
    add_bias(out, &weights[layer.bias_ih_range()]);
}

struct LayerRows<'a, T> {
    states: &'a mut [T],
    kept: &'a mut [T],
}

/// Runs one layer over the window, from the zero state.
fn run_layer<T: Real>(
    layer: &GruLayer,
    weights: &[T],
    from_input: &[T],
    from_hidden: &mut [T],
    rows: LayerRows<'_, T>,
) {
    let hidden = layer.hidden;
    let state_size = from_hidden.len() / 3;
    rows.states[..state_size].fill(T::ZERO);
    let weight = Matrix::new(&weights[layer.weight_hh_range()], hidden).transposed();
    let steps = from_input
        .chunks_exact(3 * state_size)
        .zip(rows.kept.chunks_exact_mut(4 * state_size));
    for (step, (from_input, kept)) in steps.enumerate() {
        let (before, after) = rows.states.split_at_mut((step + 1) * state_size);
        let before = &before[step * state_size..];
        multiply(
            MatrixMut::new(from_hidden, 3 * hidden),
            Store::Replace,
            Matrix::new(before, hidden),
            weight,
        );
        let gates = Gates {
            from_input,
            from_hidden,
            bias_hidden: &weights[layer.bias_hh_range()],
            before,
            kept,
            after: &mut after[..state_size],
        };
        gru_gates(gates, hidden);
    }
}

struct LayerBack<'a, T> {
    states: &'a [T],
    kept: &'a [T],
    /// Gradients that reach the states from above, `[steps, rows, hidden]`.
    later: Option<&'a [T]>,
}

/// Backpropagation through time of one layer: leaves the gradients of the gates' input and hidden
/// parts in `to_input` and `to_hidden`, adds those of the hidden weights.
fn run_layer_backward<T: Real>(
    layer: &GruLayer,
    (weights, gradient): (&[T], &mut [T]),
    from: LayerBack<'_, T>,
    (state, to_input, to_hidden): (&mut [T], &mut [T], &mut [T]),
) {
    let (hidden, size) = (layer.hidden, state.len());
    let steps = to_input.len() / (3 * size);
    for step in (0..steps).rev() {
        if let Some(later) = from.later {
            add(state, &later[step * size..][..size]);
        }
        let to_hidden = &mut to_hidden[step * 3 * size..][..3 * size];
        let gates = GateGradients {
            kept: &from.kept[step * 4 * size..][..4 * size],
            before: &from.states[step * size..][..size],
            state,
            input: &mut to_input[step * 3 * size..][..3 * size],
            hidden: to_hidden,
        };
        gru_gates_backward(gates, hidden);
        multiply(
            MatrixMut::new(state, hidden),
            Store::Add,
            Matrix::new(to_hidden, 3 * hidden),
            Matrix::new(&weights[layer.weight_hh_range()], hidden),
        );
    }
    add_column_sums(&mut gradient[layer.bias_hh_range()], to_hidden);
    multiply(
        MatrixMut::new(&mut gradient[layer.weight_hh_range()], hidden),
        Store::Add,
        Matrix::new(to_hidden, 3 * hidden).transposed(),
        Matrix::new(&from.states[..steps * size], hidden),
    );
}

fn add_input_gradient<T: Real>(layer: &GruLayer, gradient: &mut [T], gates: &[T], input: &[T]) {
    add_column_sums(&mut gradient[layer.bias_ih_range()], gates);
    add_weight_gradient(layer, gradient, gates, input);
}

fn add_weight_gradient<T: Real>(layer: &GruLayer, gradient: &mut [T], gates: &[T], input: &[T]) {
    multiply(
        MatrixMut::new(&mut gradient[layer.weight_ih_range()], layer.inputs),
        Store::Add,
        Matrix::new(gates, 3 * layer.hidden).transposed(),
        Matrix::new(input, layer.inputs),
    );
}
