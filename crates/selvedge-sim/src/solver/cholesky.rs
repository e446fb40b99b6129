//! Sparse Cholesky factorisation A = L Lᵀ of the matrix of a cloth, in blocks of 3x3, and the
//! solution of A x = b.
//!
//! By columns, each from the finished ones before it that reach it ("left-looking"; Davis, "Direct
//! Methods for Sparse Linear Systems", 2006, chapter 4). The order of the unknowns already keeps
//! the factor sparse ([`crate::solver::ordering`]). After construction nothing is allocated. Products
//! are multiplied and added one by one, so that the bits are the same on every machine.

use glam::{DMat3, DVec3};
use pulp::{Arch, NullaryFnOnce};

use crate::lists::Lists;
use crate::solver::SolveError;
use crate::solver::pattern::Pattern;

/// Ends a list of columns.
const NONE: u32 = u32::MAX;

/// A block by columns, each with a fourth entry that fills a vector register.
#[derive(Clone, Copy, Default)]
#[repr(align(32))]
struct Block([[f64; 4]; 3]);

impl Block {
    fn of(matrix: DMat3) -> Self {
        Self([matrix.x_axis, matrix.y_axis, matrix.z_axis].map(|c| [c.x, c.y, c.z, 0.0]))
    }

    fn matrix(&self) -> DMat3 {
        let [x, y, z] = self.0.map(|[x, y, z, _]| DVec3::new(x, y, z));
        DMat3::from_cols(x, y, z)
    }

    /// Subtracts `left` · `right`ᵀ.
    #[inline(always)]
    fn subtract(&mut self, left: &Self, right: &Self) {
        for (column, own) in self.0.iter_mut().enumerate() {
            for (row, own) in own.iter_mut().enumerate() {
                let product = |k: usize| left.0[k][row] * right.0[k][column];
                *own -= product(0) + product(1) + product(2);
            }
        }
    }
}

/// A factorisation with its workspaces.
pub(crate) struct Cholesky {
    /// Rows of the blocks of L below the diagonal, by columns, ascending within each.
    rows: Lists,
    /// Place in L of each block of the matrix below the diagonal, in the order of its slots.
    places: Vec<u32>,
    /// Blocks of L below the diagonal.
    lower: Vec<Block>,
    /// C⁻¹ of each block C of L on the diagonal.
    inverse: Vec<DMat3>,
    /// Place of the block of each row in the column that is formed.
    place_of_row: Vec<u32>,
    /// First finished column whose next block is in this row, and the one that follows a column in
    /// such a list; [`NONE`] at its end.
    first: Vec<u32>,
    following: Vec<u32>,
    /// Place of the next block of each finished column.
    next: Vec<u32>,
}

impl Cholesky {
    /// Analyses matrices of this pattern.
    pub(crate) fn new(pattern: &Pattern) -> Self {
        let count = pattern.unknown_count();
        let rows = filled(pattern);
        let mut places = Vec::with_capacity(pattern.slot_count() - count);
        for column in 0..count {
            let mut filled = rows.range(column).zip(rows.of(column));
            for (_, row) in pattern.below(column) {
                let place = filled.find(|(_, other)| **other == row);
                places.extend(place.map(|(place, _)| place as u32));
            }
        }
        Self {
            lower: vec![Block::default(); rows.len()],
            rows,
            places,
            inverse: vec![DMat3::ZERO; count],
            place_of_row: vec![0; count],
            first: vec![NONE; count],
            following: vec![NONE; count],
            next: vec![0; count],
        }
    }

    /// Replaces `vector` b by the solution of A x = b, `[unknowns]`; A has these `blocks`, by slot
    /// of the pattern.
    pub(crate) fn solve(
        &mut self,
        blocks: &[DMat3],
        vector: &mut [DVec3],
    ) -> Result<(), SolveError> {
        Arch::new().dispatch(Factorise(self, blocks))?;
        for column in 0..vector.len() {
            let known = self.inverse[column] * vector[column];
            vector[column] = known;
            let range = self.rows.range(column);
            for (block, row) in self.lower[range].iter().zip(self.rows.of(column)) {
                vector[*row as usize] -= block.matrix() * known;
            }
        }
        for column in (0..vector.len()).rev() {
            let range = self.rows.range(column);
            let of_rows = self.lower[range].iter().zip(self.rows.of(column));
            let mut left = vector[column];
            for (block, row) in of_rows {
                left -= block.matrix().transpose() * vector[*row as usize];
            }
            vector[column] = self.inverse[column].transpose() * left;
        }
        Ok(())
    }

