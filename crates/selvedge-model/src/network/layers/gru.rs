//! The recurrent encoder: two layers of gated recurrent units over a window of frames, zero initial
//! state, dropout between the layers in training, then Linear and LayerNorm on the last state.
//!
//! A chunk's rows pass through the whole window, both layers step by step, before the next chunk
//! begins. Within a chunk all kept rows are step-major: `[steps, rows, width]`.

use std::ops::Range;

use crate::kernels::gemm::{Epilogue, multiply};
use crate::kernels::norm::{Normalised, layer_norm, layer_norm_backward};
use crate::kernels::real::Real;
use crate::kernels::rows::add;
use crate::network::layers::encoder::{
    EncoderGradients, EncoderInput, EncoderKept, EncoderRows, KEPT,
};
use crate::network::layers::gru_layer::{Layer, StepBack};
use crate::network::layers::scratch::{GroupWork, Scratch};
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

    /// Numbers that are kept of a row, chunk after chunk: the states of each layer, the initial one
    /// first, `[steps + 1, rows, hidden]`; its gates, `[steps, rows, 4 hidden]`; the input of the second layer where dropout makes it differ from
    /// the first layer's states, `[steps, rows, hidden]`; the normalised output, 1 / its deviation.
    pub(crate) fn widths(&self, steps: usize, dropout: bool) -> [usize; KEPT] {
        let hidden = self.linear.inputs;
        let (states, gates) = ((steps + 1) * hidden, steps * 4 * hidden);
        let between = usize::from(dropout) * steps * hidden;
        [
            states,
            states,
            gates,
            gates,
            between,
            self.linear.outputs,
            1,
        ]
    }

    /// Takes a chunk through the window to its latent rows.
    pub(crate) fn forward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: EncoderInput<'_, T>,
        chunk: &Range<usize>,
        (out, kept): EncoderRows<'_, T>,
        scratch: &mut Scratch<T>,
    ) {
        let (hidden, using) = (self.linear.inputs, weights.instructions);
        let size = chunk.len() * hidden;
        let keeps = !kept[0].is_empty();
        let [
            states0,
            states1,
            gates0,
            gates1,
            between,
            normal,
            deviations,
        ] = kept.map(|rows| rows.values);
        let [_, _, spare, spare_deviations] = &mut scratch.tiles;
        let [spare0, spare1] = &mut scratch.states;
        let (states0, states1, norm) = match keeps {
            true => (states0, states1, [normal, deviations]),
            false => {
                let norm = [&mut spare[..size], &mut spare_deviations[..chunk.len()]];
                (&mut spare0[..2 * size], &mut spare1[..2 * size], norm)
            }
        };
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
        let last = size
            * if keeps {
                input.window
            } else {
                input.window % 2
            };
        let epilogue = Epilogue::Bias(&weights.flat[self.linear.bias_range()]);
        let term = self.output.times(weights, &states1[last..][..size]);
        multiply(using, &[term], self.linear.outputs, epilogue, norm[0]);
        let (weight, shift) = (self.norm.weight_range(), self.norm.bias_range());
        let (weight, shift) = (&weights.flat[weight], &weights.flat[shift]);
        layer_norm(using, norm, weight, shift, Normalised::Set(out.values));
    }

    /// Adds the gradients of all weights for the gradient of a chunk's latent rows.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, saved): EncoderKept<'_, T>,
        chunk: &Range<usize>,
        (output, to_input): EncoderGradients<'_, T>,
        group: &mut GroupWork<'_, T>,
    ) {
        let (steps, using) = (input.window, weights.instructions);
        let (hidden, width) = (self.linear.inputs, input.width);
        let size = chunk.len() * hidden;
        let [
            states0,
            states1,
            gates0,
            gates1,
            between,
            normal,
            deviations,
        ] = saved.at(chunk);
        let norm = [normal, deviations];
        let gradient = &mut group.gradient;
        let Scratch {
            tiles: [_, by_seen, ..],
            input: by_x,
            states: [state0, state1],
            gates,
            biases: [biases0, biases1],
            ..
        } = &mut *group.scratch;
        let (state0, state1) = (&mut state0[..size], &mut state1[..size]);
        let (by_seen, gates) = (&mut by_seen[..size], &mut gates[..4 * size]);
        // From the gradient of the latent rows to that of the second layer's last state.
        let output = output.values;
        let weight = &weights.flat[self.norm.weight_range()];
        layer_norm_backward(using, output, norm, weight, gradient.layer_norm(&self.norm));
        gradient.add_linear(using, &self.linear, output, &states1[steps * size..]);
        let term = self.output.back(weights, output);
        multiply(using, &[term], hidden, Epilogue::Set, state1);
        state0.fill(T::ZERO);
        biases0.fill(T::ZERO);
        biases1.fill(T::ZERO);
        let [first, second] = &self.layers;
        for step in (0..steps).rev() {
            let seen = match input.dropout {
                Some(_) => &between[step * size..][..size],
                None => &states0[(step + 1) * size..][..size],
            };
            let taken = StepBack {
                input: seen,
                state: &mut *state1,
                before: &states1[step * size..][..size],
                kept: &gates1[step * 4 * size..][..4 * size],
                gates: &mut *gates,
                biases: biases1,
            };
            second.step_backward(weights, taken, gradient);
            second.input_backward(weights, gates, by_seen);
            if let Some(dropout) = input.dropout {
                dropout.apply(by_seen, chunk.clone(), step);
            }
            add(using, state0, by_seen);
            let taken = StepBack {
                input: input.at(step, chunk),
                state: &mut *state0,
                before: &states0[step * size..][..size],
                kept: &gates0[step * 4 * size..][..4 * size],
                gates: &mut *gates,
                biases: biases0,
            };
            first.step_backward(weights, taken, gradient);
            if !to_input.is_empty() {
                let by_x = &mut by_x[..chunk.len() * width];
                first.input_backward(weights, gates, by_x);
                let to = to_input.values.chunks_exact_mut(steps * width);
                for (to, x) in to.zip(by_x.chunks_exact(width)) {
                    to[step * width..(step + 1) * width].copy_from_slice(x);
                }
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
    match keeps || step.is_multiple_of(2) {
        true => (before, after),
        false => (after, before),
    }
}
