//! Packed weights: every matrix in the panels that the kernel of products reads, module by module,
//! for the forward pass and, if wanted, for the backward pass.
//!
//! Weights are packed once for inference, and once per step in training.

use std::ops::Range;

use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Slot, Term, pack};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::network::parameters::Linear;

/// Purpose of packed weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Forward passes only.
    Inference,
    /// Forward and backward passes.
    Training,
}

/// The packed weights of a [`Network`](crate::Network), with the plain ones that need no packing
/// beside them.
#[derive(Clone, Debug)]
pub struct PackedWeights<T> {
    pub(crate) instructions: Instructions,
    pub(crate) purpose: Purpose,
    pub(crate) flat: Vec<T>,
    pub(crate) modules: Vec<PackedModule<T>>,
}

/// The packed matrices of an encoder, a block or the decoder.
#[derive(Clone, Debug, Default)]
pub(crate) struct PackedModule<T> {
    pub(crate) forward: Aligned<T>,
    /// Empty in weights for inference.
    pub(crate) backward: Aligned<T>,
}

/// The weights of a layer and its instructions.
#[derive(Clone, Copy)]
pub(crate) struct LayerWeights<'a, T> {
    pub(crate) instructions: Instructions,
    /// All weights of the network, plain.
    pub(crate) flat: &'a [T],
    /// The packed matrices of the layer's module.
    pub(crate) module: &'a PackedModule<T>,
}

impl<'a, T> LayerWeights<'a, T> {
    /// The plain weights of this place.
    pub(crate) fn at(&self, place: &Range<usize>) -> &'a [T] {
        &self.flat[place.clone()]
    }
}

/// Lengths of the packed matrices of a module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct ModuleSize {
    forward: usize,
    backward: usize,
}

impl ModuleSize {
    /// Room for a matrix of the forward pass.
    pub(crate) fn forward(&mut self, depth: usize, columns: usize) -> Slot {
        Self::slot(&mut self.forward, depth, columns)
    }

    /// Room for a matrix of the backward pass.
    pub(crate) fn backward(&mut self, depth: usize, columns: usize) -> Slot {
        Self::slot(&mut self.backward, depth, columns)
    }

    /// Room for the matrices of all slots.
    pub(crate) fn room<T: Real>(&self, purpose: Purpose) -> PackedModule<T> {
        PackedModule {
            forward: Aligned::zeros(self.forward),
            backward: match purpose {
                Purpose::Inference => Aligned::default(),
                Purpose::Training => Aligned::zeros(self.backward),
            },
        }
    }

    fn slot(end: &mut usize, depth: usize, columns: usize) -> Slot {
        let slot = Slot {
            offset: *end,
            depth,
            columns,
        };
        *end += slot.length();
        slot
    }
}

/// Some input columns of a linear layer, packed for both passes.
#[derive(Clone, Debug)]
pub(crate) struct Piece {
    weight: usize,
    stride: usize,
    /// The first of the columns.
    pub(crate) first: usize,
    forward: Slot,
    backward: Slot,
}

impl Piece {
    /// These input columns of `linear`.
    pub(crate) fn new(size: &mut ModuleSize, linear: &Linear, columns: &Range<usize>) -> Self {
        Self {
            weight: linear.weight.start,
            stride: linear.inputs,
            first: columns.start,
            forward: size.forward(columns.len(), linear.outputs),
            backward: size.backward(linear.outputs, columns.len()),
        }
    }

    /// All input columns.
    pub(crate) fn whole(size: &mut ModuleSize, linear: &Linear) -> Self {
        Self::new(size, linear, &(0..linear.inputs))
    }

    /// Number of its input columns.
    pub(crate) fn inputs(&self) -> usize {
        self.forward.depth
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        let (flat, stride) = (packer.flat, self.stride);
        let first = self.weight + self.first;
        packer.forward(self.forward, |l, j| flat[first + j * stride + l]);
        packer.backward(self.backward, |l, j| flat[first + l * stride + j]);
    }

    /// rows Wᵀ.
    pub(crate) fn times<'a, T: Real>(
        &self,
        weights: LayerWeights<'a, T>,
        rows: &'a [T],
    ) -> Term<'a, T> {
        Term {
            rows: Columns::all(rows, self.inputs()),
            packed: self.forward.of(&weights.module.forward),
        }
    }

    /// Gradients of outputs to those of inputs: rows W.
    pub(crate) fn back<'a, T: Real>(
        &self,
        weights: LayerWeights<'a, T>,
        rows: &'a [T],
    ) -> Term<'a, T> {
        Term {
            rows: Columns::all(rows, self.backward.depth),
            packed: self.backward.of(&weights.module.backward),
        }
    }
}

/// Fills the packed matrices of a module.
pub(crate) struct Packer<'a, T> {
    pub(crate) instructions: Instructions,
    pub(crate) flat: &'a [T],
    pub(crate) module: &'a mut PackedModule<T>,
}

impl<T: Real> Packer<'_, T> {
    /// Packs a matrix of the forward pass.
    pub(crate) fn forward(&mut self, slot: Slot, entry: impl Fn(usize, usize) -> T) {
        pack(self.instructions, slot, entry, &mut self.module.forward);
    }

    /// Packs a matrix of the backward pass, unless the weights are for inference.
    pub(crate) fn backward(&mut self, slot: Slot, entry: impl Fn(usize, usize) -> T) {
        if !self.module.backward.is_empty() {
            pack(self.instructions, slot, entry, &mut self.module.backward);
        }
    }

    /// The room of a forward slot, for weights that are packed in another way.
    pub(crate) fn room(&mut self, slot: Slot) -> &mut [T] {
        slot.of_mut(&mut self.module.forward)
    }
}

impl<T: Real> PackedWeights<T> {
    /// The weights of the layers of a module.
    pub(crate) fn layer(&self, module: usize) -> LayerWeights<'_, T> {
        LayerWeights {
            instructions: self.instructions,
            flat: &self.flat,
            module: &self.modules[module],
        }
    }
}
