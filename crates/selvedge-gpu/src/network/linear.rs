//! Linear layers and the matrices that they multiply, as products of a schedule.

use crate::schedule::plan::Region;
use crate::schedule::{Epilogue, Matrix, Onto, Product};

/// Rows of some width: a whole array, or some of its columns.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rows {
    /// The first row and those after it.
    pub(super) matrix: Matrix,
    /// Columns.
    pub(super) width: usize,
}

impl Rows {
    /// All columns of an array.
    pub(super) fn new(region: Region, width: usize) -> Self {
        let matrix = Matrix::new(region, width);
        Self { matrix, width }
    }

    /// `width` of the columns, from number `first` on.
    pub(super) fn columns(self, first: usize, width: usize) -> Self {
        let matrix = self.matrix.from_column(first);
        Self { matrix, width }
    }
}

/// x Wᵀ for rows x `[rows, inputs]` and a weight W `[outputs, inputs]`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Linear {
    rows: usize,
    x: Rows,
    weight: Matrix,
    out: Rows,
    onto: Onto,
    epilogue: Epilogue,
}

impl Linear {
    /// A layer without bias, whose output replaces the old values.
    pub(super) fn new(rows: usize, x: Rows, weight: Matrix, out: Rows) -> Self {
        Self {
            rows,
            x,
            weight,
            out,
            onto: Onto::Set,
            epilogue: Epilogue::Nothing,
        }
    }

    /// The same with another use of the old values.
    pub(super) fn onto(self, onto: Onto) -> Self {
        Self { onto, ..self }
    }

    /// The same with a last operation.
    pub(super) fn then(self, epilogue: Epilogue) -> Self {
        Self { epilogue, ..self }
    }
}

impl From<Linear> for Product {
    fn from(layer: Linear) -> Self {
        Self {
            size: [layer.rows, layer.out.width, layer.x.width],
            a: layer.x.matrix,
            b: layer.weight.transpose(),
            c: layer.out.matrix,
            onto: layer.onto,
            epilogue: layer.epilogue,
        }
    }
}
