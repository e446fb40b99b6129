//! Block symmetric Gauss-Seidel as preconditioner, and the product with the matrix that it
//! preconditions (f32).
//!
//! P = (D + L) D⁻¹ (D + L)ᵀ, D = C Cᵀ the blocks on the diagonal over ω, and L those below it:
//! symmetric over-relaxation, P/(2 - ω) near A. It is positive definite whatever L is. Scaled by C⁻¹
//! from the left and C⁻ᵀ from the right, D becomes the identity and P (I + L)(I + L)ᵀ. The
//! preconditioned matrix (I + L)⁻¹ A (I + L)⁻ᵀ costs no more than its two triangular solves, because
//! they contain all of A except a multiple of its diagonal (Eisenstat 1981).
//!
//! The unknowns are in parts that nothing couples, and a separator after them
//! ([`crate::solver::ordering`]): the triangular solves of the parts run side by side. How many
//! there are depends on the cloth, not on the number of threads.
//!
//! A scaled factor, which puts a part of the effects of each elimination into D (Meijerink and
//! van der Vorst 1981), needs 5 to 12 % fewer iterations on most cloths. But its pivots are not
//! bounded for this matrix: stiff denim needed 10,000 iterations in one of fifty swings, and a
//! cloth of 3 mm edges 160 in place of 23.

use std::ops::Range;

use glam::{Mat3A, Vec3A};

use crate::solver::pattern::Pattern;
use crate::solver::vectors::{Vectors, dot, go, turn};
use crate::threads::Threads;

/// Over-relaxation ω: with 1 iterations are 3, 5 and 11 % more at 400, 1024 and 4096 vertices, with
/// 1.5 as many.
pub(crate) const OVER_RELAXATION: f32 = 1.25;

/// The scaled matrix in parts.
pub(crate) struct GaussSeidel {
    parts: Vec<Part>,
    separator: Separator,
    /// End of each part.
    ends: Vec<usize>,
    /// C⁻¹ of each unknown.
    scaling: Vec<Mat3A>,
}

/// Consecutive columns of L, scaled.
struct Part {
    rows: Range<usize>,
    /// Start of the blocks of each column, rows ascending.
    starts: Vec<u32>,
    /// In each column, start of the blocks in rows of the separator.
    beyond: Vec<u32>,
    /// Rows of the blocks, counted from the first of the part or of the separator.
    block_rows: Vec<u32>,
    slots: Vec<u32>,
    lower: Vec<Mat3A>,
    /// Its part of the last sum over all unknowns.
    sum: f64,
}

/// Unknowns that couple the parts.
struct Separator {
    part: Part,
    /// Per row, start of the blocks in columns of the parts.
    starts: Vec<u32>,
    columns: Vec<u32>,
    slots: Vec<u32>,
    blocks: Vec<Mat3A>,
}

impl GaussSeidel {
    /// Room for matrices of this pattern.
    pub(crate) fn new(pattern: &Pattern) -> Self {
        let (count, ends) = (pattern.unknown_count(), pattern.part_ends().to_vec());
        let first_beyond = ends.last().copied().unwrap_or(0);
        let firsts = [0].into_iter().chain(ends.iter().copied());
        let parts = firsts.zip(&ends);
        let part = |rows: Range<usize>| Part::new(rows, first_beyond, pattern);
        let parts: Vec<_> = parts.map(|(first, &end)| part(first..end)).collect();
        Self {
            separator: Separator::new(part(first_beyond..count), pattern),
            parts,
            ends,
            scaling: vec![Mat3A::IDENTITY; count],
        }
    }

    /// Takes the matrix with these `blocks`, by slot. Returns false if a block of its diagonal is not
    /// positive definite.
    pub(crate) fn take(&mut self, threads: Threads, blocks: &[Mat3A]) -> bool {
        let mut is_definite = true;
        for (scaling, block) in self.scaling.iter_mut().zip(blocks) {
            let root = inverse_root(*block, 0.0).unwrap_or_else(|| {
                // What is not finite is named by the residual.
                is_definite &= !block.is_finite();
                Mat3A::IDENTITY
            });
            *scaling = root * OVER_RELAXATION.sqrt();
        }
        let (scaling, first) = (&self.scaling, self.separator.part.rows.start);
        threads.each_large(&mut self.parts, |part| part.take(blocks, scaling, first));
        self.separator.take(blocks, scaling);
        is_definite
    }

