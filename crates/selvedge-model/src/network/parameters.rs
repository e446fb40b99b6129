//! The layout of a network's weights: one flat array of numbers, and a table of names, shapes and
//! offsets. Gradients and optimiser moments have the same layout.
//!
//! Names are those that PyTorch gives the same modules: a perceptron is a `Sequential` of Linear
//! (0), ReLU, Linear (2), ReLU, Linear (4), LayerNorm (5).

use std::ops::Range;

use crate::kernels::gates::GruWeights;
use crate::kernels::gemm::Columns;
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::real::Real;
use crate::kernels::rows::add_column_sums;
use crate::kernels::simd::Instructions;

/// One named tensor of a network.
#[derive(Clone, Debug, PartialEq)]
pub struct Parameter {
    /// Module path.
    pub name: String,
    /// Shape, `[outputs, inputs]` for the weight of a linear layer.
    pub shape: Vec<usize>,
    /// Place of its numbers in the flat array, row by row.
    pub range: Range<usize>,
    /// Its initial numbers.
    pub start: Start,
}

/// Initial numbers of a parameter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Start {
    /// Uniform in (-bound, bound).
    Uniform {
        /// The bound.
        bound: f64,
    },
    /// One value for all numbers.
    Constant {
        /// The value.
        value: f64,
    },
}

/// The gradient of a module's weights, which are contiguous.
pub(crate) struct ModuleGradient<'a, T> {
    values: &'a mut [T],
    /// Number of the first weight of the module.
    first: usize,
}

impl<'a, T: Real> ModuleGradient<'a, T> {
    /// `values` are the gradient of the weights from number `first` on.
    pub(crate) fn new(values: &'a mut [T], first: usize) -> Self {
        Self { values, first }
    }

    /// The gradient of the weights of these numbers.
    pub(crate) fn at(&mut self, weights: Range<usize>) -> &mut [T] {
        &mut self.values[weights.start - self.first..weights.end - self.first]
    }

    /// The gradients of weight and bias, which are contiguous.
    pub(crate) fn layer_norm(&mut self, norm: &LayerNorm) -> [&mut [T]; 2] {
        let both = norm.weight..norm.weight + 2 * norm.width;
        self.at(both).split_at_mut(norm.width).into()
    }

    /// Adds the gradients of weight and bias for an output gradient and the layer's input.
    pub(crate) fn add_linear(
        &mut self,
        using: Instructions,
        linear: &Linear,
        output: &[T],
        input: &[T],
    ) {
        add_column_sums(using, self.at(linear.bias_range()), output);
        let sums = Sums {
            rows: self.at(linear.weight_range()),
            stride: linear.inputs,
            first: 0,
        };
        let (left, right) = (
            Columns::all(output, linear.outputs),
            Columns::all(input, linear.inputs),
        );
        add_outer(using, sums, left, right);
    }
}

/// Builds the table of parameters, layer after layer.
#[derive(Default)]
pub(crate) struct LayoutBuilder {
    parameters: Vec<Parameter>,
    length: usize,
}

impl LayoutBuilder {
    /// Number of weights so far.
    pub(crate) fn length(&self) -> usize {
        self.length
    }

    fn add(&mut self, name: String, shape: &[usize], start: Start) -> usize {
        let offset = self.length;
        self.length += shape.iter().product::<usize>();
        self.parameters.push(Parameter {
            name,
            shape: shape.to_vec(),
            range: offset..self.length,
            start,
        });
        offset
    }

    /// A linear layer as PyTorch starts one: uniform in ±1/√inputs.
    pub(crate) fn linear(&mut self, path: &str, inputs: usize, outputs: usize) -> Linear {
        let start = Start::Uniform {
            bound: (inputs as f64).sqrt().recip(),
        };
        Linear {
            weight: self.add(format!("{path}.weight"), &[outputs, inputs], start),
            bias: self.add(format!("{path}.bias"), &[outputs], start),
            inputs,
            outputs,
        }
    }

