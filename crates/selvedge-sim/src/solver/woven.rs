//! An incomplete factorisation of the system matrix with the couplings of all that touches (f32).
//!
//! The two sides of a contact are held together far more stiffly than the cloth holds either. A
//! factor that knows only the diagonal blocks of that takes what moves both sides together for as
//! stiff, and conjugate gradients need three or four times the iterations. So the couplings are
//! woven into the pattern, and the factor keeps all blocks of it, with what eliminations change in
//! them (Meijerink and van der Vorst 1977): P = L Lᵀ. A product X Yᵀ for which the pattern has no
//! block is dropped; its bound goes onto the two diagonal blocks, as |Y|/|X| X Xᵀ and |X|/|Y| Y Yᵀ
//! (Ajiz and Jennings 1984), so that pivots stay positive however stiff a contact is. `[eq:contact-fill]`
//!
//! A product with the matrix costs as much as both triangular solves: there is no trick that saves
//! it, as for [`crate::solver::gauss_seidel`].

use glam::{DMat3, Mat3A, Vec3A};

use crate::contact::to_single;
use crate::solver::gauss_seidel::{gathered, inverse_root};
use crate::solver::pattern::Pattern;

/// Smallest ratio of a pivot to its diagonal entry: rounding is below. Below it, the block of the
/// matrix itself is taken. A touch is up to 9000 times as stiff along its normal as across.
const LEAST_PIVOT: f32 = 1e-5;

/// The matrix and its factor, by columns.
#[derive(Default)]
pub(crate) struct Woven {
    /// Per column, start of its blocks below the diagonal in the lists that follow.
    starts: Vec<u32>,
    rows: Vec<u32>,
    /// Blocks of the matrix, and of L.
    blocks: Vec<Mat3A>,
    lower: Vec<Mat3A>,
    /// Blocks of the matrix on the diagonal, `[unknowns]`.
    diagonal: Vec<Mat3A>,
    /// C⁻¹ of each block C Cᵀ on the diagonal of P, `[unknowns]`.
    inverse: Vec<Mat3A>,
    /// Couplings by column: where those of each column end, and row and block of each, in their own order.
    ends: Vec<u32>,
    couplings: Vec<(u32, Mat3A)>,
    /// Rows of a column that the pattern does not have.
    added: Vec<u32>,
    /// While a column is eliminated, 1 + the place of its block in each row; else 0.
    places: Vec<u32>,
    /// Size of each block of the column, and of all others whose products with it are dropped.
    sizes: Vec<f32>,
    dropped: Vec<f32>,
}

impl Woven {
    /// Takes the matrix with these `blocks` (by slot of `pattern`), and in addition `couplings` of
    /// two vertices each `[kg]`, times `scale`, and factorises it.
    pub(crate) fn factorise(
        &mut self,
        pattern: &Pattern,
        blocks: &[Mat3A],
        couplings: impl Iterator<Item = ([u32; 2], DMat3)> + Clone,
        scale: f64,
    ) {
        let count = pattern.unknown_count();
        let couplings = couplings.filter_map(|(vertices, block)| {
            let [a, b] = vertices.map(|v| pattern.unknown(v));
            let is_free = (a.max(b) as usize) < count;
            is_free.then(|| ((a.min(b), a.max(b)), block))
        });
        self.sort_by_column(count, couplings, scale);
        self.take(pattern, blocks);
        self.eliminate();
    }

    /// Takes the couplings, column by column.
    fn sort_by_column(
        &mut self,
        count: usize,
        couplings: impl Iterator<Item = ((u32, u32), DMat3)> + Clone,
        scale: f64,
    ) {
        self.ends.clear();
        self.ends.resize(count + 1, 0);
        for ((column, _), _) in couplings.clone() {
            self.ends[column as usize + 1] += 1;
        }
        let mut sum = 0;
        for end in &mut self.ends {
            sum += *end;
            *end = sum;
        }
        self.couplings.clear();
        self.couplings.resize(sum as usize, (0, Mat3A::ZERO));
        // Each column's begin goes to its end, which is the next one's begin.
        for ((column, row), block) in couplings {
            let next = &mut self.ends[column as usize];
            self.couplings[*next as usize] = (row, to_single(block * scale));
            *next += 1;
        }
    }

