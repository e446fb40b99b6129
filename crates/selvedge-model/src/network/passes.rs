//! The two passes for each of the two scalars. They stand here so that their kernels, of which there is one
//! of every kind for every instruction set, are compiled once, in this crate, whoever calls them.

use crate::graph::connectivity::Connectivity;
use crate::network::packed::PackedWeights;
use crate::network::workspace::{EncoderState, Workspace};

use super::{Gradients, Input, Network, Pass, StateGradients};

/// Arguments of [`Network::forward_carried`] after the network.
pub struct ForwardPass<'a, T> {
    pub(crate) weights: &'a PackedWeights<T>,
    pub(crate) graph: &'a Connectivity,
    pub(crate) given: (Input<'a, T>, &'a EncoderState<T>),
    pub(crate) pass: Pass<'a>,
    pub(crate) workspace: &'a mut Workspace<T>,
}

/// Arguments of [`Network::backward_carried`] after the network.
pub struct BackwardPass<'a, T> {
    pub(crate) weights: &'a PackedWeights<T>,
    pub(crate) gradients: Gradients<'a, T>,
    pub(crate) graph: &'a Connectivity,
    pub(crate) given: (Input<'a, T>, &'a EncoderState<T>),
    pub(crate) states: StateGradients<'a, T>,
    pub(crate) output: &'a [T],
    pub(crate) workspace: &'a mut Workspace<T>,
}

/// A scalar that passes are compiled for.
pub trait Passes: Sized {
    /// [`Network::forward_carried`].
    fn forward(network: &Network, arguments: ForwardPass<'_, Self>);
    /// [`Network::backward_carried`].
    fn backward(network: &Network, arguments: BackwardPass<'_, Self>);
    /// Packs the weights that stand in `packed` as they are.
    fn pack(network: &Network, packed: &mut PackedWeights<Self>);
}

macro_rules! passes {
    ($scalar:ty) => {
        impl Passes for $scalar {
            fn forward(network: &Network, arguments: ForwardPass<'_, Self>) {
                network.run_forward(arguments);
            }

            fn backward(network: &Network, arguments: BackwardPass<'_, Self>) {
                network.run_backward(arguments);
            }

            fn pack(network: &Network, packed: &mut PackedWeights<Self>) {
                packed.pack(network);
            }
        }
    };
}

passes!(f32);
passes!(f64);
