//! Block symmetric Gauss-Seidel by tiles of neighbouring unknowns as preconditioner, and the product
//! with the matrix that it preconditions (f32).
//!
//! P = (D + L) D⁻¹ (D + L)ᵀ, D = C Cᵀ the blocks on the diagonal over ω, and L those below it within a
//! tile: symmetric over-relaxation, P/(2 - ω) near A. It is positive definite whatever L is. Scaled by C⁻¹ from the left and C⁻ᵀ from the right, D
//! becomes the identity and P (I + L)(I + L)ᵀ. The preconditioned matrix (I + L)⁻¹ A (I + L)⁻ᵀ costs
//! no more than its two triangular solves, because they contain all of A except a multiple of its
//! diagonal (Eisenstat 1981). Blocks that couple tiles are left out of P, not out of A. The size of a tile
//! depends on the cloth, not on the number of threads.
//!
//! An scaled factor, which puts a part of the effects of each elimination into D (Meijerink and
//! van der Vorst 1981), needs 5 to 12 % fewer iterations on most cloths. But its pivots are not
//! bounded for this matrix: stiff denim needed 10,000 iterations in one of fifty swings, and a
//! cloth of 3 mm edges 160 in place of 23.

use glam::{Mat3A, Vec3A};

use crate::solver::pattern::Pattern;
use crate::threads::Threads;

/// Smallest number of unknowns of a tile. Few tiles lose few couplings.
const SMALLEST_TILE: usize = 2048;
/// Largest number of tiles of a cloth.
const MOST_TILES: usize = 8;
/// Over-relaxation ω: with 1 iterations are 3, 5 and 11 % more at 400, 1024 and 4096 vertices, with
/// 1.5 as many.
pub(crate) const OVER_RELAXATION: f32 = 1.25;

/// The scaled matrix in tiles.
pub(crate) struct GaussSeidel {
    /// Unknowns of a tile; the last may have fewer.
    tile: usize,
    tiles: Vec<Tile>,
    /// C⁻¹ of each unknown.
    scaling: Vec<Mat3A>,
}

/// Part of the matrix: consecutive rows and columns.
struct Tile {
    first: usize,
    /// Per column, blocks below the diagonal within the tile: start, rows from `first`, slots.
    starts: Vec<u32>,
    rows: Vec<u32>,
    slots: Vec<u32>,
    /// L, scaled.
    lower: Vec<Mat3A>,
    /// Number of its unknowns.
    count: usize,
    /// Per row, start in `across` of the blocks that couple it to other tiles.
    across_starts: Vec<u32>,
    across: Vec<Across>,
    across_blocks: Vec<Mat3A>,
}

/// A block that couples two tiles.
#[derive(Clone, Copy)]
struct Across {
    column: u32,
    slot: u32,
    side: Side,
}

/// Side of the diagonal on which a block stands.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Side {
    Lower,
    Upper,
}

pub(crate) fn tile_of(count: usize) -> usize {
    SMALLEST_TILE.max(count.div_ceil(MOST_TILES))
}

impl GaussSeidel {
    /// Room for matrices of this pattern, in tiles of `tile` unknowns.
    pub(crate) fn new(tile: usize, pattern: &Pattern) -> Self {
        let count = pattern.unknown_count();
        let mut tiles: Vec<Tile> = (0..count)
            .step_by(tile)
            .map(|first| Tile::new(first, tile.min(count - first)))
            .collect();
        let mut across = vec![Vec::new(); count];
        for column in 0..count {
            let own = &mut tiles[column / tile];
            for (slot, row) in pattern.below(column) {
                if row as usize / tile == column / tile {
                    own.rows.push(row - own.first as u32);
                    own.slots.push(slot);
                } else {
                    let entry = |column: u32, side| Across { column, slot, side };
                    across[row as usize].push(entry(column as u32, Side::Lower));
                    across[column].push(entry(row, Side::Upper));
                }
            }
            own.starts.push(own.rows.len() as u32);
        }
        for (row, entries) in across.into_iter().enumerate() {
            let own = &mut tiles[row / tile];
            own.across.extend(entries);
            own.across_starts.push(own.across.len() as u32);
        }
        for own in &mut tiles {
            own.lower = vec![Mat3A::ZERO; own.rows.len()];
            own.across_blocks = vec![Mat3A::ZERO; own.across.len()];
        }
        Self {
            tile,
            tiles,
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
        let scaling = &self.scaling;
        threads.each_large(&mut self.tiles, |tile| tile.take(blocks, scaling));
        is_definite
    }

    /// C⁻¹ of each unknown.
    pub(crate) fn scaling(&self) -> &[Mat3A] {
        &self.scaling
    }

    /// Replaces each tile's part of `vector` by (I + L)⁻¹ of it.
    pub(crate) fn solve_lower(&mut self, threads: Threads, vector: &mut [Vec3A]) {
        threads.each_share(&mut self.tiles, vector, self.tile, |tile, vector| {
            tile.solve_lower(vector);
        });
    }

    /// Replaces each tile's part of `vector` by (I + L)⁻ᵀ of it.
    pub(crate) fn solve_upper(&mut self, threads: Threads, vector: &mut [Vec3A]) {
        threads.each_share(&mut self.tiles, vector, self.tile, |tile, vector| {
            tile.solve_upper(vector);
        });
    }

    /// `product` = (I + L)⁻¹ A (I + L)⁻ᵀ p, given p and `solved` = (I + L)⁻ᵀ p:
    /// solved + (I + L)⁻¹ (p + (K - (2 - ω) I) solved), K the couplings of tiles. `[eq:eisenstat]`
    pub(crate) fn multiply(
        &mut self,
        threads: Threads,
        p: &[Vec3A],
        solved: &[Vec3A],
        product: &mut [Vec3A],
    ) {
        threads.each_share(&mut self.tiles, product, self.tile, |tile, product| {
            tile.multiply(p, solved, product);
        });
    }
}

impl Tile {
    fn new(first: usize, count: usize) -> Self {
        Self {
            first,
            starts: vec![0],
            rows: Vec::new(),
            slots: Vec::new(),
            lower: Vec::new(),
            count,
            across_starts: vec![0],
            across: Vec::new(),
            across_blocks: Vec::new(),
        }
    }