    /// C⁻¹ of each unknown.
    pub(crate) fn scaling(&self) -> &[Mat3A] {
        &self.scaling
    }

    /// Replaces `vector` by (I + L)⁻¹ of it.
    pub(crate) fn solve_lower(&mut self, threads: Threads, vector: &mut [Vec3A]) {
        threads.each_part(
            &mut self.parts,
            [&mut *vector],
            &self.ends,
            |part, [vector]| {
                part.solve_lower(vector);
            },
        );
        self.separator.solve_lower(vector);
    }

    /// Replaces `vector` by (I + L)⁻ᵀ of it.
    pub(crate) fn solve_upper(&mut self, threads: Threads, vector: &mut [Vec3A]) {
        let (within, beyond) = vector.split_at_mut(self.separator.part.rows.start);
        self.separator.part.solve_upper(beyond, &[]);
        let beyond = &*beyond;
        threads.each_part(&mut self.parts, [within], &self.ends, |part, [vector]| {
            part.solve_upper(vector, beyond);
        });
    }

    /// The next direction, residual + `factor` · direction, and (I + L)⁻ᵀ of it.
    pub(crate) fn turn(&mut self, threads: Threads, factor: f32, vectors: &mut Vectors) {
        let Vectors {
            residual,
            direction,
            solved,
            ..
        } = vectors;
        let first = self.separator.part.rows.start;
        let (direction, direction_beyond) = direction.split_at_mut(first);
        let (solved, beyond) = solved.split_at_mut(first);
        turn(factor, &residual[first..], direction_beyond, beyond);
        self.separator.part.solve_upper(beyond, &[]);
        let (beyond, vectors) = (&*beyond, [direction, solved]);
        threads.each_part(
            &mut self.parts,
            vectors,
            &self.ends,
            |part, [direction, solved]| {
                turn(factor, &residual[part.rows.clone()], direction, solved);
                part.solve_upper(solved, beyond);
            },
        );
    }

    /// `product` + `solved` = (I + L)⁻¹ A (I + L)⁻ᵀ p, given the direction p and `solved` =
    /// (I + L)⁻ᵀ p: `product` = (I + L)⁻¹ (p - (2 - ω) solved). `[eq:eisenstat]` Gives p times it.
    pub(crate) fn multiply(&mut self, threads: Threads, vectors: &mut Vectors) -> f64 {
        let Vectors {
            direction,
            solved,
            product,
            ..
        } = vectors;
        threads.each_part(
            &mut self.parts,
            [&mut *product],
            &self.ends,
            |part, [product]| {
                let [p, solved] = [&*direction, &*solved].map(|whole| &whole[part.rows.clone()]);
                begin_product(p, solved, product);
                part.solve_lower(product);
                part.sum = curvature(p, solved, product);
            },
        );
        let rows = self.separator.part.rows.clone();
        let [p, solved] = [&*direction, &*solved].map(|whole| &whole[rows.clone()]);
        begin_product(p, solved, &mut product[rows.clone()]);
        self.separator.solve_lower(product);
        self.sum() + curvature(p, solved, &product[rows])
    }

    /// Goes `step` along the direction. Gives the size squared of the residual there.
    pub(crate) fn go(&mut self, threads: Threads, step: f32, vectors: &mut Vectors) -> f64 {
        let (direction, solved, product) = (&vectors.direction, &vectors.solved, &vectors.product);
        let advance = |rows: Range<usize>, changing: [&mut [Vec3A]; 2]| {
            let [product, solved] = [product, solved].map(|whole| &whole[rows.clone()]);
            go(step, &direction[rows], |k| product[k] + solved[k], changing)
        };
        let first = self.separator.part.rows.start;
        let (solution, solution_beyond) = vectors.solution.split_at_mut(first);
        let (residual, residual_beyond) = vectors.residual.split_at_mut(first);
        let (parts, changing) = (&mut self.parts, [solution, residual]);
        threads.each_part(parts, changing, &self.ends, |part, changing| {
            part.sum = advance(part.rows.clone(), changing);
        });
        let rows = self.separator.part.rows.clone();
        self.sum() + advance(rows, [solution_beyond, residual_beyond])
    }

