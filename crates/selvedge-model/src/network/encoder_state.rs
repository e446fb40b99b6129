//! The state that recurrent encoders carry from frame to frame.

use crate::kernels::aligned::Aligned;
use crate::kernels::real::Real;

/// States of the recurrent encoders of nodes and arcs, both layers, which a streaming network
/// carries from frame to frame. Empty arrays are zero.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EncoderState<T> {
    /// `[vertices, latent]` each.
    pub(crate) nodes: [Aligned<T>; 2],
    /// `[arcs, latent]` each.
    pub(crate) arcs: [Aligned<T>; 2],
}

impl<T: Real> EncoderState<T> {
    /// The zero state.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// The same number everywhere, for a graph of that many vertices and arcs.
    #[must_use]
    pub fn filled(value: T, vertices: usize, arcs: usize, latent: usize) -> Self {
        let mut state = Self::new();
        state.fit(vertices, arcs, latent);
        for array in state.nodes.iter_mut().chain(&mut state.arcs) {
            array.fill(value);
        }
        state
    }

    /// Both layers of the nodes, then both of the arcs; empty for zero.
    #[must_use]
    pub fn arrays(&self) -> [&[T]; 4] {
        let ([a, b], [c, d]) = (&self.nodes, &self.arcs);
        [a, b, c, d]
    }

    /// Returns true where nothing is carried.
    #[must_use]
    pub fn is_zero(&self) -> bool {
        self.nodes[0].is_empty()
    }

    /// Sets the state to zero.
    pub fn clear(&mut self) {
        for array in self.nodes.iter_mut().chain(&mut self.arcs) {
            array.clear();
        }
    }

    pub(crate) fn fit(&mut self, vertices: usize, arcs: usize, latent: usize) {
        for (arrays, rows) in [(&mut self.nodes, vertices), (&mut self.arcs, arcs)] {
            for array in arrays {
                array.resize(rows * latent);
            }
        }
    }
}