    #[inline]
    fn column(&self, column: usize) -> std::ops::Range<usize> {
        self.starts[column] as usize..self.starts[column + 1] as usize
    }

    fn take(&mut self, blocks: &[Mat3A], scaling: &[Mat3A]) {
        for column in 0..self.count {
            let right = scaling[self.first + column].transpose();
            for k in self.column(column) {
                let left = scaling[self.first + self.rows[k] as usize];
                self.lower[k] = left * blocks[self.slots[k] as usize] * right;
            }
        }
        for row in 0..self.count {
            let range = self.across_starts[row] as usize..self.across_starts[row + 1] as usize;
            for (entry, block) in self.across[range.clone()]
                .iter()
                .zip(&mut self.across_blocks[range])
            {
                let given = blocks[entry.slot as usize];
                let given = match entry.side {
                    Side::Lower => given,
                    Side::Upper => given.transpose(),
                };
                let right = scaling[entry.column as usize].transpose();
                *block = scaling[self.first + row] * given * right;
            }
        }
    }

    fn solve_lower(&self, vector: &mut [Vec3A]) {
        for column in 0..vector.len() {
            let known = vector[column];
            let range = self.column(column);
            for (block, row) in self.lower[range.clone()].iter().zip(&self.rows[range]) {
                vector[*row as usize] -= *block * known;
            }
        }
    }

    fn solve_upper(&self, vector: &mut [Vec3A]) {
        for column in (0..vector.len()).rev() {
            let range = self.column(column);
            vector[column] -= gathered(&self.lower[range.clone()], &self.rows[range], vector);
        }
    }

    fn multiply(&self, p: &[Vec3A], solved: &[Vec3A], product: &mut [Vec3A]) {
        let rows = self.first..self.first + product.len();
        let (p, own) = (&p[rows.clone()], &solved[rows]);
        for row in 0..product.len() {
            let mut sum = p[row] - own[row] * (2.0 - OVER_RELAXATION);
            let range = self.across_starts[row] as usize..self.across_starts[row + 1] as usize;
            for (entry, block) in self.across[range.clone()]
                .iter()
                .zip(&self.across_blocks[range])
            {
                sum += *block * solved[entry.column as usize];
            }
            product[row] = sum;
        }
        self.solve_lower(product);
        for (product, own) in product.iter_mut().zip(own) {
            *product += *own;
        }
    }
}

/// Sum of the transposed `blocks` of a column times the entries of `vector` in their `rows`.
#[inline]
pub(super) fn gathered(blocks: &[Mat3A], rows: &[u32], vector: &[Vec3A]) -> Vec3A {
    let mut sums = Mat3A::ZERO;
    for (block, row) in blocks.iter().zip(rows) {
        let known = vector[*row as usize];
        sums.x_axis += block.x_axis * known;
        sums.y_axis += block.y_axis * known;
        sums.z_axis += block.z_axis * known;
    }
    let sums = sums.transpose();
    sums.x_axis + sums.y_axis + sums.z_axis
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
pub(super) mod tests {
    use super::*;
    use crate::solver::ordering::Ordering;

    /// A chain of triangles and its blocks: diagonally dominant, not symmetric block by block.
    fn chain(count: u32) -> (Pattern, Vec<Mat3A>) {
        let triangles: Vec<[u32; 3]> = (2..count).map(|k| [k - 2, k - 1, k]).collect();
        let held = vec![false; count as usize];
        let pattern = Pattern::new(Ordering::Banded, &held, &triangles, &[]);
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
    pub(crate) fn times(pattern: &Pattern, blocks: &[Mat3A], vector: &[Vec3A]) -> Vec<Vec3A> {
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

    pub(crate) fn wave(count: usize) -> Vec<Vec3A> {
        let t = (0..count).map(|k| k as f32);
        t.map(|t| Vec3A::new(t.sin(), (1.7 * t).cos(), (0.3 * t).sin()))
            .collect()
    }

    #[test]
    fn product_is_that_of_the_whole_matrix_whatever_the_tiles() {
        let (pattern, blocks) = chain(23);
        for tile in [23, 8, 5, 1] {
            let mut scaled = GaussSeidel::new(tile, &pattern);
            assert!(scaled.take(Threads::One, &blocks));
            let p = wave(23);
            let mut solved = p.clone();
            scaled.solve_upper(Threads::One, &mut solved);
            let mut found = vec![Vec3A::ZERO; 23];
            scaled.multiply(Threads::One, &p, &solved, &mut found);
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
                assert!(found.distance(*expected) < 1e-5, "tiles of {tile}");
            }
        }
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
