//! The recurrent encoder: two layers of gated recurrent units over a window of frames, zero initial
//! state unless one is carried over, dropout between the layers in training, then Linear and
//! LayerNorm on the last state.
//!
//! A chunk's rows pass through the whole window, both layers step by step, before the next chunk
//! begins. Within a chunk all kept rows are step-major: `[steps, rows, width]`.

use std::ops::Range;

use crate::graph::share::{Rows, split_rows};
use crate::kernels::aligned::Aligned;
use crate::kernels::dropout::RowMasks;
use crate::kernels::gemm::{Epilogue, multiply};
use crate::kernels::norm::{NormKept, NormRows, Normalised, layer_norm, layer_norm_backward};
use crate::kernels::real::Real;
use crate::kernels::rows::add;
use crate::network::layers::gru_layer::{Layer, StepGradients, StepKept};
use crate::network::layers::scratch::{GroupScratch, GroupWork, Scratch};
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer, Piece};
use crate::network::parameters::{LayerNorm, Linear};

/// Places of the weights of a recurrent encoder.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GruEncoder {
    layers: [Layer; 2],
    linear: Linear,
    output: Piece,
    norm: LayerNorm,
}

/// Activations of all rows, chunk after chunk, kept for the backward pass.
#[derive(Default)]
pub(crate) struct GruRecord<T> {
    /// Frames of the window.
    steps: usize,
    /// States of each layer, the initial one first: per chunk `[steps + 1, rows, hidden]`.
    pub(crate) states: [Aligned<T>; 2],
    /// Gates of each layer in the order of [`crate::Gate::KEPT`]: per chunk `[steps, rows, 4
    /// hidden]`.
    gates: [Aligned<T>; 2],
    /// Input of the second layer where dropout makes it differ from the first layer's states: per
    /// chunk `[steps, rows, hidden]`.
    between: Aligned<T>,
    normal: Aligned<T>,
    inverse_deviation: Aligned<T>,
}

split_rows! {
    /// Rows of a [`GruRecord`]; empty where nothing is kept.
    pub(crate) struct GruRecordRows<'a, T> {
        states: [Rows<'a, T>; 2],
        gates: [Rows<'a, T>; 2],
        between: Rows<'a, T>,
        normal: Rows<'a, T>,
        inverse_deviation: Rows<'a, T>,
    }
}

/// The rows of a chunk in the input of an encoder.
#[derive(Clone, Copy)]
pub(crate) struct GruInput<'a, T> {
    /// `[steps, all rows, width]`.
    pub(crate) features: &'a [T],
    pub(crate) all_rows: usize,
    pub(crate) steps: usize,
    /// First row of the chunk.
    pub(crate) first: usize,
    /// Rows of the chunk.
    pub(crate) rows: usize,
    pub(crate) dropout: Option<&'a RowMasks>,
}

impl<'a, T> GruInput<'a, T> {
    /// The chunk's rows at `step`.
    fn at(&self, step: usize, width: usize) -> &'a [T] {
        let start = (step * self.all_rows + self.first) * width;
        &self.features[start..start + self.rows * width]
    }

    /// The chunk's rows in an array of all rows of `width` numbers.
    fn of_chunk(&self, width: usize) -> Range<usize> {
        self.first * width..(self.first + self.rows) * width
    }

    /// The chunk's rows among all rows.
    fn range(&self) -> Range<usize> {
        self.first..self.first + self.rows
    }
}

/// One array for each layer: states `[rows, hidden]`, or nothing for the zero state.
pub(crate) type States<S> = [S; 2];

/// Rows of a chunk that are written.
pub(crate) struct GruRows<'a, T> {
    /// `[rows, latent]`.
    pub(crate) out: &'a mut [T],
    /// States at the end; empty where not wanted.
    pub(crate) end: States<&'a mut [T]>,
    pub(crate) record: GruRecordRows<'a, T>,
}

/// Gradients of a chunk at both ends of the encoder.
pub(crate) struct GruGradients<'a, T> {
    /// In: with respect to the output, `[rows, latent]`; overwritten.
    pub(crate) output: &'a mut [T],
    /// Out: with respect to the input, `[rows, steps width]`; empty where not wanted.
    pub(crate) input: &'a mut [T],
    /// In: with respect to the states at the end; empty for zero.
    pub(crate) end: States<&'a [T]>,
    /// Out: with respect to the carried states; empty where not wanted.
    pub(crate) start: States<&'a mut [T]>,
}

