//! The recurrent encoder: two layers of gated recurrent units over a window of frames, zero initial
//! state, dropout between the layers in training, then Linear and LayerNorm on the last state.
//!
//! A chunk's rows pass through the whole window, both layers step by step, before the next chunk
//! begins. Within a chunk all kept rows are step-major: `[steps, rows, width]`.

use std::ops::Range;

use crate::kernels::gates::{GateGradients, GruStep, gru_step, pack_biases, pack_gates};
use crate::kernels::gemm::{Columns, Epilogue, Slot, Term, multiply};
use crate::kernels::norm::{Normalised, layer_norm};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::rows::{add, add_column_sums};
use crate::kernels::simd::MOST_LANES;
use crate::network::kept::{Group, GruKept, ModuleGradient, Scratch};
use crate::network::layers::encoder::EncoderInput;
use crate::network::packed::{LayerWeights, Packer, Piece};
use crate::network::parameters::{LayerNorm, Layout, Linear, Start};

/// Places of the weights of a recurrent encoder.
#[derive(Clone, Debug)]
pub(crate) struct GruEncoder {
    layers: [Layer; 2],
    linear: Linear,
    output: Piece,
    norm: LayerNorm,
}

/// One layer of recurrent units: places of its weights, gates in the order r, z, n, and of their
/// packed matrices.
#[derive(Clone, Debug)]
struct Layer {
    inputs: usize,
    hidden: usize,
    weight_ih: Range<usize>,
    weight_hh: Range<usize>,
    bias_ih: Range<usize>,
    bias_hh: Range<usize>,
    /// Matrices of the forward pass.
    gates: Slot,
    /// Biases of the forward pass.
    biases: Slot,
    /// From the gradients of n, r, z to that of the input.
    to_input: Slot,
    /// From the gradients of r, z, recurrent to that of the state.
    to_state: Slot,
}

impl<T: Real> GruKept<T> {
    /// Makes room for a chunk of which nothing is kept: two states of each layer, no gates.
    pub(crate) fn fit_spare(&mut self, rows: usize, hidden: usize) {
        for states in &mut self.states {
            states.resize(2 * rows * hidden);
        }
        let [normal, deviations] = &mut self.norm;
        normal.resize(rows * hidden);
        deviations.resize(rows);
    }
}

impl GruEncoder {
    pub(crate) fn new(layout: &mut Layout, path: &str, inputs: usize, latent: usize) -> Self {
        let gru = format!("{path}.gru");
        let first = Layer::new(layout, &gru, 0, inputs, latent);
        let second = Layer::new(layout, &gru, 1, latent, latent);
        let linear = layout.linear(&format!("{path}.linear"), latent, latent);
        Self {
            layers: [first, second],
            output: Piece::whole(&mut layout.size, &linear),
            linear,
            norm: layout.layer_norm(&format!("{path}.norm"), latent),
        }
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        for layer in &self.layers {
            layer.pack(packer);
        }
        self.output.pack(packer);
    }

    /// Makes room for what is kept of `rows` rows.
    pub(crate) fn fit<T: Real>(
        &self,
        kept: &mut GruKept<T>,
        rows: usize,
        steps: usize,
        dropout: bool,
    ) {
        let size = rows * self.linear.inputs;
        for (states, gates) in kept.states.iter_mut().zip(&mut kept.gates) {
            states.resize((steps + 1) * size);
            gates.resize(steps * 4 * size);
        }
        kept.between.resize(usize::from(dropout) * steps * size);
        let [normal, deviations] = &mut kept.norm;
        normal.resize(size);
        deviations.resize(rows);
    }

