//! The roofline of a network: its matrix products alone, with which `selvedge bench engine`
//! compares the engine.
//!
//! The products are listed from the spec alone, with the shapes in which they are computed (split
//! first arc layer, no product with a zero state), and run on the engine's own kernel, over whole
//! arrays that are packed beforehand.

use rayon::prelude::*;

use crate::graph::partition::CHUNK;
use crate::kernels::aligned::Aligned;
use crate::kernels::gemm::{Columns, Epilogue, Slot, Term, multiply};
use crate::kernels::outer::{Sums, add_outer};
use crate::kernels::simd::Instructions;
use crate::network::packed::Purpose;
use crate::spec::{Encoder, ModelSpec};

/// Some products of one shape.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BareProduct {
    /// Kind of the product.
    pub kind: ProductKind,
    /// Rows of vertices or arcs.
    pub rows: usize,
    /// Numbers in a row of the first operand.
    pub depth: usize,
    /// Numbers in a row of the result, or of the second operand.
    pub columns: usize,
    /// Number of these products.
    pub times: usize,
}

/// Kind of a product of the engine.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ProductKind {
    /// `[rows, depth]` times a matrix `[depth, columns]`.
    Rows,
    /// `[rows, depth]`ᵀ times `[rows, columns]`: a weight gradient.
    Outer,
}

impl BareProduct {
    /// Floating-point operations of all these products.
    #[must_use]
    pub fn flops(&self) -> u64 {
        2 * (self.rows * self.depth * self.columns * self.times) as u64
    }
}

/// The products of a frame, or with [`Purpose::Training`] of a forward and a backward pass.
#[must_use]
pub fn bare_products(
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

/// Arrays for a list of products.
pub struct Roofline {
    products: Vec<BareProduct>,
    left: Aligned<f32>,
    right: Aligned<f32>,
    out: Aligned<f32>,
    /// Arbitrary numbers in place of packed matrices.
    packed: Aligned<f32>,
}

impl Roofline {
    /// Room for these products.
    #[must_use]
    pub fn new(products: Vec<BareProduct>) -> Self {
        let most = |of: fn(&BareProduct) -> usize| products.iter().map(of).max().unwrap_or(0);
        // Numbers that are no powers of two and far from the subnormal ones.
        let numbers = |count: usize| {
            let mut numbers = Aligned::zeros(count);
            for (k, x) in numbers.iter_mut().enumerate() {
                *x = ((k * 7919) % 1009) as f32 / 1009.0 - 0.5;
            }
            numbers
        };
        let size = most(|p| {
            let slot = Slot {
                offset: 0,
                depth: p.depth,
                columns: p.columns,
            };
            slot.length()
        });
        Self {
            left: numbers(most(|p| p.rows * p.depth)),
            right: numbers(most(|p| p.rows * p.columns)),
            out: Aligned::zeros(most(|p| (p.rows.max(8 * p.depth)) * p.columns)),
            packed: numbers(size),
            products,
        }
    }

    /// The products.
    #[must_use]
    pub fn products(&self) -> &[BareProduct] {
        &self.products
    }

    /// Floating-point operations of all products.
    #[must_use]
    pub fn flops(&self) -> u64 {
        self.products.iter().map(BareProduct::flops).sum()
    }

    /// Computes everything once, on the threads of the current pool.
    pub fn run(&mut self) {
        for number in 0..self.products.len() {
            let product = self.products[number];
            for _ in 0..product.times {
                match product.kind {
                    ProductKind::Rows => self.rows(product),
                    ProductKind::Outer => self.outer(product),
                }
            }
        }
    }

    fn rows(&mut self, product: BareProduct) {
        let BareProduct {
            rows,
            depth,
            columns,
            ..
        } = product;
        let packed = &self.packed;
        self.out[..rows * columns]
            .par_chunks_mut(CHUNK * columns)
            .zip(self.left[..rows * depth].par_chunks(CHUNK * depth))
            .for_each(|(out, left)| {
                let rows = Columns::all(left, depth);
                let term = Term { rows, packed };
                multiply(Instructions::Detected, &[term], columns, Epilogue::Set, out);
            });
    }

    fn outer(&mut self, product: BareProduct) {
        let BareProduct {
            rows,
            depth,
            columns,
            ..
        } = product;
        let chunks = rows.div_ceil(CHUNK).div_ceil(8) * CHUNK;
        let right = self.right[..rows * columns].par_chunks(chunks * columns);
        self.out
            .par_chunks_mut(depth * columns)
            .zip(
                self.left[..rows * depth]
                    .par_chunks(chunks * depth)
                    .zip(right),
            )
            .for_each(|(out, (left, right))| {
                let lefts = left.chunks(CHUNK * depth);
                for (left, right) in lefts.zip(right.chunks(CHUNK * columns)) {
                    let sums = Sums {
                        rows: &mut *out,
                        stride: columns,
                        first: 0,
                    };
                    let (left, right) = (Columns::all(left, depth), Columns::all(right, columns));
                    add_outer(Instructions::Detected, sums, left, right);
                }
            });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::cost::{FirstEdgeLayer, flops};

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