impl<T: Real> GruRecord<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let twice = self.states.iter().chain(&self.gates);
        let once = [&self.between, &self.normal, &self.inverse_deviation];
        twice.chain(once).map(|array| array.len()).sum()
    }

    /// Makes room for `rows` rows.
    pub(crate) fn fit(
        &mut self,
        encoder: &GruEncoder,
        rows: usize,
        steps: usize,
        dropout: Option<&RowMasks>,
    ) {
        let hidden = encoder.linear.inputs;
        self.steps = steps;
        for layer in 0..2 {
            self.states[layer].resize(rows * (steps + 1) * hidden);
            self.gates[layer].resize(rows * steps * 4 * hidden);
        }
        let between = if dropout.is_some() { steps } else { 0 };
        self.between.resize(rows * between * hidden);
        self.normal.resize(rows * encoder.linear.outputs);
        self.inverse_deviation.resize(rows);
    }

    /// All rows, to be written.
    pub(crate) fn rows(&mut self, encoder: &GruEncoder) -> GruRecordRows<'_, T> {
        let (steps, hidden) = (self.steps, encoder.linear.inputs);
        let states = self.states.each_mut();
        let gates = self.gates.each_mut();
        GruRecordRows {
            states: states.map(|array| Rows::new(array, (steps + 1) * hidden)),
            gates: gates.map(|array| Rows::new(array, steps * 4 * hidden)),
            between: Rows::new(&mut self.between, steps * hidden),
            normal: Rows::new(&mut self.normal, encoder.linear.outputs),
            inverse_deviation: Rows::new(&mut self.inverse_deviation, 1),
        }
    }
}

impl GruEncoder {
    pub(crate) fn new(
        module: &mut ModuleBuilder,
        path: &str,
        inputs: usize,
        latent: usize,
    ) -> Self {
        let gru = format!("{path}.gru");
        let first = Layer::new(module, &gru, 0, inputs, latent);
        let second = Layer::new(module, &gru, 1, latent, latent);
        let layout = &mut module.layout;
        let linear = layout.linear(&format!("{path}.linear"), latent, latent);
        Self {
            layers: [first, second],
            linear,
            output: Piece::whole(&mut module.size, &linear),
            norm: layout.layer_norm(&format!("{path}.norm"), latent),
        }
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for layer in &self.layers {
            layer.pack(packer);
        }
        self.output.pack(packer);
    }

