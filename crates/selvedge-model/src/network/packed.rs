//! Weights as the products want them: every matrix packed, module by module, for the forward pass
//! and, where there is to be one, for the way back.
//!
//! To be made once for weights that stay, and once per step for weights that learn.

use rayon::prelude::*;

use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Slot, Term, pack};
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::network::Network;
use crate::network::parameters::Linear;

/// What packed weights are for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Purpose {
    /// Forward passes only.
    Inference,
    /// Forward and backward passes.
    Training,
}

/// The packed weights of a [`Network`], with the plain ones that need no packing beside them.
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
    pub(crate) backward: Aligned<T>,
}

impl<T: Real> PackedModule<T> {
    /// Room for a module's matrices.
    pub(crate) fn new(size: &ModuleSize, purpose: Purpose) -> Self {
        Self {
            forward: Aligned::zeros(size.forward),
            backward: match purpose {
                Purpose::Inference => Aligned::default(),
                Purpose::Training => Aligned::zeros(size.backward),
            },
        }
    }
}

/// What a layer computes with.
pub(crate) struct LayerWeights<'a, T> {
    pub(crate) instructions: Instructions,
    /// All weights of the network, plain.
    pub(crate) flat: &'a [T],
    /// The packed matrices of the layer's module.
    pub(crate) module: &'a PackedModule<T>,
}

impl<T> Clone for LayerWeights<'_, T> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<T> Copy for LayerWeights<'_, T> {}

/// Lengths of the packed matrices of a module, or where the next one is to be.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct ModuleSize {
    pub(crate) forward: usize,
    pub(crate) backward: usize,
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

/// Some input columns of a linear layer, packed for both ways.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Piece {
    weight: usize,
    stride: usize,
    first: usize,
    forward: Slot,
    backward: Slot,
}

impl Piece {
    /// Input columns `first..first + count` of `linear`.
    pub(crate) fn new(
        size: &mut ModuleSize,
        linear: &Linear,
        (first, count): (usize, usize),
    ) -> Self {
        Self {
            weight: linear.weight,
            stride: linear.inputs,
            first,
            forward: size.forward(count, linear.outputs),
            backward: size.backward(linear.outputs, count),
        }
    }

    /// All input columns.
    pub(crate) fn whole(size: &mut ModuleSize, linear: &Linear) -> Self {
        Self::new(size, linear, (0, linear.inputs))
    }

    pub(crate) fn pack<T: Real>(&self, packer: &mut Packer<'_, T>) {
        let Self {
            weight,
            stride,
            first,
            ..
        } = *self;
        let flat = packer.flat;
        packer.forward(self.forward, |l, j| flat[weight + j * stride + first + l]);
        packer.backward(self.backward, |l, j| flat[weight + l * stride + first + j]);
    }

    /// rows Wᵀ.
    pub(crate) fn times<'a, T>(&self, weights: LayerWeights<'a, T>, rows: &'a [T]) -> Term<'a, T> {
        Term {
            rows: Columns::all(rows, self.forward.depth),
            packed: self.forward.of(&weights.module.forward),
        }
    }

    /// Gradients of outputs to those of inputs: rows W.
    pub(crate) fn back<'a, T>(&self, weights: LayerWeights<'a, T>, rows: &'a [T]) -> Term<'a, T> {
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
    pub(crate) fn forward(&mut self, slot: Slot, entry: impl Fn(usize, usize) -> T) {
        let out = &mut self.module.forward[slot.offset..slot.offset + slot.length()];
        pack(self.instructions, (slot.depth, slot.columns), entry, out);
    }

    /// Does nothing where there is no way back.
    pub(crate) fn backward(&mut self, slot: Slot, entry: impl Fn(usize, usize) -> T) {
        if !self.module.backward.is_empty() {
            let out = &mut self.module.backward[slot.offset..slot.offset + slot.length()];
            pack(self.instructions, (slot.depth, slot.columns), entry, out);
        }
    }

    /// The room of a forward slot, for what is packed in another way.
    pub(crate) fn room(&mut self, slot: Slot) -> &mut [T] {
        &mut self.module.forward[slot.offset..slot.offset + slot.length()]
    }
}

impl<T: Real> PackedWeights<T> {
    /// Packs `weights`, laid out as [`Network::parameters`] says.
    ///
    /// # Panics
    /// When the number of weights is not the network's.
    #[must_use]
    pub fn new(
        network: &Network,
        weights: &[T],
        purpose: Purpose,
        instructions: Instructions,
    ) -> Self {
        let sizes = network.module_sizes().iter();
        let mut packed = Self {
            instructions,
            purpose,
            flat: vec![T::ZERO; network.parameter_count()],
            modules: sizes.map(|size| PackedModule::new(size, purpose)).collect(),
        };
        packed.update(network, weights);
        packed
    }

    /// Packs other weights of the same network into the same room.
    ///
    /// # Panics
    /// When the number of weights is not the network's.
    pub fn update(&mut self, network: &Network, weights: &[T]) {
        assert_eq!(weights.len(), network.parameter_count(), "weights");
        assert_eq!(
            self.flat.len(),
            weights.len(),
            "weights of the same network"
        );
        self.flat.copy_from_slice(weights);
        T::pack(network, self);
    }

    pub(crate) fn pack(&mut self, network: &Network) {
        let (instructions, flat) = (self.instructions, &*self.flat);
        let modules = self.modules.par_iter_mut().enumerate();
        modules.for_each(|(number, module)| {
            let mut packer = Packer {
                instructions,
                flat,
                module,
            };
            network.pack_module(number, &mut packer);
        });
    }

    pub(crate) fn layer(&self, module: usize) -> LayerWeights<'_, T> {
        LayerWeights {
            instructions: self.instructions,
            flat: &self.flat,
            module: &self.modules[module],
        }
    }
}