    /// Takes the blocks of the pattern and those of the couplings.
    fn take(&mut self, pattern: &Pattern, blocks: &[Mat3A]) {
        let count = pattern.unknown_count();
        self.diagonal.clear();
        self.diagonal.extend_from_slice(&blocks[..count]);
        self.starts.clear();
        self.starts.push(0);
        self.rows.clear();
        self.blocks.clear();
        self.places.clear();
        self.places.resize(count, 0);
        let mut first = 0;
        for column in 0..count {
            let last = self.ends[column] as usize;
            let own = &self.couplings[std::mem::replace(&mut first, last)..last];
            let start = self.rows.len();
            for (_, row) in pattern.below(column) {
                self.places[row as usize] = u32::MAX;
            }
            self.added.clear();
            for (row, _) in own {
                let place = &mut self.places[*row as usize];
                if *place == 0 {
                    *place = u32::MAX;
                    self.added.push(*row);
                }
            }
            self.added.sort_unstable();
            let mut added = self.added.iter().copied().peekable();
            for (slot, row) in pattern.below(column) {
                while let Some(new) = added.next_if(|new| *new < row) {
                    self.rows.push(new);
                    self.blocks.push(Mat3A::ZERO);
                }
                self.rows.push(row);
                self.blocks.push(blocks[slot as usize]);
            }
            self.rows.extend(added);
            self.blocks.resize(self.rows.len(), Mat3A::ZERO);
            for (k, row) in (start as u32..).zip(&self.rows[start..]) {
                self.places[*row as usize] = k;
            }
            for (row, block) in own {
                self.blocks[self.places[*row as usize] as usize] += *block;
            }
            for row in &self.rows[start..] {
                self.places[*row as usize] = 0;
            }
            self.starts.push(self.rows.len() as u32);
        }
    }

    #[inline]
    fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.starts[column] as usize..self.starts[column + 1] as usize
    }

    fn eliminate(&mut self) {
        let count = self.diagonal.len();
        self.lower.clone_from(&self.blocks);
        // Holds the blocks of P on the diagonal while they are being formed.
        self.inverse.clone_from(&self.diagonal);
        for column in 0..count {
            let inverse = inverse_root(self.inverse[column], LEAST_PIVOT)
                .or_else(|| inverse_root(self.diagonal[column], 0.0))
                .unwrap_or(Mat3A::IDENTITY);
            self.inverse[column] = inverse;
            let across = inverse.transpose();
            let range = self.column(column);
            let first = range.start;
            self.sizes.clear();
            for k in range.clone() {
                self.lower[k] *= across;
                self.places[self.rows[k] as usize] = k as u32 + 1;
                self.sizes.push(size(&self.lower[k]));
            }
            let all: f32 = self.sizes.iter().sum();
            self.dropped.clear();
            self.dropped.extend(self.sizes.iter().map(|own| all - own));
            for k in range.clone() {
                let across = self.lower[k].transpose();
                for e in self.column(self.rows[k] as usize) {
                    let place = self.places[self.rows[e] as usize] as usize;
                    if place > 0 {
                        let other = place - 1;
                        let change = self.lower[other] * across;
                        self.lower[e] -= change;
                        self.dropped[k - first] -= self.sizes[other - first];
                        self.dropped[other - first] -= self.sizes[k - first];
                    }
                }
            }
            for k in range.clone() {
                let (row, half) = (self.rows[k] as usize, self.lower[k]);
                let (own, dropped) = (self.sizes[k - first], self.dropped[k - first]);
                if own > 0.0 {
                    let part = 1.0 - dropped.max(0.0) / own;
                    self.inverse[row] -= half * half.transpose() * part;
                }
                self.places[row] = 0;
            }
        }
    }

    /// Replaces `vector` by L⁻¹ of it.
    pub(crate) fn solve_lower(&self, vector: &mut [Vec3A]) {
        for column in 0..vector.len() {
            let known = self.inverse[column] * vector[column];
            vector[column] = known;
            let range = self.column(column);
            for (block, row) in self.lower[range.clone()].iter().zip(&self.rows[range]) {
                vector[*row as usize] -= *block * known;
            }
        }
    }

    /// Replaces `vector` by L⁻ᵀ of it.
    pub(crate) fn solve_upper(&self, vector: &mut [Vec3A]) {
        for column in (0..vector.len()).rev() {
            let range = self.column(column);
            let sum = gathered(&self.lower[range.clone()], &self.rows[range], vector);
            vector[column] = self.inverse[column].transpose() * (vector[column] - sum);
        }
    }

    /// `product` = L⁻¹ A `solved`.
    pub(crate) fn multiply(&self, solved: &[Vec3A], product: &mut [Vec3A]) {
        for (column, product) in product.iter_mut().enumerate() {
            let range = self.column(column);
            *product = self.diagonal[column] * solved[column]
                + gathered(&self.blocks[range.clone()], &self.rows[range], solved);
        }
        for (column, own) in solved.iter().enumerate() {
            let range = self.column(column);
            for (block, row) in self.blocks[range.clone()].iter().zip(&self.rows[range]) {
                product[*row as usize] += *block * *own;
            }
        }
        self.solve_lower(product);
    }
}

