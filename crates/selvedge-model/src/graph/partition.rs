//! Partitions the graph into contiguous vertex ranges. Arcs are sorted by receiver, so a range's
//! incoming arcs are contiguous too; one thread owns one partition.
//!
//! A partition's results do not depend on the thread that computes them, so no result depends on
//! the number of threads.

use std::ops::Range;

/// Most vertices of a partition: the more, the less often the weights go through the second cache.
pub(crate) const PARTITION_VERTICES: usize = 128;

/// The number of partitions is a multiple of this, so that threads share them evenly.
const MULTIPLE: usize = 8;

/// Fewest vertices of a partition, below which sharing costs more than it saves.
const FEWEST_VERTICES: usize = 16;

/// Rows that are taken through the layers at a time. Their inputs and outputs stay in the second
/// cache beside the weights.
pub(crate) const CHUNK: usize = 96;

/// A contiguous range of vertices and the arcs into them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Partition {
    pub(crate) vertices: Range<usize>,
    pub(crate) arcs: Range<usize>,
}

/// The partitions of a graph. The arcs into vertex `v` are `first_arc[v]..first_arc[v + 1]`.
pub(crate) fn partitions(first_arc: &[u32]) -> Vec<Partition> {
    let count = first_arc.len() - 1;
    let least = count
        .div_ceil(PARTITION_VERTICES)
        .next_multiple_of(MULTIPLE);
    let number = least.min(count / FEWEST_VERTICES).max(count.min(1));
    let bound = |partition: usize| partition * count / number;
    let partition = |k: usize| Partition {
        vertices: bound(k)..bound(k + 1),
        arcs: first_arc[bound(k)] as usize..first_arc[bound(k + 1)] as usize,
    };
    (0..number).map(partition).collect()
}

pub(crate) fn chunks(rows: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let end = rows.end;
    rows.step_by(CHUNK)
        .map(move |first| first..end.min(first + CHUNK))
}

/// Rows of `width` numbers, one for each vertex.
pub(crate) struct Rows<'a, T> {
    pub(crate) values: &'a mut [T],
    pub(crate) width: usize,
}

/// Calls `work` for each of `parts` with its vertices' rows of each array, shared among threads.
/// Unlike parallel iterators over lists of rows it allocates nothing.
pub(crate) fn each_with_rows<P: Send, T: Send, const N: usize>(
    parts: &mut [P],
    rows: [Rows<'_, T>; N],
    vertices: &(impl Fn(&P) -> usize + Sync),
    work: &(impl Fn(&mut P, [&mut [T]; N]) + Sync),
) {
    if let [part] = parts {
        return work(part, rows.map(|rows| rows.values));
    }
    let (first, second) = parts.split_at_mut(parts.len() / 2);
    if second.is_empty() {
        return;
    }
    let count: usize = first.iter().map(vertices).sum();
    let mut seconds = rows;
    let firsts = seconds.each_mut().map(|rows| Rows {
        values: rows
            .values
            .split_off_mut(..count * rows.width)
            .unwrap_or_default(),
        width: rows.width,
    });
    rayon::join(
        || each_with_rows(first, firsts, vertices, work),
        || each_with_rows(second, seconds, vertices, work),
    );
}

/// Splits rows of `width` numbers at the ends of consecutive ranges.
pub(crate) fn split<T>(
    mut rows: &mut [T],
    width: usize,
    ranges: impl Iterator<Item = Range<usize>>,
) -> Vec<&mut [T]> {
    let mut part = |range: Range<usize>| rows.split_off_mut(..range.len() * width);
    ranges
        .map(|range| part(range).unwrap_or_default())
        .collect()
}