    /// Sum over the parts of what each has found.
    fn sum(&self) -> f64 {
        self.parts.iter().map(|part| part.sum).sum()
    }
}

/// p - (2 - ω) `solved`.
fn begin_product(p: &[Vec3A], solved: &[Vec3A], product: &mut [Vec3A]) {
    for (product, (p, solved)) in product.iter_mut().zip(p.iter().zip(solved)) {
        *product = *p - *solved * (2.0 - OVER_RELAXATION);
    }
}

/// p · (`product` + `solved`).
fn curvature(p: &[Vec3A], solved: &[Vec3A], product: &[Vec3A]) -> f64 {
    let sums = product.iter().zip(solved).map(|(y, x)| *y + *x);
    dot(p, sums)
}

impl Part {
    fn new(rows: Range<usize>, first_beyond: usize, pattern: &Pattern) -> Self {
        let mut part = Self {
            starts: vec![0],
            beyond: Vec::new(),
            block_rows: Vec::new(),
            slots: Vec::new(),
            lower: Vec::new(),
            sum: 0.0,
            rows,
        };
        for column in part.rows.clone() {
            let mut within = 0;
            for (slot, row) in pattern.below(column) {
                let row = row as usize;
                let is_within = row < part.rows.end;
                within += u32::from(is_within);
                let first = if is_within {
                    part.rows.start
                } else {
                    first_beyond
                };
                part.block_rows.push((row - first) as u32);
                part.slots.push(slot);
            }
            part.beyond.push(part.starts[part.beyond.len()] + within);
            part.starts.push(part.block_rows.len() as u32);
        }
        part.lower = vec![Mat3A::ZERO; part.slots.len()];
        part
    }

    /// Blocks of a column in rows of the part, and in rows of the separator.
    #[inline]
    fn column(&self, column: usize) -> [Range<usize>; 2] {
        let beyond = self.beyond[column] as usize;
        let [start, end] = [column, column + 1].map(|k| self.starts[k] as usize);
        [start..beyond, beyond..end]
    }

    fn take(&mut self, blocks: &[Mat3A], scaling: &[Mat3A], first_beyond: usize) {
        for column in 0..self.rows.len() {
            let right = scaling[self.rows.start + column].transpose();
            for (range, first) in self
                .column(column)
                .into_iter()
                .zip([self.rows.start, first_beyond])
            {
                for k in range {
                    let left = scaling[first + self.block_rows[k] as usize];
                    self.lower[k] = left * blocks[self.slots[k] as usize] * right;
                }
            }
        }
    }

    /// Replaces the part's entries by (I + L)⁻¹ of them, L within the part.
    fn solve_lower(&self, vector: &mut [Vec3A]) {
        for column in 0..vector.len() {
            let known = vector[column];
            let [within, _] = self.column(column);
            let rows = &self.block_rows[within.clone()];
            for (block, row) in self.lower[within].iter().zip(rows) {
                vector[*row as usize] -= *block * known;
            }
        }
    }

    /// Replaces the part's entries by (I + L)⁻ᵀ of them, given the solution `beyond` it, in the
    /// separator.
    fn solve_upper(&self, vector: &mut [Vec3A], beyond: &[Vec3A]) {
        for column in (0..vector.len()).rev() {
            let [within, across] = self.column(column);
            let mut sums = Mat3A::ZERO;
            self.gather(within, vector, &mut sums);
            self.gather(across, beyond, &mut sums);
            let sums = sums.transpose();
            vector[column] -= sums.x_axis + sums.y_axis + sums.z_axis;
        }
    }

    #[inline(always)]
    fn gather(&self, blocks: Range<usize>, vector: &[Vec3A], sums: &mut Mat3A) {
        let rows = &self.block_rows[blocks.clone()];
        for (block, row) in self.lower[blocks].iter().zip(rows) {
            let known = vector[*row as usize];
            sums.x_axis += block.x_axis * known;
            sums.y_axis += block.y_axis * known;
            sums.z_axis += block.z_axis * known;
        }
    }
}