    /// Takes a chunk through the window to its latent rows.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: GruInput<'_, T>,
        start: States<&[T]>,
        rows: GruRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let (hidden, using) = (self.linear.inputs, weights.instructions);
        let record = rows.record;
        let keeps = !record.states[0].is_empty();
        let norm = if keeps {
            NormRows {
                normal: record.normal.values,
                inverse_deviation: record.inverse_deviation.values,
            }
        } else {
            scratch.tiles.norm_rows(input.rows, hidden)
        };
        let last = if keeps {
            let kept = KeptWindow {
                states: record.states.map(|rows| rows.values),
                gates: record.gates.map(|rows| rows.values),
                between: record.between.values,
            };
            self.run_kept(weights, input, start, kept)
        } else {
            let size = input.rows * hidden;
            let states = scratch.states.each_mut().map(|layer| {
                let [before, after] = layer.each_mut().map(|buffer| &mut buffer[..size]);
                Buffers { before, after }
            });
            self.run(weights, input, start, states)
        };
        for (end, last) in rows.end.into_iter().zip(last) {
            if !end.is_empty() {
                end.copy_from_slice(last);
            }
        }
        let epilogue = Epilogue::Bias(&weights.flat[self.linear.bias_range()]);
        let term = self.output.times(weights, last[1]);
        multiply(
            using,
            &[term],
            self.linear.outputs,
            epilogue,
            &mut *norm.normal,
        );
        let (weight, shift) = (self.norm.weight_range(), self.norm.bias_range());
        let (weight, shift) = (&weights.flat[weight], &weights.flat[shift]);
        layer_norm(using, norm, weight, shift, Normalised::Set(rows.out));
    }

    /// Takes the window without keeping anything. Returns the last states.
    fn run<'a, T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: GruInput<'_, T>,
        start: States<&'a [T]>,
        states: States<Buffers<'a, T>>,
    ) -> States<&'a [T]> {
        let [first, second] = &self.layers;
        let [mut states0, mut states1] = states;
        let carried = start[0].len() == states0.before.len();
        if carried {
            states0.before.copy_from_slice(start[0]);
            states1.before.copy_from_slice(start[1]);
        }
        for step in 0..input.steps {
            let some = step > 0 || carried;
            let x = input.at(step, first.weights.inputs);
            let before = some.then_some(&*states0.before);
            first.step(weights, x, before, states0.after, &mut []);
            let before = some.then_some(&*states1.before);
            second.step(weights, states0.after, before, states1.after, &mut []);
            states0.swap();
            states1.swap();
        }
        [states0.before, states1.before]
    }

    /// Takes the window and keeps states and gates. Returns the last states.
    fn run_kept<'a, T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: GruInput<'_, T>,
        start: States<&[T]>,
        kept: KeptWindow<'a, T>,
    ) -> States<&'a [T]> {
        let [first, second] = &self.layers;
        let hidden = self.linear.inputs;
        let size = input.rows * hidden;
        let KeptWindow {
            states: [states0, states1],
            gates: [gates0, gates1],
            between,
        } = kept;
        let carried = start[0].len() == size;
        for (states, start) in [&mut *states0, &mut *states1].into_iter().zip(start) {
            if carried {
                states[..size].copy_from_slice(start);
            } else {
                states[..size].fill(T::ZERO);
            }
        }
        for step in 0..input.steps {
            let some = step > 0 || carried;
            let (before, after) = states0[step * size..][..2 * size].split_at_mut(size);
            let x = input.at(step, first.weights.inputs);
            let gates = &mut gates0[step * 4 * size..][..4 * size];
            first.step(weights, x, some.then_some(&*before), after, gates);
            let mut seen = &*after;
            if let Some(dropout) = input.dropout {
                let between = &mut between[step * size..][..size];
                between.copy_from_slice(after);
                dropout.apply(between, input.range(), step);
                seen = between;
            }
            let (before, after) = states1[step * size..][..2 * size].split_at_mut(size);
            let gates = &mut gates1[step * 4 * size..][..4 * size];
            second.step(weights, seen, some.then_some(&*before), after, gates);
        }
        let last = input.steps * size;
        [&states0[last..], &states1[last..]]
    }

    /// Adds the gradients of all weights for the gradient of a chunk's latent rows.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: GruInput<'_, T>,
        record: &GruRecord<T>,
        gradients: GruGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let steps = input.steps;
        let (size, using) = (input.rows * self.linear.inputs, weights.instructions);
        let window = KeptChunk::of(record, &input, self.linear.inputs);
        self.output_backward(weights, &window, gradients.output, group);
        let [state0, state1] = group.scratch.states.each_mut().map(|s| &mut s[..size]);
        state0.fill(T::ZERO);
        for (state, end) in [state0, state1].into_iter().zip(gradients.end) {
            if !end.is_empty() {
                add(using, state, end);
            }
        }
        for biases in &mut group.scratch.biases {
            biases.fill(T::ZERO);
        }
        let width = self.layers[0].weights.inputs;
        for step in (0..steps).rev() {
            self.both_backward(weights, input, &window, step, group);
            if !gradients.input.is_empty() {
                let scratch = &mut *group.scratch;
                let x = &mut scratch.joined[..input.rows * width];
                self.layers[0].input_backward(weights, &scratch.gates[..4 * size], x);
                let to = gradients.input.chunks_exact_mut(steps * width);
                for (to, x) in to.zip(x.chunks_exact(width)) {
                    to[step * width..(step + 1) * width].copy_from_slice(x);
                }
            }
        }
        let GroupScratch { states, biases, .. } = &*group.scratch;
        for (to, state) in gradients.start.into_iter().zip(states) {
            if !to.is_empty() {
                to.copy_from_slice(&state[..size]);
            }
        }
        for (layer, biases) in self.layers.iter().zip(biases) {
            layer.biases_backward(biases, &mut group.gradient);
        }
    }

    /// From the gradient of the latent rows to that of the second layer's last state, left in the
    /// scratch.
    fn output_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        window: &KeptChunk<'_, T>,
        output: &mut [T],
        group: &mut GroupWork<'_, T>,
    ) {
        let (hidden, using) = (self.linear.inputs, weights.instructions);
        let gradient = &mut group.gradient;
        let weight = &weights.flat[self.norm.weight_range()];
        let of_norm = gradient.layer_norm(&self.norm);
        layer_norm_backward(using, output, window.norm, weight, of_norm);
        let last = &window.states[1][window.states[1].len() - output.len()..];
        gradient.add_linear(using, &self.linear, output, last);
        let term = self.output.back(weights, output);
        let state = &mut group.scratch.states[1][..output.len()];
        multiply(using, &[term], hidden, Epilogue::Set, state);
    }

    /// Takes the gradients of both states back through a step; leaves the gradients of the first
    /// layer's gates in the scratch.
    fn both_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: GruInput<'_, T>,
        window: &KeptChunk<'_, T>,
        step: usize,
        group: &mut GroupWork<'_, T>,
    ) {
        let hidden = self.linear.inputs;
        let size = input.rows * hidden;
        let [first, second] = &self.layers;
        let (scratch, gradient) = (&mut *group.scratch, &mut group.gradient);
        let gates = &mut scratch.gates[..4 * size];
        let [state0, state1] = scratch.states.each_mut().map(|s| &mut s[..size]);
        let [biases0, biases1] = &mut scratch.biases;
        let seen = match input.dropout {
            Some(_) => &window.between[step * size..][..size],
            None => &window.states[0][(step + 1) * size..][..size],
        };
        let gradients = StepGradients {
            state: state1,
            gates: &mut *gates,
            biases: biases1,
        };
        second.step_backward(weights, window.step(1, step, seen), gradients, gradient);
        let between = &mut scratch.hidden[..size];
        second.input_backward(weights, gates, between);
        if let Some(dropout) = input.dropout {
            dropout.apply(between, input.range(), step);
        }
        add(weights.instructions, state0, between);
        let x = input.at(step, first.weights.inputs);
        let gradients = StepGradients {
            state: state0,
            gates,
            biases: biases0,
        };
        first.step_backward(weights, window.step(0, step, x), gradients, gradient);
    }
}

