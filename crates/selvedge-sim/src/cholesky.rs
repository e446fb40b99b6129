//! Sparse Cholesky factorisation A = L Lᵀ of a symmetric matrix whose pattern never changes, and
//! the solution of A x = b (faer; supernodal, because its automatic choice is the slower one for
//! the matrices of a cloth).
//!
//! The unknowns come in an order that keeps the factor sparse ([`crate::pattern`]), so none is
//! sought here. After construction nothing is allocated.

use faer::dyn_stack::{MemBuffer, MemStack, StackReq};
use faer::linalg::cholesky::llt::factor::{LltError, LltRegularization};
use faer::sparse::linalg::SupernodalThreshold;
use faer::sparse::linalg::cholesky::{
    CholeskySymbolicParams, LltRef, SymbolicCholesky, SymmetricOrdering,
    factorize_symbolic_cholesky,
};
use faer::sparse::{SparseColMatRef, SymbolicSparseColMat};
use faer::{Conj, MatMut, Par, Side, Spec};
use thiserror::Error;

/// Why a system could not be factorised or solved.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
pub(crate) enum FactorError {
    /// The matrix is not positive definite.
    #[error("the matrix is not positive definite at unknown {index}")]
    NotPositiveDefinite {
        /// Scalar unknown of the pivot.
        index: usize,
    },
    /// No memory, or more entries than an index can count.
    #[error("the factorisation of {unknowns} unknowns failed: {cause}")]
    Resources {
        /// Size of the matrix.
        unknowns: usize,
        /// What the linear algebra said.
        cause: String,
    },
}

/// A factorisation with its workspaces.
pub(crate) struct Cholesky {
    pattern: SymbolicSparseColMat<usize>,
    symbolic: SymbolicCholesky<usize>,
    factor: Vec<f64>,
    workspace: MemBuffer,
}

impl Cholesky {
    /// Analyses the lower triangle with these compressed columns (rows sorted within each).
    pub(crate) fn new(column_starts: Vec<usize>, rows: Vec<usize>) -> Result<Self, FactorError> {
        let unknowns = column_starts.len() - 1;
        let resources = |cause: String| FactorError::Resources { unknowns, cause };
        let pattern =
            SymbolicSparseColMat::new_checked(unknowns, unknowns, column_starts, None, rows);
        let parameters = CholeskySymbolicParams {
            supernodal_flop_ratio_threshold: SupernodalThreshold::FORCE_SUPERNODAL,
            ..Default::default()
        };
        // In the given order faer analyses the upper triangle, whatever side it is told.
        let (starts, rows) = transpose(pattern.col_ptr(), pattern.row_idx());
        let upper = SymbolicSparseColMat::new_checked(unknowns, unknowns, starts, None, rows);
        let symbolic = factorize_symbolic_cholesky(
            upper.as_ref(),
            Side::Upper,
            SymmetricOrdering::Identity,
            parameters,
        )
        .map_err(|cause| resources(format!("{cause:?}")))?;
        let request = StackReq::or(
            symbolic.factorize_numeric_llt_scratch::<f64>(Par::Seq, Spec::default()),
            symbolic.solve_in_place_scratch::<f64>(1, Par::Seq),
        );
        let workspace =
            MemBuffer::try_new(request).map_err(|_| resources("out of memory".to_owned()))?;
        let factor = vec![0.0; symbolic.len_val()];
        Ok(Self {
            pattern,
            symbolic,
            factor,
            workspace,
        })
    }

    /// Number of scalar unknowns.
    #[cfg(test)]
    pub(crate) fn len(&self) -> usize {
        self.pattern.ncols()
    }

    /// Replaces `right_side` by the solution of A x = b, A given by its `values` in the order of
    /// the pattern.
    pub(crate) fn solve(
        &mut self,
        values: &[f64],
        right_side: &mut [f64],
    ) -> Result<(), FactorError> {
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
            .map_err(
                |LltError::NonPositivePivot { index }| FactorError::NotPositiveDefinite { index },
            )?;
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

/// Compressed columns of the transpose.
fn transpose(column_starts: &[usize], rows: &[usize]) -> (Vec<usize>, Vec<usize>) {
    let mut starts = vec![0; column_starts.len()];
    for &row in rows {
        starts[row + 1] += 1;
    }
    for k in 1..starts.len() {
        starts[k] += starts[k - 1];
    }
    let mut next = starts.clone();
    let mut transposed = vec![0; rows.len()];
    for (column, range) in column_starts.windows(2).enumerate() {
        for &row in &rows[range[0]..range[1]] {
            transposed[next[row]] = column;
            next[row] += 1;
        }
    }
    (starts, transposed)
}