impl Separator {
    fn new(part: Part, pattern: &Pattern) -> Self {
        let first = part.rows.start;
        let mut across = vec![Vec::new(); part.rows.len()];
        for column in 0..first {
            for (slot, row) in pattern.below(column) {
                if row as usize >= first {
                    across[row as usize - first].push((column as u32, slot));
                }
            }
        }
        let (mut starts, mut columns, mut slots) = (vec![0], Vec::new(), Vec::new());
        for row in across {
            columns.extend(row.iter().map(|(column, _)| *column));
            slots.extend(row.iter().map(|(_, slot)| *slot));
            starts.push(columns.len() as u32);
        }
        Self {
            part,
            blocks: vec![Mat3A::ZERO; slots.len()],
            starts,
            columns,
            slots,
        }
    }

    #[inline]
    fn row(&self, row: usize) -> Range<usize> {
        self.starts[row] as usize..self.starts[row + 1] as usize
    }

    fn take(&mut self, blocks: &[Mat3A], scaling: &[Mat3A]) {
        self.part.take(blocks, scaling, 0);
        for row in 0..self.part.rows.len() {
            let left = scaling[self.part.rows.start + row];
            for k in self.row(row) {
                let right = scaling[self.columns[k] as usize].transpose();
                self.blocks[k] = left * blocks[self.slots[k] as usize] * right;
            }
        }
    }

    /// Solves its rows of the whole `vector`, whose parts are solved.
    fn solve_lower(&self, vector: &mut [Vec3A]) {
        let (within, own) = vector.split_at_mut(self.part.rows.start);
        for (row, entry) in own.iter_mut().enumerate() {
            let range = self.row(row);
            let columns = &self.columns[range.clone()];
            for (block, column) in self.blocks[range].iter().zip(columns) {
                *entry -= *block * within[*column as usize];
            }
        }
        self.part.solve_lower(own);
    }
}

