//! Sparse Cholesky factorisation A = L Lᵀ of a symmetric matrix whose pattern never changes, and
//! the solution of A x = b (faer; supernodal, because its automatic choice is the slower one for
//! the matrices of a cloth).
//!
//! The order of the unknowns already keeps the factor sparse ([`crate::solver::pattern`]). After
//! construction nothing is allocated.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side, Spec};

use crate::solver::SolveError;

/// A factorisation with its workspaces.
pub(crate) struct Cholesky {
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    workspace: MemBuffer,
}

impl Cholesky {
    /// Analyses the lower triangle with these compressed columns (rows sorted within each).
    pub(crate) fn new(column_starts: Vec<usize>, rows: Vec<usize>) -> Result<Self, SolveError> {
        let unknowns = column_starts.len() - 1;
        let resources = |cause: &str| SolveError::resources(unknowns, cause);
        let pattern =
            SymbolicSparseColMat::new_checked(unknowns, unknowns, column_starts, None, rows);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        // In the given order faer analyses the upper triangle, whatever side it is told.
        let by_rows = pattern
            .to_row_major()
            .map_err(|cause| resources(&format!("{cause:?}")))?;
        let symbolic = factorize_symbolic_cholesky(
            by_rows.as_ref().transpose(),
            Side::Upper,
            SymmetricOrdering::Identity,
            parameters,
        )
        .map_err(|cause| resources(&format!("{cause:?}")))?;
        let request = StackReq::or(
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        );
        let workspace = MemBuffer::try_new(request).map_err(|_| resources("out of memory"))?;
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self {
            pattern,
            symbolic,
            factor,
            workspace,
        })
    }

    /// Replaces `right_side` b by the solution of A x = b. `values` are those of A in the order of
    /// the pattern.
    pub(crate) fn solve(
        &mut self,
        values: &[f64],
        right_side: &mut [f64],
    ) -> Result<(), SolveError> {
        let matrix = SparseColMatRef::new(self.pattern.as_ref(), values);
        self.symbolic
            .factorize_numeric_llt(
                &mut self.factor,
                matrix,
                Side::Lower,
                LltRegularization::default(),
                Par::Seq,
                MemStack::new(&mut self.workspace),
                Spec::default(),
            )
            .map_err(|LltError::NonPositivePivot { index }| {
                let text = format!("the matrix is not positive definite at unknown {index}");
                SolveError::Failed(text)
            })?;
        let unknowns = right_side.len();
        LltRef::new(&self.symbolic, &self.factor).solve_in_place_with_conj(
            Conj::No,
            MatMut::from_column_major_slice_mut(right_side, unknowns, 1),
            Par::Seq,
            MemStack::new(&mut self.workspace),
        );
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::solver::ordering::Ordering;
    use crate::solver::pattern::Pattern;

    /// Lower triangle of L Lᵀ + I for a banded L, and the full matrix.
    fn banded(size: usize) -> (Vec<usize>, Vec<usize>, Vec<f64>, Vec<Vec<f64>>) {
        let entry = |row: usize, column: usize| match row.abs_diff(column) {
            0 => 4.0 + row as f64 / 10.0,
            1 => -1.0,
            4 => 0.5 + column.min(row) as f64 / 50.0,
            _ => 0.0,
        };
        let full: Vec<Vec<f64>> = (0..size)
            .map(|row| (0..size).map(|column| entry(row, column)).collect())
            .collect();
        let (mut starts, mut rows, mut values) = (vec![0], Vec::new(), Vec::new());
        for column in 0..size {
            for (row, entries) in full.iter().enumerate().skip(column) {
                if entries[column] != 0.0 {
                    rows.push(row);
                    values.push(entries[column]);
                }
            }
            starts.push(rows.len());
        }
        (starts, rows, values, full)
    }

    #[test]
    fn solution_solves_the_full_system_again_and_again() {
        let (starts, rows, mut values, full) = banded(30);
        let mut cholesky = Cholesky::new(starts, rows).unwrap();
        for scale in [1.0, 3.0] {
            values.iter_mut().for_each(|value| *value *= scale);
            let right_side: Vec<f64> = (0..30).map(|k| f64::from(k).sin()).collect();
            let mut x = right_side.clone();
            cholesky.solve(&values, &mut x).unwrap();
            for (row, expected) in full.iter().zip(&right_side) {
                let product: f64 = row.iter().zip(&x).map(|(a, x)| scale * a * x).sum();
                assert!((product - expected).abs() < 1e-13);
            }
        }
    }

    #[test]
    fn indefinite_matrix_is_an_error_that_can_be_recovered_from() {
        let (starts, rows, values, _) = banded(12);
        let mut cholesky = Cholesky::new(starts.clone(), rows).unwrap();
        let mut spoilt = values.clone();
        spoilt[starts[7]] = -5.0;
        let mut x = vec![1.0; 12];
        assert_eq!(
            cholesky.solve(&spoilt, &mut x),
            Err(SolveError::Failed(
                "the matrix is not positive definite at unknown 7".to_owned()
            ))
        );
        spoilt[starts[7]] = f64::NAN;
        assert!(cholesky.solve(&spoilt, &mut x).is_err());
        let mut recovered = vec![1.0; 12];
        cholesky.solve(&values, &mut recovered).unwrap();
        let mut expected = vec![1.0; 12];
        let (starts, rows, ..) = banded(12);
        let mut fresh = Cholesky::new(starts, rows).unwrap();
        fresh.solve(&values, &mut expected).unwrap();
        assert_eq!(recovered, expected);
    }

    /// Row by row, eliminating a grid fills the band below each column; a good order stays well below.
    #[test]
    fn elimination_order_keeps_a_grid_sparse() {
        let side = 20_u32;
        let square = |a: u32| [[a, a + side, a + side + 1], [a, a + side + 1, a + 1]];
        let rows = (0..side - 1).flat_map(|row| row * side..row * side + side - 1);
        let triangles: Vec<[u32; 3]> = rows.flat_map(square).collect();
        let order = Ordering::MinimumDegree;
        let pattern = Pattern::new(order, &[false; 400], &triangles, &[]).unwrap();
        let (starts, rows) = pattern.scalar_columns();
        let filled = Cholesky::new(starts, rows).unwrap().factor.len();
        assert!(filled < 9 * 21 * 400, "{filled} numbers");
    }

    #[test]
    fn nothing_to_solve_is_no_error() {
        let mut cholesky = Cholesky::new(vec![0], Vec::new()).unwrap();
        assert_eq!(cholesky.solve(&[], &mut []), Ok(()));
    }
}
