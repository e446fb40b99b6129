//! The arguments of a pass through the network: its input, its purpose, and the derivatives that a
//! backward pass takes and leaves.

use thiserror::Error;

use crate::kernels::dropout::Dropout;

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
    /// Activations are kept for [`crate::Network::backward_packed`].
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

impl<'a, T> Gradients<'a, T> {
    /// From the gradient of the output to that of the weights alone.
    pub fn new(output: &'a [T], weights: &'a mut [T]) -> Self {
        Self {
            output,
            weights,
            input: None,
        }
    }
}

/// Derivatives with respect to an [`Input`].
pub struct InputGradient<'a, T> {
    /// `[window, vertices, node width]`.
    pub nodes: &'a mut [T],
    /// `[window, arcs, edge width]`.
    pub arcs: &'a mut [T],
}
