//! Arrays aligned to the widest vectors. A vector that straddles two lines of the first cache takes
//! two reads, and an array of the allocator's begins 16 bytes after the start of a line.

use std::marker::PhantomData;
use std::ops::{Deref, DerefMut};

use bytemuck::{Pod, Zeroable};

/// Bytes of the widest vector, and of a line of the first cache.
const LINE: usize = 64;

/// A line of the first cache.
#[derive(Clone, Copy, Debug, Default, Pod, Zeroable)]
#[repr(C, align(64))]
struct Line([u64; LINE / 8]);

/// An array whose first number lies at a multiple of 64 bytes.
#[derive(Clone, Debug, Default)]
pub(crate) struct Aligned<T> {
    lines: Vec<Line>,
    length: usize,
    of: PhantomData<T>,
}

impl<T: Pod> Aligned<T> {
    /// An array of `length` zeros.
    pub(crate) fn zeros(length: usize) -> Self {
        Self {
            lines: vec![Line::default(); (length * size_of::<T>()).div_ceil(LINE)],
            length,
            of: PhantomData,
        }
    }

    /// Sets the length; new values are zero, old ones stay.
    pub(crate) fn resize(&mut self, length: usize) {
        let lines = (length * size_of::<T>()).div_ceil(LINE);
        if lines > self.lines.len() {
            self.lines.resize(lines, Line::default());
        }
        let before = std::mem::replace(&mut self.length, length);
        if length > before {
            self[before..].fill(T::zeroed());
        }
    }
}

impl<T: Pod + PartialEq> PartialEq for Aligned<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T: Pod> Deref for Aligned<T> {
    type Target = [T];

    #[inline]
    fn deref(&self) -> &[T] {
        &bytemuck::cast_slice(&self.lines)[..self.length]
    }
}

impl<T: Pod> DerefMut for Aligned<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut [T] {
        &mut bytemuck::cast_slice_mut(&mut self.lines)[..self.length]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_begin_at_a_line_and_keep_their_values() {
        let mut array = Aligned::<f32>::default();
        for length in [1, 5, 300, 17, 18, 0, 4000, 3] {
            let before: Vec<f32> = array.to_vec();
            array.resize(length);
            assert_eq!(array.as_ptr().align_offset(LINE), 0, "{length}");
            let kept = before.len().min(length);
            assert_eq!(array[..kept], before[..kept]);
            assert!(array[kept..].iter().all(|&x| x == 0.0));
            assert_eq!(array.len(), length);
            array.fill(length as f32);
            let copy = array.clone();
            assert_eq!(copy, array);
            assert_eq!(copy.as_ptr().align_offset(LINE), 0);
        }
    }
}