    /// Takes a chunk through the window to its latent rows `out`.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        chunk: &Range<usize>,
        (out, kept): (&mut [T], Option<&mut GruKept<T>>),
        scratch: &mut Scratch<T>,
    ) {
        let (hidden, using) = (self.linear.inputs, weights.instructions);
        let (size, keeps) = (chunk.len() * hidden, kept.is_some());
        let GruKept {
            states: [states0, states1],
            gates: [gates0, gates1],
            between,
            norm: [normal, deviations],
        } = kept.unwrap_or(&mut scratch.gru);
        states0[..size].fill(T::ZERO);
        states1[..size].fill(T::ZERO);
        let [first, second] = &self.layers;
        for step in 0..input.window {
            let some = step > 0;
            let gates = step * 4 * size..(step + 1) * 4 * size;
            let (before, after) = around(states0, size, step, keeps);
            let to = gates0.get_mut(gates.clone()).unwrap_or_default();
            let x = input.at(step, chunk);
            first.step(weights, x, some.then_some(before), after, to);
            let mut seen = &*after;
            if let Some(dropout) = input.dropout {
                let between = &mut between[step * size..][..size];
                between.copy_from_slice(after);
                dropout.apply(between, chunk.clone(), step);
                seen = between;
            }
            let (before, after) = around(states1, size, step, keeps);
            let to = gates1.get_mut(gates).unwrap_or_default();
            second.step(weights, seen, some.then_some(before), after, to);
        }
        let last = if keeps { input.window * size } else { input.window % 2 * size };
        let epilogue = Epilogue::Bias(weights.at(&self.linear.bias));
        let term = self.output.times(weights, &states1[last..][..size]);
        let norm = [&mut normal[..size], &mut deviations[..chunk.len()]];
        multiply(using, &[term], hidden, epilogue, norm[0]);
        let (weight, shift) = (weights.at(&self.norm.weight), weights.at(&self.norm.bias));
        layer_norm(using, norm, weight, shift, Normalised::Set(out));
    }

    /// Adds the gradients of all weights for the gradient `output` of a chunk's latent rows, which
    /// is overwritten. Sets those of the input in each frame, where they are wanted.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, kept): (EncoderInput<'_, T>, &GruKept<T>),
        chunk: &Range<usize>,
        (output, mut to_input): (&mut [T], Vec<&mut [T]>),
        group: &mut Group<T>,
    ) {
        let (steps, using) = (input.window, weights.instructions);
        let hidden = self.linear.inputs;
        let size = chunk.len() * hidden;
        let ([states0, states1], [gates0, gates1]) = (&kept.states, &kept.gates);
        let Group { scratch, gradient } = group;
        let [_, by_seen, ..] = &mut scratch.tiles;
        let states = scratch.gru.states.each_mut();
        let [state0, state1] = states.map(|state| &mut state[..size]);
        let (by_seen, gates) = (&mut by_seen[..size], &mut scratch.gates[..4 * size]);
        let [biases0, biases1] = &mut scratch.biases;
        // From the gradient of the latent rows to that of the second layer's last state.
        let [normal, deviations] = &kept.norm;
        let norm = [&**normal, deviations];
        self.norm.backward(weights, output, norm, gradient);
        gradient.add_linear(using, &self.linear, output, &states1[steps * size..]);
        let term = self.output.back(weights, output);
        multiply(using, &[term], hidden, Epilogue::Set, state1);
        state0.fill(T::ZERO);
        biases0.fill(T::ZERO);
        biases1.fill(T::ZERO);
        let [first, second] = &self.layers;
        for step in (0..steps).rev() {
            let seen = match input.dropout {
                Some(_) => &kept.between[step * size..][..size],
                None => &states0[(step + 1) * size..][..size],
            };
            let taken = GateGradients {
                hidden,
                kept: &gates1[step * 4 * size..][..4 * size],
                before: &states1[step * size..][..size],
                state: &mut *state1,
                sums: &mut *gates,
            };
            second.step_backward(weights, seen, taken, biases1, gradient);
            second.input_backward(weights, gates, by_seen);
            if let Some(dropout) = input.dropout {
                dropout.apply(by_seen, chunk.clone(), step);
            }
            add(using, state0, by_seen);
            let taken = GateGradients {
                hidden,
                kept: &gates0[step * 4 * size..][..4 * size],
                before: &states0[step * size..][..size],
                state: &mut *state0,
                sums: &mut *gates,
            };
            let x = input.at(step, chunk);
            first.step_backward(weights, x, taken, biases0, gradient);
            if let Some(to_input) = to_input.get_mut(step) {
                first.input_backward(weights, gates, to_input);
            }
        }
        for (layer, biases) in self.layers.iter().zip([biases0, biases1]) {
            layer.biases_backward(biases, gradient);
        }
    }
}

/// The state before a step and the room for that after it: one after the other where states are
/// kept, else two that take turns.
fn around<T>(states: &mut [T], size: usize, step: usize, keeps: bool) -> (&[T], &mut [T]) {
    let first = if keeps { step * size } else { 0 };
    let (before, after) = states[first..][..2 * size].split_at_mut(size);
    if keeps || step.is_multiple_of(2) { (before, after) } else { (after, before) }
}

impl Layer {
    /// Lays out layer `number` of the recurrent network `path` as PyTorch starts it: uniform in
    /// ±1/√hidden.
    fn new(layout: &mut Layout, path: &str, number: usize, inputs: usize, hidden: usize) -> Self {
        let start = Start::Uniform {
            bound: (hidden as f64).sqrt().recip(),
        };
        let padded = hidden.next_multiple_of(MOST_LANES);
        let mut add = |name: &str, shape: &[usize]| {
            layout.add(format!("{path}.{name}_l{number}"), shape, start)
        };
        Self {
            inputs,
            hidden,
            weight_ih: add("weight_ih", &[3 * hidden, inputs]),
            weight_hh: add("weight_hh", &[3 * hidden, hidden]),
            bias_ih: add("bias_ih", &[3 * hidden]),
            bias_hh: add("bias_hh", &[3 * hidden]),
            gates: layout.size.forward(inputs + hidden, 3 * padded),
            biases: layout.size.forward(1, 4 * padded),
            to_input: layout.size.backward(3 * hidden, inputs),
            to_state: layout.size.backward(3 * hidden, hidden),
        }
    }

