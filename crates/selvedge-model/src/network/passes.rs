//! Passes through a network, their arguments, and the packing of its weights, for each of the two
//! scalars.
//!
//! The public methods are generic over [`NetworkScalar`], whose two implementations stand here.
//! Their kernels, one of every kind for every instruction set, are therefore compiled once, in this
//! crate.

use rayon::prelude::*;
use thiserror::Error;

use crate::graph::connectivity::Connectivity;
use crate::kernels::dropout::Dropout;
use crate::kernels::real::Real;
use crate::kernels::simd::Instructions;
use crate::network::definition::Network;
use crate::network::packed::{PackedWeights, Packer, Purpose};
use crate::network::workspace::Workspace;

/// Normalised features of a window of frames, oldest first.
#[derive(Clone, Copy, Debug)]
pub struct Input<'a, T> {
    /// `[window, vertices, node width]`.
    pub nodes: &'a [T],
    /// `[window, arcs, edge width]`.
    pub arcs: &'a [T],
}

/// A pass that ended before it was done, as was asked. What it left is nothing to use.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the pass was stopped, as was asked")]
pub struct Stopped;

/// Purpose of a pass through the network.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pass<'a> {
    /// Only the output is used: activations are not kept.
    Inference,
    /// Activations are kept for [`Network::backward_packed`].
    Training(Option<Dropout<'a>>),
}

/// Derivatives of a scalar, given for the output and computed for weights and input.
pub struct Gradients<'a, T> {
    /// With respect to the output, `[vertices, outputs]`.
    pub output: &'a [T],
    /// With respect to the weights, laid out like them; added to.
    pub weights: &'a mut [T],
    /// With respect to the input, if wanted; overwritten.
    pub input: Option<InputGradient<'a, T>>,
}

/// Derivatives with respect to an [`Input`].
pub struct InputGradient<'a, T> {
    /// `[window, vertices, node width]`.
    pub nodes: &'a mut [T],
    /// `[window, arcs, edge width]`.
    pub arcs: &'a mut [T],
}

/// What a pass goes through, in either direction.
#[derive(Clone, Copy)]
pub struct Passage<'a, T> {
    pub(super) network: &'a Network,
    pub(super) weights: &'a PackedWeights<T>,
    pub(super) graph: &'a Connectivity,
    pub(super) input: Input<'a, T>,
}

/// A scalar that passes through a network are compiled for: `f32` or `f64`.
pub trait NetworkScalar: Real {
    /// [`Network::forward_packed`].
    fn forward(of: Passage<'_, Self>, pass: Pass<'_>, to: &mut Workspace<Self>);
    /// [`Network::backward_packed`].
    fn backward(of: Passage<'_, Self>, by: Gradients<'_, Self>, to: &mut Workspace<Self>);
}

macro_rules! network_scalar {
    ($scalar:ty) => {
        impl NetworkScalar for $scalar {
            fn forward(of: Passage<'_, Self>, pass: Pass<'_>, to: &mut Workspace<Self>) {
                of.forward(pass, to);
            }

            fn backward(of: Passage<'_, Self>, by: Gradients<'_, Self>, to: &mut Workspace<Self>) {
                of.backward(by, to);
            }
        }
    };
}

network_scalar!(f32);
network_scalar!(f64);

impl Network {
    /// Packs `weights`, laid out as [`Self::parameters`] says.
    ///
    /// # Panics
    /// When the number of weights is not the network's.
    pub fn pack<T: NetworkScalar>(
        &self,
        weights: &[T],
        purpose: Purpose,
        instructions: Instructions,
    ) -> PackedWeights<T> {
        let rooms = self.modules.iter().map(|(size, _)| size.room(purpose));
        let mut packed = PackedWeights {
            instructions,
            purpose,
            flat: vec![T::ZERO; self.parameter_count()],
            modules: rooms.collect(),
        };
        self.repack(weights, &mut packed);
        packed
    }

    /// Packs other weights of the same network into the same room, module by module on all threads.
    ///
    /// # Panics
    /// When the number of weights is not the network's.
    pub fn repack<T: NetworkScalar>(&self, weights: &[T], packed: &mut PackedWeights<T>) {
        assert_eq!(weights.len(), self.parameter_count(), "weights");
        assert_eq!(packed.flat.len(), weights.len(), "room");
        packed.flat.copy_from_slice(weights);
        let (instructions, flat) = (packed.instructions, &*packed.flat);
        let modules = packed.modules.par_iter_mut().enumerate();
        modules.for_each(|(number, module)| {
            let mut packer = Packer {
                instructions,
                flat,
                module,
            };
            self.pack_module(number, &mut packer);
        });
    }

    fn passage<'a, T>(
        &'a self,
        weights: &'a PackedWeights<T>,
        graph: &'a Connectivity,
        input: Input<'a, T>,
    ) -> Passage<'a, T> {
        Passage {
            network: self,
            weights,
            graph,
            input,
        }
    }

    /// Normalised accelerations `[vertices, 3]` for normalised features.
    ///
    /// # Errors
    /// [`Stopped`] where the stop of [`Workspace::stop_by`] is wanted.
    ///
    /// # Panics
    /// When the lengths of the input are not those of the spec and the graph.
    pub fn forward_packed<'w, T: NetworkScalar>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        input: Input<'_, T>,
        pass: Pass<'_>,
        workspace: &'w mut Workspace<T>,
    ) -> Result<&'w [T], Stopped> {
        T::forward(self.passage(weights, graph, input), pass, workspace);
        if workspace.stop.is_wanted() {
            workspace.kept = false;
            return Err(Stopped);
        }
        Ok(&workspace.output)
    }

    /// Derivatives of Σ `gradients.output` ∘ out, where out is the output of the last
    /// [`Self::forward_packed`] with [`Pass::Training`] on the same arguments. Uses up its
    /// activations.
    ///
    /// # Errors
    /// As [`Self::forward_packed`]; the gradients are then of a part of the network.
    ///
    /// # Panics
    /// When the lengths are not those of the spec and the graph, the weights are not packed for
    /// training, or the last pass was not a forward one with [`Pass::Training`].
    pub fn backward_packed<T: NetworkScalar>(
        &self,
        weights: &PackedWeights<T>,
        graph: &Connectivity,
        input: Input<'_, T>,
        gradients: Gradients<'_, T>,
        workspace: &mut Workspace<T>,
    ) -> Result<(), Stopped> {
        T::backward(self.passage(weights, graph, input), gradients, workspace);
        if workspace.stop.is_wanted() { Err(Stopped) } else { Ok(()) }
    }
}
