//! The bare matrix products of a network, computed by a library: the roofline, with which
//! `selvedge bench engine` compares the engine. They are listed from the spec alone, with the shapes
//! in which they are computed (split first arc layer, no product with a zero state).

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use selvedge_model::{Encoder, ModelSpec, Purpose};

/// Some products of one shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct BareProduct {
    /// Kind of the product.
    pub(crate) kind: ProductKind,
    /// Rows of vertices or arcs.
    pub(crate) rows: usize,
    /// Numbers in a row of the first operand.
    pub(crate) depth: usize,
    /// Numbers in a row of the result, or of the second operand.
    pub(crate) columns: usize,
    /// Number of these products.
    pub(crate) times: usize,
}

/// Kind of a product of the engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ProductKind {
    /// `[rows, depth]` times a matrix `[depth, columns]`.
    Rows,
    /// `[rows, depth]`ᵀ times `[rows, columns]`: a weight gradient.
    Outer,
}

#[cfg(test)]
impl BareProduct {
    /// Floating-point operations of all these products.
    pub(crate) fn flops(&self) -> u64 {
        2 * (self.rows * self.depth * self.columns * self.times) as u64
    }
}

/// The products of a frame, or with [`Purpose::Training`] of a forward and a backward pass.
pub(crate) fn bare_products(
    spec: &ModelSpec,
    vertices: usize,
    arcs: usize,
    purpose: Purpose,
) -> Vec<BareProduct> {
    let (latent, mut list) = (spec.latent, Vec::new());
    let mut add = |rows, depth, columns, times, first: bool| {
        let product = BareProduct {
            kind: ProductKind::Rows,
            rows,
            depth,
            columns,
            times,
        };
        list.push(product);
        if purpose == Purpose::Training {
            list.push(BareProduct {
                kind: ProductKind::Outer,
                depth: columns,
                columns: depth,
                ..product
            });
            // The gradient of the features is not wanted.
            if !first {
                list.push(BareProduct {
                    depth: columns,
                    columns: depth,
                    ..product
                });
            }
        }
    };
    let seen = arcs * usize::from(spec.blocks > 0);
    let kinds = [(vertices, spec.node_width()), (seen, spec.edge_width())];
    for (rows, width) in kinds {
        match spec.encoder {
            Encoder::Mlp { .. } => {
                add(rows, width, latent, 1, true);
                add(rows, latent, latent, 2, false);
            }
            Encoder::Gru { .. } | Encoder::StreamingGru { .. } => {
                let (steps, states) = match spec.encoder {
                    Encoder::StreamingGru { .. } => (1, 1),
                    _ => (spec.window(), spec.window() - 1),
                };
                add(rows, width, 3 * latent, steps, true);
                add(rows, latent, 3 * latent, steps + 2 * states, false);
                add(rows, latent, latent, 1, false);
            }
        }
    }
    add(vertices, latent, 2 * latent, spec.blocks, false);
    add(arcs, latent, latent, 3 * spec.blocks, false);
    add(vertices, 2 * latent, latent, spec.blocks, false);
    add(vertices, latent, latent, 2 * spec.blocks + 2, false);
    add(vertices, latent, spec.outputs(), 1, false);
    list
}

/// The products of a list, by faer.
pub(crate) struct Products {
    list: Vec<BareProduct>,
    left: Vec<f32>,
    right: Vec<f32>,
    out: Vec<f32>,
    par: Par,
}

impl Products {
    /// Room for these products, on so many threads.
    pub(crate) fn new(list: Vec<BareProduct>, threads: usize) -> Self {
        let most = |of: fn(&BareProduct) -> usize| list.iter().map(of).max().unwrap_or(0);
        let numbers = |count: usize| -> Vec<f32> {
            let number = |k: usize| ((k * 7919) % 1009) as f32 / 1009.0 - 0.5;
            (0..count).map(number).collect()
        };
        Self {
            left: numbers(most(|p| p.rows * p.depth)),
            right: numbers(most(|p| p.rows.max(p.depth) * p.columns)),
            out: vec![0.0; most(|p| p.rows.max(p.depth) * p.columns)],
            list,
            par: if threads > 1 {
                Par::rayon(threads)
            } else {
                Par::Seq
            },
        }
    }

    /// Everything once.
    pub(crate) fn run(&mut self) {
        for product in &self.list {
            let BareProduct {
                kind,
                rows,
                depth,
                columns,
                times,
            } = *product;
            let left = MatRef::from_row_major_slice(&self.left[..rows * depth], rows, depth);
            for _ in 0..times {
                match kind {
                    // A layer's weight is [columns, depth].
                    ProductKind::Rows => {
                        let weight = &self.right[..depth * columns];
                        let weight = MatRef::from_row_major_slice(weight, columns, depth);
                        let out = &mut self.out[..rows * columns];
                        let out = MatMut::from_row_major_slice_mut(out, rows, columns);
                        let right = weight.transpose();
                        matmul(out, Accum::Replace, left, right, 1.0, self.par);
                    }
                    ProductKind::Outer => {
                        let right = &self.right[..rows * columns];
                        let right = MatRef::from_row_major_slice(right, rows, columns);
                        let out = &mut self.out[..depth * columns];
                        let out = MatMut::from_row_major_slice_mut(out, depth, columns);
                        let left = left.transpose();
                        matmul(out, Accum::Replace, left, right, 1.0, self.par);
                    }
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::flops::{FirstEdgeLayer, flops};

    #[test]
    fn the_products_are_the_arithmetic_of_the_spec() {
        let (vertices, arcs) = (30, 140);
        for encoder in [
            Encoder::MLP,
            Encoder::Gru { window: 4 },
            Encoder::StreamingGru { window: 4 },
        ] {
            let spec = ModelSpec::physical(encoder, 8, 3);
            let sum = |purpose| -> u64 {
                let products = bare_products(&spec, vertices, arcs, purpose);
                products.iter().map(BareProduct::flops).sum()
            };
            let all = flops(&spec, FirstEdgeLayer::Split).per_frame(vertices, arcs);
            // Two products of each row with a zero state, where a window begins with one.
            let rows = match encoder {
                Encoder::Gru { .. } => vertices + arcs,
                _ => 0,
            };
            let zero = (2 * 2 * rows * 8 * 24) as u64;
            assert_eq!(sum(Purpose::Inference), all - zero, "{encoder:?}");
            // Three times as much to learn, but for the gradient of the features.
            assert!(sum(Purpose::Training) < 3 * sum(Purpose::Inference));
        }
    }
}
