//! The recurrent encoder: two layers of gated recurrent units over a window of frames, zero
//! initial state unless one is carried over, dropout between the layers in training, then Linear and
//! LayerNorm on the last state.
//!
//! A chunk's rows pass through the whole window, both layers step by step, before the next chunk
//! begins. Within a chunk everything kept is step-major: `[steps, rows, width]`.

use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Finish, Slot, Term, multiply};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::{
    GateGradients, GruStep, NormRows, Normalised, RowMasks, add, add_column_sums, gate_slots,
    gru_gates_backward, gru_step, layer_norm, layer_norm_backward, pack_biases, pack_gates,
};
use crate::network::layers::encoder::EncoderEnds;
use crate::network::layers::{GroupScratch, Scratch};
use crate::network::packed::{LayerWeights, ModuleSize, Packer, Piece};
use crate::network::parameters::{GruLayer, LayerNorm, LayoutBuilder, Linear, ModuleGradient};

/// Where the weights of a recurrent encoder lie.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GruEncoder {
    layers: [Layer; 2],
    linear: Linear,
    output: Piece,
    norm: LayerNorm,
}

/// One layer of recurrent units.
#[derive(Clone, Copy, Debug)]
struct Layer {
    weights: GruLayer,
    /// Gates and biases of the forward pass.
    gates: [Slot; 2],
    /// From the gradients of n, r, z to that of the input.
    to_input: Slot,
    /// From the gradients of r, z, n to that of the state.
    to_state: Slot,
}

/// Activations of all rows, chunk after chunk, kept for the backward pass.
#[derive(Default)]
pub(crate) struct GruRecord<T> {
    /// Frames of the window.
    steps: usize,
    /// States of each layer, the initial one first: per chunk `[steps + 1, rows, hidden]`.
    pub(crate) states: [Aligned<T>; 2],
    /// Gates of each layer: per chunk `[steps, rows, 4 hidden]`.
    kept: [Aligned<T>; 2],
    /// What the second layer sees where dropout makes it differ from the first one's states: per
    /// chunk `[steps, rows, hidden]`.
    between: Aligned<T>,
    normal: Aligned<T>,
    inverse_deviation: Aligned<T>,
}

/// The part of a [`GruRecord`] that belongs to a chunk; empty where nothing is kept.
pub(crate) struct GruTile<'a, T> {
    pub(crate) states: [&'a mut [T]; 2],
    pub(crate) kept: [&'a mut [T]; 2],
    pub(crate) between: &'a mut [T],
    pub(crate) normal: &'a mut [T],
    pub(crate) inverse_deviation: &'a mut [T],
}

/// The rows of a chunk in the input `[steps, all rows, width]`.
#[derive(Clone, Copy)]
pub(crate) struct InputRows<'a, T> {
    pub(crate) input: &'a [T],
    pub(crate) all_rows: usize,
    pub(crate) steps: usize,
    pub(crate) first: usize,
    pub(crate) rows: usize,
}

impl<'a, T> InputRows<'a, T> {
    /// The chunk's rows at `step`.
    pub(crate) fn at(&self, step: usize, width: usize) -> &'a [T] {
        let start = (step * self.all_rows + self.first) * width;
        &self.input[start..start + self.rows * width]
    }
}

impl<T: Real> GruRecord<T> {
    /// Numbers held.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        let twice = self.states.iter().chain(&self.kept);
        let once = [&self.between, &self.normal, &self.inverse_deviation];
        twice.chain(once).map(|array| array.len()).sum()
    }

    /// Makes room for `rows` rows.
    pub(crate) fn fit(
        &mut self,
        encoder: &GruEncoder,
        (rows, steps): (usize, usize),
        dropout: Option<&RowMasks>,
    ) {
        let hidden = encoder.linear.inputs;
        self.steps = steps;
        for layer in 0..2 {
            self.states[layer].resize(rows * (steps + 1) * hidden);
            self.kept[layer].resize(rows * steps * 4 * hidden);
        }
        let between = if dropout.is_some() { steps } else { 0 };
        self.between.resize(rows * between * hidden);
        self.normal.resize(rows * encoder.linear.outputs);
        self.inverse_deviation.resize(rows);
    }

    /// Everything, with the widths of its rows, in the order of [`GruTile`].
    pub(crate) fn rows(&mut self, encoder: &GruEncoder) -> [(&mut [T], usize); 7] {
        let (steps, hidden) = (self.steps, encoder.linear.inputs);
        let [states0, states1] = &mut self.states;
        let [kept0, kept1] = &mut self.kept;
        [
            (states0, (steps + 1) * hidden),
            (states1, (steps + 1) * hidden),
            (kept0, steps * 4 * hidden),
            (kept1, steps * 4 * hidden),
            (&mut self.between, steps * hidden),
            (&mut self.normal, encoder.linear.outputs),
            (&mut self.inverse_deviation, 1),
        ]
    }
}