    /// Packs the matrices of both passes and the biases.
    fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        let (flat, using) = (packer.flat, packer.instructions);
        let (inputs, hidden) = (self.inputs, self.hidden);
        let [of_input, of_state, input_bias, state_bias] = [
            &self.weight_ih,
            &self.weight_hh,
            &self.bias_ih,
            &self.bias_hh,
        ]
        .map(|place| &flat[place.clone()]);
        let matrices = [(of_input, inputs), (of_state, hidden)];
        pack_gates(using, matrices, packer.room(self.gates));
        pack_biases(using, [input_bias, state_bias], packer.room(self.biases));
        // Rows of the weights are of r, z, n; gradients of n, r, z reach the input.
        packer.backward(self.to_input, |l, j| {
            let row = (l + 2 * hidden) % (3 * hidden);
            of_input[row * inputs + j]
        });
        packer.backward(self.to_state, |l, j| of_state[l * hidden + j]);
    }

    /// From the input and the state before to the state after. Keeps the gates unless `gates` is
    /// empty.
    fn step<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: &[T],
        before: Option<&[T]>,
        after: &mut [T],
        gates: &mut [T],
    ) {
        let step = GruStep {
            input,
            inputs: self.inputs,
            before,
            packed: self.gates.of(&weights.module.forward),
            biases: self.biases.of(&weights.module.forward),
            hidden: self.hidden,
            after,
            kept: gates,
        };
        gru_step(weights.instructions, step);
    }

    /// Takes the gradient of the state after a step on `input` `[rows, inputs]` back to that of the
    /// state before. Adds the gradients of the matrices, and to `biases` the sums of the columns of
    /// the gradients of the gates, `[4 hidden]`.
    fn step_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: &[T],
        step: GateGradients<'_, T>,
        biases: &mut [T],
        gradient: &mut ModuleGradient<T>,
    ) {
        let (inputs, hidden, using) = (self.inputs, self.hidden, weights.instructions);
        let before = step.before;
        let (state, gates) = (step.state, step.sums);
        using.run(GateGradients {
            state: &mut *state,
            sums: &mut *gates,
            ..step
        });
        add_column_sums(using, biases, gates);
        let all = Columns::all(&*gates, 4 * hidden);
        let columns = |first: usize, count: usize| all.part(first * hidden, count * hidden);
        let of_state = columns(1, 3);
        let term = Term {
            rows: of_state,
            packed: self.to_state.of(&weights.module.backward),
        };
        multiply(using, &[term], hidden, Epilogue::Add, state);
        let outer = |rows: &mut [T], gates, right, stride| {
            let first = 0;
            let sums = Sums {
                rows,
                stride,
                first,
            };
            add_outer(using, sums, gates, Columns::all(right, stride));
        };
        outer(gradient.at(&self.weight_hh), of_state, before, hidden);
        let weight = gradient.at(&self.weight_ih);
        let (of_reset_and_update, of_new) = weight.split_at_mut(2 * hidden * inputs);
        outer(of_reset_and_update, columns(1, 2), input, inputs);
        outer(of_new, columns(0, 1), input, inputs);
    }

    /// The gradient of the input of a step from those of the sums.
    fn input_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        gates: &[T],
        to_input: &mut [T],
    ) {
        let term = Term {
            rows: Columns::all(gates, 4 * self.hidden).part(0, 3 * self.hidden),
            packed: self.to_input.of(&weights.module.backward),
        };
        let using = weights.instructions;
        multiply(using, &[term], self.inputs, Epilogue::Set, to_input);
    }

    /// Adds the gradients of the biases from the sums over all steps of the gradients of the gates.
    fn biases_backward<T: Real>(&self, sums: &[T], gradient: &mut ModuleGradient<T>) {
        let hidden = self.hidden;
        let (new, others) = sums[..4 * hidden].split_at(hidden);
        let both = [(&self.bias_ih, new), (&self.bias_hh, &others[2 * hidden..])];
        for (place, candidate) in both {
            let from = others[..2 * hidden].iter().chain(candidate);
            for (to, &x) in gradient.at(place).iter_mut().zip(from) {
                *to += x;
            }
        }
    }
}