    #[inline(always)]
    fn factorise(&mut self, blocks: &[DMat3]) -> Result<(), SolveError> {
        let count = self.inverse.len();
        let (diagonal, below) = blocks.split_at(count);
        self.lower.fill(Block::default());
        for (place, block) in self.places.iter().zip(below) {
            self.lower[*place as usize] = Block::of(*block);
        }
        self.first.fill(NONE);
        for (column, own) in diagonal.iter().enumerate() {
            let range = self.rows.range(column);
            for (place, row) in (0..).zip(self.rows.of(column)) {
                self.place_of_row[*row as usize] = place;
            }
            let mut pivot = *own;
            let mut finished = self.first[column];
            while finished != NONE {
                let other = finished as usize;
                finished = self.following[other];
                pivot -= self.take_from(other, range.start);
            }
            let inverse = inverse_root(pivot).map_err(|axis| {
                let unknown = 3 * column + axis;
                let text = format!("the matrix is not positive definite at unknown {unknown}");
                SolveError::Failed(text)
            })?;
            self.inverse[column] = inverse;
            let across = inverse.transpose();
            for block in &mut self.lower[range.clone()] {
                *block = Block::of(block.matrix() * across);
            }
            self.wait(column, range.start);
        }
        Ok(())
    }

    /// Takes from the column that is formed what the finished column `other` makes below its
    /// diagonal, whose blocks `begin` there in L, and returns what it makes on it. `other` waits for
    /// its next row.
    #[inline(always)]
    fn take_from(&mut self, other: usize, begin: usize) -> DMat3 {
        let range = self.rows.range(other);
        let own = self.next[other] as usize;
        let rows = &self.rows.of(other)[own + 1 - range.start..];
        // Finished blocks lie before those of the column.
        let (finished, open) = self.lower.split_at_mut(begin);
        let across = finished[own];
        for (left, row) in finished[own + 1..range.end].iter().zip(rows) {
            open[self.place_of_row[*row as usize] as usize].subtract(left, &across);
        }
        self.wait(other, own + 1);
        let across = across.matrix();
        across * across.transpose()
    }

    /// Puts a finished column into the list of the row of its block at `place`, if it has one.
    fn wait(&mut self, column: usize, place: usize) {
        let begin = self.rows.range(column).start;
        if let Some(row) = self.rows.of(column).get(place - begin) {
            let row = *row as usize;
            self.next[column] = place as u32;
            self.following[column] = self.first[row];
            self.first[row] = column as u32;
        }
    }
}

/// [`Cholesky::factorise`], compiled for each kind of vectors.
struct Factorise<'a>(&'a mut Cholesky, &'a [DMat3]);

impl NullaryFnOnce for Factorise<'_> {
    type Output = Result<(), SolveError>;

    #[inline(always)]
    fn call(self) -> Self::Output {
        self.0.factorise(self.1)
    }
}

/// The rows of the factor's blocks below the diagonal: those of the matrix, and for each column
/// those of the columns whose first row it is.
fn filled(pattern: &Pattern) -> Lists {
    let count = pattern.unknown_count();
    let mut columns: Vec<Vec<u32>> = Vec::with_capacity(count);
    let mut children: Vec<Vec<u32>> = vec![Vec::new(); count];
    let mut pairs = Vec::new();
    for column in 0..count {
        let mut rows: Vec<u32> = pattern.below(column).map(|(_, row)| row).collect();
        for child in &children[column] {
            rows.extend_from_slice(&columns[*child as usize][1..]);
        }
        rows.sort_unstable();
        rows.dedup();
        pairs.extend(rows.iter().map(|row| (column as u32, *row)));
        if let Some(parent) = rows.first() {
            children[*parent as usize].push(column as u32);
        }
        columns.push(rows);
    }
    Lists::group(count, &pairs)
}