    /// A layer normalisation.
    pub(crate) fn layer_norm(&mut self, path: &str, width: usize) -> LayerNorm {
        let constant = |value| Start::Constant { value };
        LayerNorm {
            weight: self.add(format!("{path}.weight"), &[width], constant(1.0)),
            bias: self.add(format!("{path}.bias"), &[width], constant(0.0)),
            width,
        }
    }

    /// One layer of gated recurrent units as PyTorch starts it: uniform in ±1/√hidden.
    pub(crate) fn gru_layer(
        &mut self,
        path: &str,
        layer: usize,
        inputs: usize,
        hidden: usize,
    ) -> GruLayer {
        let start = Start::Uniform {
            bound: (hidden as f64).sqrt().recip(),
        };
        let gates = 3 * hidden;
        GruLayer {
            weight_ih: self.add(
                format!("{path}.weight_ih_l{layer}"),
                &[gates, inputs],
                start,
            ),
            weight_hh: self.add(
                format!("{path}.weight_hh_l{layer}"),
                &[gates, hidden],
                start,
            ),
            bias_ih: self.add(format!("{path}.bias_ih_l{layer}"), &[gates], start),
            bias_hh: self.add(format!("{path}.bias_hh_l{layer}"), &[gates], start),
            inputs,
            hidden,
        }
    }

    pub(crate) fn finish(self) -> Vec<Parameter> {
        self.parameters
    }
}

/// Offsets of a linear layer: weight `[outputs, inputs]`, bias `[outputs]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Linear {
    pub(crate) weight: usize,
    pub(crate) bias: usize,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
}

impl Linear {
    pub(crate) fn weight_range(&self) -> Range<usize> {
        self.weight..self.weight + self.inputs * self.outputs
    }

    pub(crate) fn bias_range(&self) -> Range<usize> {
        self.bias..self.bias + self.outputs
    }
}

/// Offsets of a layer normalisation: weight and bias `[width]`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct LayerNorm {
    pub(crate) weight: usize,
    pub(crate) bias: usize,
    pub(crate) width: usize,
}

impl LayerNorm {
    pub(crate) fn weight_range(&self) -> Range<usize> {
        self.weight..self.weight + self.width
    }

    pub(crate) fn bias_range(&self) -> Range<usize> {
        self.bias..self.bias + self.width
    }
}

/// Offsets of a layer of gated recurrent units; gates in the order r, z, n.
#[derive(Clone, Copy, Debug)]
pub(crate) struct GruLayer {
    pub(crate) weight_ih: usize,
    pub(crate) weight_hh: usize,
    pub(crate) bias_ih: usize,
    pub(crate) bias_hh: usize,
    pub(crate) inputs: usize,
    pub(crate) hidden: usize,
}

impl GruLayer {
    /// The weights of the layer in the flat array.
    pub(crate) fn of<'a, T>(&self, flat: &'a [T]) -> GruWeights<'a, T> {
        GruWeights {
            inputs: self.inputs,
            hidden: self.hidden,
            of_input: &flat[self.weight_ih_range()],
            of_state: &flat[self.weight_hh_range()],
            input_bias: &flat[self.bias_ih_range()],
            state_bias: &flat[self.bias_hh_range()],
        }
    }

    pub(crate) fn weight_ih_range(&self) -> Range<usize> {
        self.weight_ih..self.weight_ih + 3 * self.hidden * self.inputs
    }

    pub(crate) fn weight_hh_range(&self) -> Range<usize> {
        self.weight_hh..self.weight_hh + 3 * self.hidden * self.hidden
    }

    pub(crate) fn bias_ih_range(&self) -> Range<usize> {
        self.bias_ih..self.bias_ih + 3 * self.hidden
    }

    pub(crate) fn bias_hh_range(&self) -> Range<usize> {
        self.bias_hh..self.bias_hh + 3 * self.hidden
    }
}