/// Root of the sum of squares.
#[inline]
fn size(block: &Mat3A) -> f32 {
    let squares =
        block.x_axis * block.x_axis + block.y_axis * block.y_axis + block.z_axis * block.z_axis;
    squares.element_sum().sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::gauss_seidel::tests;
    use crate::solver::ordering::Ordering;
    use glam::DVec3;

    /// Two strips of triangles, one over the other, that nothing joins.
    fn strips(count: u32) -> (Pattern, Vec<Mat3A>) {
        let strip = |first: u32| (first + 2..first + count).map(|k| [k - 2, k - 1, k]);
        let triangles: Vec<[u32; 3]> = strip(0).chain(strip(count)).collect();
        let held = vec![false; 2 * count as usize];
        let pattern = Pattern::new(Ordering::Banded, &held, &triangles, &[]);
        let mut blocks = vec![Mat3A::IDENTITY * 0.1; pattern.slot_count()];
        for column in 0..pattern.unknown_count() {
            for (slot, row) in pattern.below(column) {
                blocks[slot as usize] = Mat3A::IDENTITY * -3.0;
                blocks[column] += Mat3A::IDENTITY * 3.0;
                blocks[row as usize] += Mat3A::IDENTITY * 3.0;
            }
        }
        (pattern, blocks)
    }

    /// Springs of this stiffness between the strips, vertex by vertex. Their part of the diagonal
    /// goes into `blocks`.
    fn springs(stiffness: f64, pattern: &Pattern, blocks: &mut [Mat3A]) -> Vec<([u32; 2], DMat3)> {
        let count = pattern.unknown_count() as u32 / 2;
        let normal = |k: u32| DVec3::new(0.2 * f64::from(k).sin(), 1.0, 0.3).normalize();
        let spring = |k: u32| {
            let n = normal(k);
            DMat3::from_cols(n * n.x, n * n.y, n * n.z) * stiffness
        };
        for k in 0..count {
            for v in [k, k + count] {
                blocks[pattern.unknown(v) as usize] += to_single(spring(k));
            }
        }
        (0..count).map(|k| ([k, k + count], -spring(k))).collect()
    }

    /// The matrix itself times a vector.
    fn times(
        pattern: &Pattern,
        blocks: &[Mat3A],
        springs: &[([u32; 2], DMat3)],
        vector: &[Vec3A],
    ) -> Vec<Vec3A> {
        let mut product = tests::times(pattern, blocks, vector);
        for (vertices, block) in springs {
            let [a, b] = vertices.map(|v| pattern.unknown(v) as usize);
            product[a] += to_single(*block) * vector[b];
            product[b] += to_single(*block).transpose() * vector[a];
        }
        product
    }

    fn dot(a: &[Vec3A], b: &[Vec3A]) -> f64 {
        a.iter().zip(b).map(|(a, b)| f64::from(a.dot(*b))).sum()
    }

    #[test]
    fn product_is_that_of_the_whole_matrix() {
        let (pattern, mut blocks) = strips(9);
        let springs = springs(50.0, &pattern, &mut blocks);
        let mut woven = Woven::default();
        // Twice, as the lists are kept.
        woven.factorise(&pattern, &blocks, springs[..4].iter().copied(), 1.0);
        woven.factorise(&pattern, &blocks, springs.iter().copied(), 1.0);
        let p = tests::wave(18);
        let mut found = vec![Vec3A::ZERO; 18];
        woven.multiply(&p, &mut found);
        let mut expected = times(&pattern, &blocks, &springs, &p);
        woven.solve_lower(&mut expected);
        for (found, expected) in found.iter().zip(&expected) {
            assert!(found.distance(*expected) < 1e-4 * (1.0 + expected.length()));
        }
        // L⁻ᵀ is the transpose of L⁻¹.
        let (mut upper, mut lower) = (p.clone(), found.clone());
        woven.solve_upper(&mut upper);
        woven.solve_lower(&mut lower);
        let (one, other) = (dot(&upper, &found), dot(&p, &lower));
        assert!((one / other - 1.0).abs() < 1e-4, "{one} {other}");
    }
}
