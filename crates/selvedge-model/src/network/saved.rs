//! Activations that a training pass keeps for its backward pass.

use std::ops::Range;

use crate::graph::partition::of_rows;
use crate::graph::share::Rows;
use crate::kernels::aligned::Aligned;
use crate::kernels::real::Real;

/// `N` arrays with a row for each vertex, or for each arc; without rows where nothing is kept.
#[derive(Debug)]
pub(crate) struct Saved<T, const N: usize> {
    arrays: [Aligned<T>; N],
    /// Numbers in a row of each array; 0 for one that the layer does without.
    widths: [usize; N],
}

impl<T, const N: usize> Default for Saved<T, N> {
    fn default() -> Self {
        Self {
            arrays: std::array::from_fn(|_| Aligned::default()),
            widths: [0; N],
        }
    }
}

impl<T: Real, const N: usize> Saved<T, N> {
    /// Makes room for `rows` rows of these widths.
    pub(crate) fn fit(&mut self, rows: usize, widths: [usize; N]) {
        self.widths = widths;
        for (array, width) in self.arrays.iter_mut().zip(widths) {
            array.resize(rows * width);
        }
    }

    /// All rows, to be written.
    pub(crate) fn rows(&mut self) -> [Rows<'_, T>; N] {
        let mut widths = self.widths.iter();
        let arrays = self.arrays.each_mut();
        arrays.map(|array| Rows::new(array, widths.next().copied().unwrap_or(0)))
    }

    /// Some rows, to be read.
    pub(crate) fn at(&self, rows: &Range<usize>) -> [&[T]; N] {
        let mut widths = self.widths.iter();
        let arrays = self.arrays.each_ref();
        arrays.map(|array| &array[of_rows(rows, widths.next().copied().unwrap_or(0))])
    }
}