/// Where a chunk's recurrence begins or ends: the states of both layers `[rows, hidden]`; empty where
/// it begins with zero, or nobody asks how it ends.
pub(crate) type States<S> = [S; 2];

impl Layer {
    fn new(
        (layout, size): (&mut LayoutBuilder, &mut ModuleSize),
        path: &str,
        number: usize,
        [inputs, hidden]: [usize; 2],
    ) -> Self {
        Self {
            weights: layout.gru_layer(path, number, [inputs, hidden]),
            gates: gate_slots(size, inputs, hidden),
            to_input: size.backward(3 * hidden, inputs),
            to_state: size.backward(3 * hidden, hidden),
        }
    }

    fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        let (layer, flat, using) = (&self.weights, packer.flat, packer.instructions);
        let (inputs, hidden) = (layer.inputs, layer.hidden);
        let (ih, hh) = (
            &flat[layer.weight_ih_range()],
            &flat[layer.weight_hh_range()],
        );
        pack_gates(
            using,
            (inputs, hidden),
            [ih, hh],
            packer.room(self.gates[0]),
        );
        let biases = [layer.bias_ih_range(), layer.bias_hh_range()].map(|range| &flat[range]);
        pack_biases(using, hidden, biases, packer.room(self.gates[1]));
        let row = |l: usize| {
            if l < hidden {
                2 * hidden + l
            } else {
                l - hidden
            }
        };
        packer.backward(self.to_input, |l, j| ih[row(l) * inputs + j]);
        packer.backward(self.to_state, |l, j| hh[l * hidden + j]);
    }

    /// From the input and the state before to the state after; the gates go to `kept` unless that is
    /// empty.
    fn step<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, before): (&[T], Option<&[T]>),
        after: &mut [T],
        kept: &mut [T],
    ) {
        let step = GruStep {
            input,
            inputs: self.weights.inputs,
            before,
            packed: self.gates[0].of(&weights.module.forward),
            biases: self.gates[1].of(&weights.module.forward),
            hidden: self.weights.hidden,
            after,
            kept,
        };
        gru_step(weights.instructions, step);
    }

    /// From the gradient of the state after a step, in `state`, to that of the state before; leaves the
    /// gradients of the sums in `gates`, adds those of the weights.
    fn step_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, before, kept): (&[T], &[T], &[T]),
        [state, gates, biases]: [&mut [T]; 3],
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (layer, using) = (&self.weights, weights.instructions);
        let (inputs, hidden) = (layer.inputs, layer.hidden);
        let gradients = GateGradients {
            kept,
            before,
            state: &mut *state,
            sums: &mut *gates,
        };
        gru_gates_backward(using, gradients, hidden);
        add_column_sums(using, biases, gates);
        let all = Columns::all(&*gates, 4 * hidden);
        let (of_input, of_state) = (all.part(0, 3 * hidden), all.part(hidden, 3 * hidden));
        let term = Term {
            rows: of_state,
            packed: self.to_state.of(&weights.module.backward),
        };
        multiply(using, &[term], hidden, Finish::Add, state);
        let sums = Sums {
            rows: gradient.at(layer.weight_hh_range()),
            stride: hidden,
            first: 0,
        };
        add_outer(using, sums, of_state, Columns::all(before, hidden));
        let weight = gradient.at(layer.weight_ih_range());
        let (of_rz, of_n) = weight.split_at_mut(2 * hidden * inputs);
        let parts = [
            (of_rz, of_input.part(hidden, 2 * hidden)),
            (of_n, of_input.part(0, hidden)),
        ];
        for (rows, gates) in parts {
            let sums = Sums {
                rows,
                stride: inputs,
                first: 0,
            };
            add_outer(using, sums, gates, Columns::all(input, inputs));
        }
    }

    /// The gradient of the input of a step from those of the sums.
    fn input_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        gates: &[T],
        to_input: &mut [T],
    ) {
        let hidden = self.weights.hidden;
        let term = Term {
            rows: Columns::all(gates, 4 * hidden).part(0, 3 * hidden),
            packed: self.to_input.of(&weights.module.backward),
        };
        let columns = self.weights.inputs;
        multiply(
            weights.instructions,
            &[term],
            columns,
            Finish::Set,
            to_input,
        );
    }

    /// Adds the sums over all steps of the gradients of the gates' sums to those of the biases.
    fn biases_backward<T: Real>(&self, sums: &[T], gradient: &mut ModuleGradient<'_, T>) {
        let (layer, hidden) = (&self.weights, self.weights.hidden);
        let [n, r, z, recurrent] = [0, 1, 2, 3].map(|k| &sums[k * hidden..][..hidden]);
        for (range, third) in [
            (layer.bias_ih_range(), n),
            (layer.bias_hh_range(), recurrent),
        ] {
            let to = gradient.at(range).iter_mut();
            for (to, &x) in to.zip(r.iter().chain(z).chain(third)) {
                *to += x;
            }
        }
    }
}

