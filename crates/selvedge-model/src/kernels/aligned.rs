//! Arrays aligned to the widest vectors. A vector that straddles two lines of the first cache takes
//! two reads, and an array of the allocator's begins 16 bytes after the start of a line.

use std::ops::{Deref, DerefMut};

/// Bytes of the widest vector, and of a line of the first cache.
const LINE: usize = 64;

/// An array whose first number lies at a multiple of 64 bytes.
#[derive(Debug)]
pub(crate) struct Aligned<T> {
    held: Vec<T>,
    start: usize,
    length: usize,
}

impl<T: Copy + Default> Aligned<T> {
    /// An array of `length` zeros.
    pub(crate) fn zeros(length: usize) -> Self {
        let mut array = Self::default();
        array.resize(length);
        array
    }

    /// Sets the length; new values are zero, old ones stay.
    pub(crate) fn resize(&mut self, length: usize) {
        let before = self.length;
        let room = LINE / size_of::<T>();
        if length > self.held.len().saturating_sub(room) {
            let held = vec![T::default(); length + room];
            let start = held.as_ptr().align_offset(LINE).min(room);
            let old = std::mem::replace(
                self,
                Self {
                    held,
                    start,
                    length,
                },
            );
            self[..before].copy_from_slice(&old);
        } else {
            self.length = length;
            if length > before {
                self[before..].fill(T::default());
            }
        }
    }
}

impl<T> Default for Aligned<T> {
    fn default() -> Self {
        Self {
            held: Vec::new(),
            start: 0,
            length: 0,
        }
    }
}

impl<T: Clone> Clone for Aligned<T> {
    fn clone(&self) -> Self {
        // Where the new array lies decides where its first number is.
        let mut held = self.held.clone();
        let start = held
            .as_ptr()
            .align_offset(LINE)
            .min(held.len() - self.length);
        held[start..start + self.length].clone_from_slice(self);
        Self {
            held,
            start,
            length: self.length,
        }
    }
}

impl<T: PartialEq> PartialEq for Aligned<T> {
    fn eq(&self, other: &Self) -> bool {
        **self == **other
    }
}

impl<T> Deref for Aligned<T> {
    type Target = [T];

    fn deref(&self) -> &[T] {
        &self.held[self.start..self.start + self.length]
    }
}

impl<T> DerefMut for Aligned<T> {
    fn deref_mut(&mut self) -> &mut [T] {
        &mut self.held[self.start..self.start + self.length]
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
