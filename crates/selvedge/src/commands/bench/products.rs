//! The bare matrix products of a network, computed by a library: so that the roofline is not only
//! our own kernel's.

use faer::linalg::matmul::matmul;
use faer::{Accum, MatMut, MatRef, Par};
use selvedge_model::roofline::{BareProduct, ProductKind, Roofline};

/// The products of a list, ours and faer's, over the same sizes.
pub(crate) struct Products {
    ours: Roofline,
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
            ours: Roofline::new(list),
            par: if threads > 1 {
                Par::rayon(threads)
            } else {
                Par::Seq
            },
        }
    }

    /// Everything once, by our kernel.
    pub(crate) fn ours(&mut self) {
        self.ours.run();
    }

    /// Everything once, by faer.
    pub(crate) fn faer(&mut self) {
        for product in self.ours.products() {
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
