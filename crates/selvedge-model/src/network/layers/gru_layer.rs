//! One layer of gated recurrent units: a step forward, and the gradient of a step.

use crate::kernels::gates::{GateGradients, GruStep, gru_step, pack_biases, pack_gates};
use crate::kernels::gemm::{Columns, Epilogue, Slot, Term, multiply};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::rows::add_column_sums;
use crate::kernels::simd::MOST_LANES;
use crate::network::packed::{LayerWeights, ModuleBuilder, Packer};
use crate::network::parameters::{GruLayer, ModuleGradient};

/// One layer of recurrent units.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Layer {
    pub(crate) weights: GruLayer,
    /// Matrices of the forward pass.
    gates: Slot,
    /// Biases of the forward pass.
    biases: Slot,
    /// From the gradients of n, r, z to that of the input.
    to_input: Slot,
    /// From the gradients of r, z, recurrent to that of the state.
    to_state: Slot,
}

/// A step that was taken, and its gradients on their way back.
pub(crate) struct StepBack<'a, T> {
    /// `[rows, inputs]`.
    pub(crate) input: &'a [T],
    /// In: gradient with respect to the state after; out: before, `[rows, hidden]`.
    pub(crate) state: &'a mut [T],
    /// State before the step, and the gates that it kept. `[rows, hidden]`, `[rows, 4 hidden]`.
    pub(crate) before: &'a [T],
    pub(crate) kept: &'a [T],
    /// Out: gradients of the sums, `[rows, 4 hidden]`.
    pub(crate) gates: &'a mut [T],
    /// Sums of the columns of `gates` over all steps, `[4 hidden]`; added to.
    pub(crate) biases: &'a mut [T],
}

impl Layer {
    /// Lays out layer `number` of the recurrent network `path`.
    pub(crate) fn new(
        module: &mut ModuleBuilder,
        path: &str,
        number: usize,
        inputs: usize,
        hidden: usize,
    ) -> Self {
        let size = &mut module.size;
        let padded = hidden.next_multiple_of(MOST_LANES);
        Self {
            weights: module.layout.gru_layer(path, number, inputs, hidden),
            gates: size.forward(inputs + hidden, 3 * padded),
            biases: size.forward(1, 4 * padded),
            to_input: size.backward(3 * hidden, inputs),
            to_state: size.backward(3 * hidden, hidden),
        }
    }

    /// Packs the matrices of both passes and the biases.
    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        let (layer, using) = (self.weights.of(packer.flat), packer.instructions);
        let (inputs, hidden) = (layer.inputs, layer.hidden);
        pack_gates(using, layer, packer.room(self.gates));
        pack_biases(using, layer, packer.room(self.biases));
        // Rows of the weights are of r, z, n; gradients of n, r, z reach the input.
        packer.backward(self.to_input, |l, j| {
            let row = (l + 2 * hidden) % (3 * hidden);
            layer.of_input[row * inputs + j]
        });
        packer.backward(self.to_state, |l, j| layer.of_state[l * hidden + j]);
    }

    /// From the input and the state before to the state after. Keeps the gates unless `gates` is
    /// empty.
    pub(crate) fn step<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        input: &[T],
        before: Option<&[T]>,
        after: &mut [T],
        gates: &mut [T],
    ) {
        let step = GruStep {
            input,
            inputs: self.weights.inputs,
            before,
            packed: self.gates.of(&weights.module.forward),
            biases: self.biases.of(&weights.module.forward),
            hidden: self.weights.hidden,
            after,
            kept: gates,
        };
        gru_step(weights.instructions, step);
    }

    /// Takes the gradient of the state back through a step. Adds the gradients of the matrices.
    pub(crate) fn step_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        step: StepBack<'_, T>,
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (layer, using) = (&self.weights, weights.instructions);
        let (inputs, hidden) = (layer.inputs, layer.hidden);
        let StepBack { state, gates, .. } = step;
        using.run(GateGradients {
            hidden,
            kept: step.kept,
            before: step.before,
            state: &mut *state,
            sums: &mut *gates,
        });
        add_column_sums(using, step.biases, gates);
        let all = Columns::all(&*gates, 4 * hidden);
        let columns = |first: usize, count: usize| all.part(first * hidden, count * hidden);
        let of_state = columns(1, 3);
        let term = Term {
            rows: of_state,
            packed: self.to_state.of(&weights.module.backward),
        };
        multiply(using, &[term], hidden, Epilogue::Add, state);
        let sums = Sums {
            rows: gradient.at(layer.weight_hh_range()),
            stride: hidden,
            first: 0,
        };
        add_outer(using, sums, of_state, Columns::all(step.before, hidden));
        let weight = gradient.at(layer.weight_ih_range());
        let (of_reset_and_update, of_new) = weight.split_at_mut(2 * hidden * inputs);
        for (rows, gates) in [
            (of_reset_and_update, columns(1, 2)),
            (of_new, columns(0, 1)),
        ] {
            let sums = Sums {
                rows,
                stride: inputs,
                first: 0,
            };
            add_outer(using, sums, gates, Columns::all(step.input, inputs));
        }
    }

    /// The gradient of the input of a step from those of the sums.
    pub(crate) fn input_backward<T: Real>(
        &self,
        weights: LayerWeights<'_, T>,
        gates: &[T],
        to_input: &mut [T],
    ) {
        let (hidden, columns) = (self.weights.hidden, self.weights.inputs);
        let term = Term {
            rows: Columns::all(gates, 4 * hidden).part(0, 3 * hidden),
            packed: self.to_input.of(&weights.module.backward),
        };
        let using = weights.instructions;
        multiply(using, &[term], columns, Epilogue::Set, to_input);
    }

    /// Adds the gradients of the biases from the sums over all steps of the gradients of the gates.
    pub(crate) fn biases_backward<T: Real>(
        &self,
        sums: &[T],
        gradient: &mut ModuleGradient<'_, T>,
    ) {
        let (layer, hidden) = (&self.weights, self.weights.hidden);
        let (new, others) = sums[..4 * hidden].split_at(hidden);
        for (range, candidate) in [
            (layer.bias_ih_range(), new),
            (layer.bias_hh_range(), &others[2 * hidden..]),
        ] {
            let from = others[..2 * hidden].iter().chain(candidate);
            for (to, &x) in gradient.at(range).iter_mut().zip(from) {
                *to += x;
            }
        }
    }
}
