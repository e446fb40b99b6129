//! What lets the vertices of a block see their whole cloth: filters through its modes, and tokens.

use crate::graph::connectivity::Connectivity;
use crate::kernels::real::Real;
use crate::network::layers::filter::FilterRoom;
use crate::network::layers::per_cloth::ClothSums;
use crate::network::layers::tokens::{TokenRoom, TokenSums, Tokens};

/// Room for what the cloths of a graph are as wholes.
#[derive(Default)]
pub(crate) struct WholeRoom<T> {
    pub(crate) filter: FilterRoom<T>,
    pub(crate) tokens: TokenRoom<T>,
}

/// Sums over a range of vertices for the cloths that they belong to.
#[derive(Default)]
pub(crate) struct WholeSums<T> {
    pub(crate) modes: ClothSums<T>,
    pub(crate) tokens: TokenSums<T>,
}

impl<T: Real> WholeRoom<T> {
    /// Makes room for a pass through so many blocks, which have `tokens` or none alike; `kept` for
    /// a backward pass as well.
    pub(crate) fn fit(
        &mut self,
        graph: &Connectivity,
        latent: usize,
        tokens: Option<&Tokens>,
        blocks: usize,
        kept: bool,
    ) {
        self.filter.fit(graph, latent, blocks);
        self.tokens.fit(graph, tokens, blocks, kept);
    }

    /// Numbers held for vertices.
    #[cfg(test)]
    pub(crate) fn number_count(&self) -> usize {
        self.filter.number_count() + self.tokens.number_count()
    }
}