/// C⁻¹ of a symmetric matrix C Cᵀ; none if a pivot is at most `least` of its diagonal entry.
pub(super) fn inverse_root(matrix: Mat3A, least: f32) -> Option<Mat3A> {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let root = |pivot: f32, of: f32| (pivot > least * of && of > 0.0).then(|| pivot.sqrt());
    let a = root(x.x, x.x)?;
    let (b, c) = (x.y / a, x.z / a);
    let d = root(y.y - b * b, y.y)?;
    let e = (y.z - b * c) / d;
    let f = root(z.z - c * c - e * e, z.z)?;
    // C = [a; b d; c e f]; its inverse is lower triangular too.
    let (ia, id, f) = (1.0 / a, 1.0 / d, 1.0 / f);
    Some(Mat3A::from_cols(
        Vec3A::new(ia, -b * ia * id, (b * e * id - c) * ia * f),
        Vec3A::new(0.0, id, -e * id * f),
        Vec3A::new(0.0, 0.0, f),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::ordering::Ordering;

    /// A chain of triangles and its blocks: diagonally dominant, not symmetric block by block.
    fn chain(count: u32, parts: usize) -> (Pattern, Vec<Mat3A>) {
        let triangles: Vec<[u32; 3]> = (2..count).map(|k| [k - 2, k - 1, k]).collect();
        let none: [[u32; 4]; 0] = [];
        let held = vec![false; count as usize];
        let ordering = Ordering::Banded { parts };
        let pattern = Pattern::new(ordering, &held, &triangles, &none).unwrap();
        let blocks = (0..pattern.slot_count())
            .map(|slot| {
                let t = slot as f32;
                let small = Mat3A::from_cols(
                    Vec3A::new(t.sin(), (2.0 * t).cos(), 0.3),
                    Vec3A::new(0.2, (3.0 * t).sin(), t.cos()),
                    Vec3A::new((1.3 * t).sin(), -0.4, (0.7 * t).cos()),
                ) * 0.3;
                if slot < pattern.unknown_count() {
                    (small + small.transpose()) * 0.3 + Mat3A::IDENTITY * 4.0
                } else {
                    small
                }
            })
            .collect();
        (pattern, blocks)
    }

    /// The matrix itself times a vector.
    fn times(pattern: &Pattern, blocks: &[Mat3A], vector: &[Vec3A]) -> Vec<Vec3A> {
        let mut product: Vec<Vec3A> = vector.iter().zip(blocks).map(|(v, b)| *b * *v).collect();
        for column in 0..vector.len() {
            for (slot, row) in pattern.below(column) {
                let (block, row) = (blocks[slot as usize], row as usize);
                product[row] += block * vector[column];
                product[column] += block.transpose() * vector[row];
            }
        }
        product
    }

    fn wave(count: usize) -> Vec<Vec3A> {
        let t = (0..count).map(|k| k as f32);
        t.map(|t| Vec3A::new(t.sin(), (1.7 * t).cos(), (0.3 * t).sin()))
            .collect()
    }

    #[test]
    fn product_is_that_of_the_whole_matrix_whatever_the_parts() {
        for parts in [1, 2, 3, 23] {
            let (pattern, blocks) = chain(23, parts);
            let mut scaled = GaussSeidel::new(&pattern);
            assert!(scaled.take(Threads::One, &blocks));
            let mut vectors = Vectors::new(23);
            vectors.residual = wave(23);
            scaled.turn(Threads::One, 0.0, &mut vectors);
            let curvature = scaled.multiply(Threads::One, &mut vectors);
            let Vectors {
                direction: p,
                solved,
                product,
                ..
            } = vectors;
            let found: Vec<Vec3A> = product.iter().zip(&solved).map(|(y, x)| *y + *x).collect();
            assert!((curvature - dot(&p, found.iter().copied())).abs() < 1e-5 * curvature);
            // (I + L)⁻¹ C⁻¹ A C⁻ᵀ (I + L)⁻ᵀ p step by step.
            let scaling = scaled.scaling().to_vec();
            let x: Vec<Vec3A> = solved
                .iter()
                .zip(&scaling)
                .map(|(x, s)| s.transpose() * *x)
                .collect();
            let ax = times(&pattern, &blocks, &x);
            let mut expected: Vec<Vec3A> = ax.iter().zip(&scaling).map(|(x, s)| *s * *x).collect();
            scaled.solve_lower(Threads::One, &mut expected);
            for (found, expected) in found.iter().zip(&expected) {
                // f32 rounding of sums of about ten terms of size 1.
                assert!(found.distance(*expected) < 1e-5, "{parts} parts");
            }
        }
    }

    #[test]
    fn triangular_solves_are_each_others_transposes() {
        let (pattern, blocks) = chain(23, 3);
        let mut scaled = GaussSeidel::new(&pattern);
        assert!(scaled.take(Threads::One, &blocks));
        let (a, b) = (wave(23), wave(23).into_iter().rev().collect::<Vec<_>>());
        let (mut lower, mut upper) = (a.clone(), b.clone());
        scaled.solve_lower(Threads::One, &mut lower);
        scaled.solve_upper(Threads::One, &mut upper);
        let dot =
            |x: &[Vec3A], y: &[Vec3A]| -> f32 { x.iter().zip(y).map(|(x, y)| x.dot(*y)).sum() };
        assert!((dot(&lower, &b) - dot(&a, &upper)).abs() < 1e-4);
    }

    #[test]
    fn inverse_root_undoes_its_matrix() {
        let root = Mat3A::from_cols(
            Vec3A::new(2.0, -0.5, 0.7),
            Vec3A::new(0.0, 1.5, 0.3),
            Vec3A::new(0.0, 0.0, 0.8),
        );
        let matrix = root * root.transpose();
        let inverse = inverse_root(matrix, 0.01).unwrap();
        assert!((inverse * root).abs_diff_eq(Mat3A::IDENTITY, 1e-6));
        assert_eq!(inverse_root(matrix * -1.0, 0.0), None);
        assert_eq!(inverse_root(matrix * f32::NAN, 0.0), None);
        // The last pivot is 0.64 of 1.22.
        assert_eq!(inverse_root(matrix, 0.6), None);
    }
}
