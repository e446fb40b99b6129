//! The layout of a network's weights: one flat array of numbers, and a table of names, shapes and
//! offsets. Gradients and optimiser moments have the same layout.
//!
//! Names are those that PyTorch gives the same modules: a perceptron is a `Sequential` of Linear
//! (0), ReLU, Linear (2), ReLU, Linear (4), LayerNorm (5).

use std::ops::Range;

use crate::network::packed::ModuleSize;

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

/// The modules of a network, laid out one after another: their weights in the flat array, and the
/// lengths of their packed matrices.
#[derive(Debug, Default)]
pub(crate) struct Layout {
    pub(crate) parameters: Vec<Parameter>,
    /// Weights so far.
    length: usize,
    /// Lengths of the module that is laid out now.
    pub(crate) size: ModuleSize,
    /// Lengths and weights of the modules that are done.
    pub(crate) modules: Vec<(ModuleSize, Range<usize>)>,
}

impl Layout {
    /// Lays out one more module.
    pub(crate) fn module<L>(&mut self, make: impl FnOnce(&mut Self) -> L) -> L {
        let first = self.length;
        let layers = make(self);
        let size = std::mem::take(&mut self.size);
        self.modules.push((size, first..self.length));
        layers
    }

    /// The place of a tensor of this name.
    pub(crate) fn add(&mut self, name: String, shape: &[usize], start: Start) -> Range<usize> {
        let range = self.length..self.length + shape.iter().product::<usize>();
        self.length = range.end;
        self.parameters.push(Parameter {
            name,
            shape: shape.to_vec(),
            range: range.clone(),
            start,
        });
        range
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
        }
    }
}

/// Places of a linear layer: weight `[outputs, inputs]`, bias `[outputs]`.
#[derive(Clone, Debug)]
pub(crate) struct Linear {
    pub(crate) weight: Range<usize>,
    pub(crate) bias: Range<usize>,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
}

/// Places of a layer normalisation, one after the other: weight and bias `[width]`.
#[derive(Clone, Debug)]
pub(crate) struct LayerNorm {
    pub(crate) weight: Range<usize>,
    pub(crate) bias: Range<usize>,
}
