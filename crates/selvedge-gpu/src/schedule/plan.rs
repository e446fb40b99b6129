//! The memory of a device: one arena of words of four bytes, and the place of each array in it.
//!
//! A plan is made before anything is allocated, so that its size can be compared with the free
//! memory. Temporary arrays are made after a [`Plan::mark`] and given back by [`Plan::release`];
//! later arrays may take their place. [`crate::schedule::Trace`] checks that no array is read after
//! another one was written over it.

use std::ops::Range;

/// Words between which arrays begin: 256 bytes, the alignment of CUDA's own allocations.
const ALIGNMENT: usize = 64;

/// The type of the elements of an array.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Element {
    /// `f32`.
    Float,
    /// `u32`.
    Index,
    /// `f64`.
    Double,
}

impl Element {
    /// Words of four bytes per element.
    #[must_use]
    pub const fn words(self) -> usize {
        match self {
            Self::Float | Self::Index => 1,
            Self::Double => 2,
        }
    }
}

/// Part of an array of a [`Plan`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Region {
    array: usize,
    element: Element,
    first: usize,
    count: usize,
}

impl Region {
    /// The type of the elements.
    #[must_use]
    pub fn element(self) -> Element {
        self.element
    }

    /// Number of elements.
    #[must_use]
    pub fn count(self) -> usize {
        self.count
    }

    /// The elements `range`.
    ///
    /// # Panics
    /// When the region ends before the range does.
    #[must_use]
    pub fn part(self, range: Range<usize>) -> Self {
        let Range { start, end } = range;
        assert!(start <= end && end <= self.count, "a part of a region");
        Self {
            first: self.first + start,
            count: end - start,
            ..self
        }
    }

    /// The region from the beginning of this one to the end of `last`, in the same array.
    ///
    /// # Panics
    /// When `last` belongs to another array, or begins earlier.
    #[must_use]
    pub fn up_to(self, last: Self) -> Self {
        assert!(
            self.array == last.array && self.first <= last.first,
            "parts of one array"
        );
        Self {
            count: last.first + last.count - self.first,
            ..self
        }
    }

    /// The rows `range`, of `width` elements each.
    ///
    /// # Panics
    /// When the region ends before the range does.
    #[must_use]
    pub fn rows(self, range: Range<usize>, width: usize) -> Self {
        self.part(range.start * width..range.end * width)
    }
}

/// One array.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Array {
    /// The contents, for messages.
    pub name: String,
    /// The type of the elements.
    pub element: Element,
    /// Number of elements.
    pub count: usize,
    first_word: usize,
}

/// A state of a plan to return to.
#[derive(Clone, Copy, Debug)]
pub struct Mark(usize);

/// The places of arrays in an arena.
#[derive(Clone, Debug, Default)]
pub struct Plan {
    arrays: Vec<Array>,
    top: usize,
    words: usize,
}

impl Plan {
    /// A plan without arrays.
    #[must_use]
    pub fn new() -> Self {
        Self::default()
    }

    /// Makes an array.
    pub fn array(&mut self, name: impl Into<String>, element: Element, count: usize) -> Region {
        let array = self.arrays.len();
        let first_word = self.top;
        self.arrays.push(Array {
            name: name.into(),
            element,
            count,
            first_word,
        });
        self.top = (first_word + count * element.words()).next_multiple_of(ALIGNMENT);
        self.words = self.words.max(self.top);
        Region {
            array,
            element,
            first: 0,
            count,
        }
    }

    /// Makes an array of `f32`.
    pub fn floats(&mut self, name: impl Into<String>, count: usize) -> Region {
        self.array(name, Element::Float, count)
    }

    /// Makes an array of `u32`.
    pub fn indices(&mut self, name: impl Into<String>, count: usize) -> Region {
        self.array(name, Element::Index, count)
    }

    /// Makes an array of `f64`.
    pub fn doubles(&mut self, name: impl Into<String>, count: usize) -> Region {
        self.array(name, Element::Double, count)
    }

    /// The current end, for [`Self::release`].
    #[must_use]
    pub fn mark(&self) -> Mark {
        Mark(self.top)
    }

    /// Gives back the arrays made since `mark`: later ones may take their place.
    pub fn release(&mut self, mark: Mark) {
        self.top = mark.0.min(self.top);
    }

    /// The words of a region.
    #[must_use]
    pub fn place(&self, region: Region) -> Range<usize> {
        let size = region.element.words();
        let first = self.arrays[region.array].first_word + region.first * size;
        first..first + region.count * size
    }

    /// The array that a region belongs to.
    #[must_use]
    pub fn array_of(&self, region: Region) -> &Array {
        &self.arrays[region.array]
    }

    /// All arrays, in the order of their making.
    #[must_use]
    pub fn arrays(&self) -> &[Array] {
        &self.arrays
    }

    /// Words of the whole arena.
    #[must_use]
    pub fn words(&self) -> usize {
        self.words
    }

    /// Bytes of the whole arena.
    #[must_use]
    pub fn bytes(&self) -> usize {
        4 * self.words
    }

    /// The number of the array of a region.
    pub(crate) fn number_of(region: Region) -> usize {
        region.array
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arrays_lie_one_after_the_other_and_released_ones_make_room() {
        let mut plan = Plan::new();
        let kept = plan.floats("kept", 100);
        let mark = plan.mark();
        let first = plan.doubles("first", 40);
        plan.release(mark);
        let second = plan.indices("second", 10);
        assert_eq!(plan.place(kept), 0..100);
        assert_eq!(plan.place(first), 128..208);
        assert_eq!(plan.place(second), 128..138);
        assert_eq!(plan.words(), 256);
        assert_eq!(plan.place(first.part(3..5)), 134..138);
        assert_eq!(plan.place(kept.rows(2..4, 10)), 20..40);
    }
}