impl GruEncoder {
    pub(crate) fn new(
        (layout, size): (&mut LayoutBuilder, &mut ModuleSize),
        path: &str,
        [inputs, latent]: [usize; 2],
    ) -> Self {
        let gru = format!("{path}.gru");
        let layers = [(0, inputs), (1, latent)].map(|(number, inputs)| {
            Layer::new((&mut *layout, &mut *size), &gru, number, [inputs, latent])
        });
        let linear = layout.linear(&format!("{path}.linear"), latent, latent);
        Self {
            layers,
            linear,
            output: Piece::whole(size, &linear),
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
        (input, dropout): (InputRows<'_, T>, Option<&RowMasks>),
        (start, end): (States<&[T]>, States<&mut [T]>),
        (tile, scratch): (GruTile<'_, T>, &mut Scratch<T>),
        out: &mut [T],
    ) {
        let size = input.rows * self.linear.inputs;
        let last = if tile.states[0].is_empty() {
            let states = scratch.states.each_mut().map(|layer| {
                let [a, b] = layer.each_mut().map(|buffer| &mut buffer[..size]);
                [a, b]
            });
            self.run(weights, input, start, states)
        } else {
            self.run_kept(
                weights,
                (input, dropout),
                start,
                (tile.states, tile.kept, tile.between),
            )
        };
        for (end, last) in end.into_iter().zip(last) {
            if !end.is_empty() {
                end.copy_from_slice(last);
            }
        }
        let using = weights.instructions;
        let (normal, inverse_deviation) = if tile.normal.is_empty() {
            scratch.tiles.norm_rows(size, input.rows)
        } else {
            (tile.normal, tile.inverse_deviation)
        };
        let finish = Finish::Bias(&weights.flat[self.linear.bias_range()]);
        let term = self.output.times(weights, last[1]);
        multiply(using, &[term], self.linear.outputs, finish, normal);
        let norm = NormRows {
            normal,
            inverse_deviation,
        };
        let (weight, shift) = (self.norm.weight_range(), self.norm.bias_range());
        let (weight, shift) = (&weights.flat[weight], &weights.flat[shift]);
        layer_norm(using, norm, weight, shift, Normalised::Set(out));
    }

    /// The window without keeping anything; gives the last states.
    fn run<'a, T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: InputRows<'_, T>,
        start: States<&'a [T]>,
        states: States<[&'a mut [T]; 2]>,
    ) -> States<&'a [T]> {
        let [first, second] = &self.layers;
        let [[mut before0, mut after0], [mut before1, mut after1]] = states;
        let carried = start[0].len() == before0.len();
        if carried {
            before0.copy_from_slice(start[0]);
            before1.copy_from_slice(start[1]);
        }
        for step in 0..input.steps {
            let some = step > 0 || carried;
            let x = input.at(step, first.weights.inputs);
            first.step(weights, (x, some.then_some(&*before0)), after0, &mut []);
            second.step(
                weights,
                (after0, some.then_some(&*before1)),
                after1,
                &mut [],
            );
            std::mem::swap(&mut before0, &mut after0);
            std::mem::swap(&mut before1, &mut after1);
        }
        [before0, before1]
    }

    /// The window with states and gates kept; gives the last states.
    fn run_kept<'a, T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, dropout): (InputRows<'_, T>, Option<&RowMasks>),
        start: States<&[T]>,
        (states, kept, between): (States<&'a mut [T]>, States<&mut [T]>, &mut [T]),
    ) -> States<&'a [T]> {
        let [first, second] = &self.layers;
        let (rows, hidden) = (input.rows, self.linear.inputs);
        let size = rows * hidden;
        let [states0, states1] = states;
        let [kept0, kept1] = kept;
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
            let kept = &mut kept0[step * 4 * size..][..4 * size];
            first.step(weights, (x, some.then_some(&*before)), after, kept);
            let mut seen = &*after;
            if let Some(dropout) = dropout {
                let between = &mut between[step * size..][..size];
                between.copy_from_slice(after);
                dropout.apply(between, input.first..input.first + rows, step);
                seen = between;
            }
            let (before, after) = states1[step * size..][..2 * size].split_at_mut(size);
            let kept = &mut kept1[step * 4 * size..][..4 * size];
            second.step(weights, (seen, some.then_some(&*before)), after, kept);
        }
        [
            &states0[input.steps * size..],
            &states1[input.steps * size..],
        ]
    }

    /// Adds the gradients of all weights for the gradient of a chunk's latent rows, which is
    /// overwritten; the gradients of input and states are those of the chunk, too.
    pub(crate) fn backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        (input, dropout): (InputRows<'_, T>, Option<&RowMasks>),
        record: &GruRecord<T>,
        ends: EncoderEnds<'_, T>,
        group: (&mut GroupScratch<T>, &mut ModuleGradient<'_, T>),
    ) {
        let EncoderEnds {
            output,
            to_input,
            end,
            start,
        } = ends;
        let (scratch, gradient) = group;
        let (rows, hidden, steps) = (input.rows, self.linear.inputs, input.steps);
        let (size, using) = (rows * hidden, weights.instructions);
        let of = |width: usize| input.first * width..(input.first + rows) * width;
        let states = record
            .states
            .each_ref()
            .map(|s| &s[of((steps + 1) * hidden)]);
        let kept = record.kept.each_ref().map(|k| &k[of(steps * 4 * hidden)]);
        let norm = (&record.normal[of(hidden)], &record.inverse_deviation[of(1)]);
        let weight = &weights.flat[self.norm.weight_range()];
        layer_norm_backward(using, output, norm, weight, gradient.layer_norm(&self.norm));
        gradient.add_linear(using, &self.linear, output, &states[1][steps * size..]);
        let [state0, state1] = scratch.states.each_mut().map(|s| &mut s[..size]);
        let term = self.output.back(weights, output);
        multiply(using, &[term], hidden, Finish::Set, state1);
        state0.fill(T::ZERO);
        for (state, end) in [&mut *state0, &mut *state1].into_iter().zip(end) {
            if !end.is_empty() {
                add(using, state, end);
            }
        }
        let gates = &mut scratch.gates[..4 * size];
        let [biases0, biases1] = &mut scratch.biases;
        biases0.fill(T::ZERO);
        biases1.fill(T::ZERO);
        let [first, second] = &self.layers;
        for step in (0..steps).rev() {
            let at = |width: usize| step * width..(step + 1) * width;
            let seen = match dropout {
                Some(_) => &record.between[of(steps * hidden)][step * size..][..size],
                None => &states[0][(step + 1) * size..][..size],
            };
            let given = (seen, &states[1][at(size)], &kept[1][at(4 * size)]);
            let buffers = [&mut *state1, &mut *gates, &mut **biases1];
            second.step_backward(weights, given, buffers, gradient);
            let between = &mut scratch.hidden[..size];
            second.input_backward(weights, gates, between);
            if let Some(dropout) = dropout {
                dropout.apply(between, input.first..input.first + rows, step);
            }
            add(using, state0, between);
            let x = input.at(step, first.weights.inputs);
            let given = (x, &states[0][at(size)], &kept[0][at(4 * size)]);
            let buffers = [&mut *state0, &mut *gates, &mut **biases0];
            first.step_backward(weights, given, buffers, gradient);
            if !to_input.is_empty() {
                let width = first.weights.inputs;
                let x = &mut scratch.joined[..rows * width];
                first.input_backward(weights, gates, x);
                let to = to_input.chunks_exact_mut(steps * width);
                for (to, x) in to.zip(x.chunks_exact(width)) {
                    to[step * width..(step + 1) * width].copy_from_slice(x);
                }
            }
        }
        for (to, state) in start.into_iter().zip([&*state0, &*state1]) {
            if !to.is_empty() {
                to.copy_from_slice(state);
            }
        }
        first.biases_backward(biases0, gradient);
        second.biases_backward(biases1, gradient);
    }
}