/// Room for the states of one layer before and after a step.
struct Buffers<'a, T> {
    before: &'a mut [T],
    after: &'a mut [T],
}

impl<T> Buffers<'_, T> {
    fn swap(&mut self) {
        std::mem::swap(&mut self.before, &mut self.after);
    }
}

/// Rows of a chunk's window that a forward pass keeps, as [`GruRecord`] has them.
struct KeptWindow<'a, T> {
    states: States<&'a mut [T]>,
    gates: [&'a mut [T]; 2],
    between: &'a mut [T],
}

/// Rows of a chunk that a forward pass kept, as [`GruRecord`] has them.
struct KeptChunk<'a, T> {
    states: States<&'a [T]>,
    gates: [&'a [T]; 2],
    between: &'a [T],
    norm: NormKept<'a, T>,
    /// Numbers in a state of the chunk, rows · hidden.
    size: usize,
}

impl<'a, T> KeptChunk<'a, T> {
    fn of(record: &'a GruRecord<T>, input: &GruInput<'_, T>, hidden: usize) -> Self {
        let steps = input.steps;
        let of = |width: usize| input.of_chunk(width);
        let (states, gates) = (record.states.each_ref(), record.gates.each_ref());
        Self {
            states: states.map(|states| &states[of((steps + 1) * hidden)]),
            gates: gates.map(|gates| &gates[of(steps * 4 * hidden)]),
            between: match input.dropout {
                Some(_) => &record.between[of(steps * hidden)],
                None => &[],
            },
            norm: NormKept {
                normal: &record.normal[of(hidden)],
                inverse_deviation: &record.inverse_deviation[of(1)],
            },
            size: input.rows * hidden,
        }
    }

    /// A step of one layer whose input was `input`.
    fn step(&self, layer: usize, step: usize, input: &'a [T]) -> StepKept<'a, T> {
        StepKept {
            input,
            before: &self.states[layer][step * self.size..][..self.size],
            gates: &self.gates[layer][step * 4 * self.size..][..4 * self.size],
        }
    }
}