/// C⁻¹ of `matrix` = C Cᵀ, whose upper triangle is not read; else the axis whose pivot is not
/// positive.
fn inverse_root(matrix: DMat3) -> Result<DMat3, usize> {
    let [x, y, z] = [matrix.x_axis, matrix.y_axis, matrix.z_axis];
    let root = |pivot: f64, axis: usize| (pivot > 0.0).then(|| pivot.sqrt()).ok_or(axis);
    let a = root(x.x, 0)?;
    let (b, c) = (x.y / a, x.z / a);
    let d = root(y.y - b * b, 1)?;
    let e = (y.z - b * c) / d;
    let f = root(z.z - c * c - e * e, 2)?;
    // C = [a; b d; c e f]; its inverse is lower triangular too.
    let (ia, id, f) = (1.0 / a, 1.0 / d, 1.0 / f);
    Ok(DMat3::from_cols(
        DVec3::new(ia, -b * ia * id, (b * e * id - c) * ia * f),
        DVec3::new(0.0, id, -e * id * f),
        DVec3::new(0.0, 0.0, f),
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::ordering::Ordering;

    /// A grid of this many vertices a side, in triangles.
    fn grid(side: u32) -> Pattern {
        let square = |a: u32| [[a, a + side, a + side + 1], [a, a + side + 1, a + 1]];
        let rows = (0..side - 1).flat_map(|row| row * side..row * side + side - 1);
        let triangles: Vec<[u32; 3]> = rows.flat_map(square).collect();
        let held = vec![false; (side * side) as usize];
        Pattern::new(Ordering::Dissection, &held, &triangles, &[])
    }

    /// Blocks of a positive definite matrix.
    fn blocks(pattern: &Pattern) -> Vec<DMat3> {
        let entry = |slot: usize, row: usize, column: usize| {
            let small = ((7 * slot + 3 * row + 5 * column) as f64).sin();
            match (slot < pattern.unknown_count(), row == column) {
                (false, _) => 0.4 * small,
                (true, true) => 12.0 + small,
                (true, false) => 0.3 * ((slot + row + column) as f64).cos(),
            }
        };
        let block = |slot| [0, 1, 2].map(|column| [0, 1, 2].map(|row| entry(slot, row, column)));
        let slots = 0..pattern.slot_count();
        slots
            .map(|slot| DMat3::from_cols_array_2d(&block(slot)))
            .collect()
    }

    fn wave(count: usize) -> Vec<DVec3> {
        let at = |k: usize| DVec3::new((k as f64).sin(), 1.0, (2.0 * k as f64).cos());
        (0..count).map(at).collect()
    }

    #[test]
    fn indefinite_matrix_is_an_error_that_can_be_recovered_from() {
        let pattern = grid(3);
        let good = blocks(&pattern);
        let mut cholesky = Cholesky::new(&pattern);
        let mut spoilt = good.clone();
        spoilt[7].y_axis.y = -500.0;
        let text = "the matrix is not positive definite at unknown 22".to_owned();
        assert_eq!(
            cholesky.solve(&spoilt, &mut wave(9)),
            Err(SolveError::Failed(text))
        );
        spoilt[7].y_axis.y = f64::NAN;
        assert!(cholesky.solve(&spoilt, &mut wave(9)).is_err());
        let (mut recovered, mut expected) = (wave(9), wave(9));
        cholesky.solve(&good, &mut recovered).unwrap();
        Cholesky::new(&pattern).solve(&good, &mut expected).unwrap();
        assert_eq!(recovered, expected);
    }

    /// Row by row, eliminating a grid fills the band below each column: 21 blocks; a good order stays
    /// well below.
    #[test]
    fn elimination_order_keeps_a_grid_sparse() {
        let filled = Cholesky::new(&grid(20)).lower.len();
        assert!(filled < 15 * 400, "{filled} blocks");
    }
}
