//! Rows of vertices and arcs that a block reads and writes, forward and backward.

use crate::graph::share::{Rows, split_rows};
use crate::network::layers::mlp::MlpRows;

split_rows! {
    /// Rows of vertices that a block writes.
    pub(crate) struct NodeRows<'a, T> {
        /// Latent nodes, updated, `[vertices, latent]`.
        pub(crate) nodes: Rows<'a, T>,
        pub(crate) record: NodeRecordRows<'a, T>,
    }
}

split_rows! {
    /// Rows of arcs that a block writes.
    pub(crate) struct ArcRows<'a, T> {
        /// Latent arcs, updated, `[arcs, latent]`.
        pub(crate) arcs: Rows<'a, T>,
        pub(crate) record: ArcRecordRows<'a, T>,
    }
}

split_rows! {
    /// Rows of vertices of a [`BlockRecord`]; empty where nothing is kept.
    pub(crate) struct NodeRecordRows<'a, T> {
        pub(super) before: Rows<'a, T>,
        pub(super) incoming: Rows<'a, T>,
        pub(super) mlp: MlpRows<'a, T>,
    }
}

split_rows! {
    /// Rows of arcs of a [`BlockRecord`]; empty where nothing is kept.
    pub(crate) struct ArcRecordRows<'a, T> {
        pub(super) before: Rows<'a, T>,
        pub(super) mlp: MlpRows<'a, T>,
    }
}

split_rows! {
    /// Gradients of a block's vertices, taken from after it to before it.
    pub(crate) struct NodeGradients<'a, T> {
        /// `[vertices, latent]`.
        pub(crate) nodes: Rows<'a, T>,
        /// Out: sums of the pre-activation gradients over the arcs that leave a vertex, then over
        /// the arcs that arrive, `[vertices, 2 latent]`.
        pub(crate) sums: Rows<'a, T>,
    }
}

split_rows! {
    /// Gradients of a block's arcs, taken from after it to before it.
    pub(crate) struct ArcGradients<'a, T> {
        /// `[arcs, latent]`.
        pub(crate) arcs: Rows<'a, T>,
        /// Out: pre-activation gradient of the first arc layer, `[arcs, latent]`.
        pub(crate) pre_activation: Rows<'a, T>,
    }
}
