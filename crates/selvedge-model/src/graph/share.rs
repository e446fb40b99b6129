//! Shares the rows of a graph's partitions among threads: named arrays of rows are split at the
//! boundaries of partitions, and each thread writes its own part.

use std::ops::{Deref, DerefMut, Range};

use crate::graph::partition::{Partition, of_rows};

/// Arrays with a row for each vertex, or for each arc.
pub(crate) trait SplitRows: Sized {
    /// The same arrays, borrowed for a shorter time.
    type Part<'b>
    where
        Self: 'b;

    /// The first `count` rows of each array, and the others.
    fn split_rows(self, count: usize) -> (Self, Self);

    /// The rows `range` of each array.
    fn part(&mut self, range: &Range<usize>) -> Self::Part<'_>;
}

/// An array of rows of `width` numbers; empty where it is not wanted.
#[derive(Debug, Default)]
pub(crate) struct Rows<'a, T> {
    pub(crate) values: &'a mut [T],
    width: usize,
}

impl<'a, T> Rows<'a, T> {
    /// `values` as rows of `width` numbers.
    pub(crate) fn new(values: &'a mut [T], width: usize) -> Self {
        Self { values, width }
    }

    /// Numbers in a row.
    pub(crate) fn width(&self) -> usize {
        self.width
    }
}

impl<T> Deref for Rows<'_, T> {
    type Target = [T];

    #[inline(always)]
    fn deref(&self) -> &[T] {
        self.values
    }
}

impl<T> DerefMut for Rows<'_, T> {
    #[inline(always)]
    fn deref_mut(&mut self) -> &mut [T] {
        self.values
    }
}

impl<T> SplitRows for Rows<'_, T> {
    type Part<'b>
        = Rows<'b, T>
    where
        Self: 'b;

    fn split_rows(self, count: usize) -> (Self, Self) {
        let width = self.width;
        let middle = (count * width).min(self.values.len());
        let (first, second) = self.values.split_at_mut(middle);
        (Self::new(first, width), Self::new(second, width))
    }

    fn part(&mut self, range: &Range<usize>) -> Rows<'_, T> {
        let range = if self.values.is_empty() {
            0..0
        } else {
            of_rows(range, self.width)
        };
        Rows::new(&mut self.values[range], self.width)
    }
}

impl<R: SplitRows + Default, const N: usize> SplitRows for [R; N] {
    type Part<'b>
        = [R::Part<'b>; N]
    where
        Self: 'b;

    fn split_rows(self, count: usize) -> (Self, Self) {
        let mut others: [R; N] = std::array::from_fn(|_| R::default());
        let mut others_left = others.iter_mut();
        let firsts = self.map(|rows| {
            let (first, other) = rows.split_rows(count);
            if let Some(to) = others_left.next() {
                *to = other;
            }
            first
        });
        (firsts, others)
    }

    fn part(&mut self, range: &Range<usize>) -> [R::Part<'_>; N] {
        self.each_mut().map(|rows| rows.part(range))
    }
}

impl SplitRows for () {
    type Part<'b> = ();

    fn split_rows(self, _: usize) -> (Self, Self) {
        ((), ())
    }

    fn part(&mut self, _: &Range<usize>) {}
}

macro_rules! split_tuple {
    ($($rows:ident $field:tt),+) => {
        impl<$($rows: SplitRows),+> SplitRows for ($($rows),+) {
            type Part<'b>
                = ($($rows::Part<'b>),+)
            where
                Self: 'b;

            fn split_rows(self, count: usize) -> (Self, Self) {
                let both = ($(self.$field.split_rows(count)),+);
                (($(both.$field.0),+), ($(both.$field.1),+))
            }

            fn part(&mut self, range: &Range<usize>) -> Self::Part<'_> {
                ($(self.$field.part(range)),+)
            }
        }
    };
}

split_tuple!(A 0, B 1);
split_tuple!(A 0, B 1, C 2);
split_tuple!(A 0, B 1, C 2, D 3);

/// Rows of the vertices and rows of the arcs of contiguous partitions.
pub(crate) struct Share<V, A> {
    pub(crate) vertices: V,
    pub(crate) arcs: A,
}

/// Groups that partitions are dealt to, from group `first` on.
#[derive(Clone, Copy)]
struct Deal {
    first: usize,
    groups: usize,
    partitions: usize,
}

impl Deal {
    /// The first partition of a group.
    fn partition(self, group: usize) -> usize {
        group * self.partitions / self.groups
    }
}

impl<V: SplitRows + Send, A: SplitRows + Send> Share<V, A> {
    /// Does `work` on each partition with its rows, on all threads. Allocates nothing.
    pub(crate) fn each(self, partitions: &[Partition], work: impl Fn(&Partition, V, A) + Sync) {
        // Groups of no size.
        let mut groups = vec![(); partitions.len()];
        self.among(partitions, &mut groups, &|partitions, share, ()| {
            work(&partitions[0], share.vertices, share.arcs);
        });
    }

    /// Does `work` on groups of partitions of about the same size with their rows, on all threads.
    /// `groups`, at most one for each partition, holds the state of each group. Allocates nothing.
    pub(crate) fn among<G: Send>(
        self,
        partitions: &[Partition],
        groups: &mut [G],
        work: &(impl Fn(&[Partition], Self, &mut G) + Sync),
    ) {
        let deal = Deal {
            first: 0,
            groups: groups.len(),
            partitions: partitions.len(),
        };
        self.among_part(deal, partitions, groups, work);
    }

    fn among_part<G: Send>(
        self,
        deal: Deal,
        partitions: &[Partition],
        groups: &mut [G],
        work: &(impl Fn(&[Partition], Self, &mut G) + Sync),
    ) {
        match groups {
            [] => {}
            [group] => work(partitions, self, group),
            _ => {
                let middle = groups.len() / 2;
                let later = Deal {
                    first: deal.first + middle,
                    ..deal
                };
                let at = deal.partition(later.first) - deal.partition(deal.first);
                let (partitions0, partitions1) = partitions.split_at(at);
                let (groups0, groups1) = groups.split_at_mut(middle);
                let [first, next] = [&partitions0[0], &partitions1[0]];
                let vertices = next.vertices.start - first.vertices.start;
                let arcs = next.arcs.start - first.arcs.start;
                let (vertices0, vertices1) = self.vertices.split_rows(vertices);
                let (arcs0, arcs1) = self.arcs.split_rows(arcs);
                let [rows0, rows1] = [(vertices0, arcs0), (vertices1, arcs1)]
                    .map(|(vertices, arcs)| Self { vertices, arcs });
                rayon::join(
                    || rows0.among_part(deal, partitions0, groups0, work),
                    || rows1.among_part(later, partitions1, groups1, work),
                );
            }
        }
    }
}
