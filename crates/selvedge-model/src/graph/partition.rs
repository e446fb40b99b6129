//! How threads share a graph: leaves of some vertices with the arcs into them, which lie side by
//! side. What a leaf computes does not depend on who computes it, and so nothing depends on the number
//! of threads.

use std::ops::Range;

/// Most vertices of a leaf: the more, the less often the weights go through the second cache.
pub(crate) const LEAF_VERTICES: usize = 128;

/// There are a multiple of so many leaves, for as many threads to share them evenly.
const LEAVES: usize = 8;

/// Fewest vertices of a leaf, below which sharing costs more than it saves.
const FEWEST_VERTICES: usize = 16;

/// Rows that are taken through the layers at a time: what they read and write stays in the second
/// cache beside the weights.
pub(crate) const CHUNK: usize = 96;

/// Some vertices and the arcs into them.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Leaf {
    pub(crate) vertices: Range<usize>,
    pub(crate) arcs: Range<usize>,
}

/// The leaves of a graph of which the arcs into vertex `v` are `first_arc[v]..first_arc[v + 1]`.
pub(crate) fn leaves(first_arc: &[u32]) -> Vec<Leaf> {
    let count = first_arc.len() - 1;
    let least = count.div_ceil(LEAF_VERTICES).next_multiple_of(LEAVES);
    let number = least.min(count / FEWEST_VERTICES).max(count.min(1));
    let bound = |leaf: usize| leaf * count / number;
    let leaf = |k: usize| Leaf {
        vertices: bound(k)..bound(k + 1),
        arcs: first_arc[bound(k)] as usize..first_arc[bound(k + 1)] as usize,
    };
    (0..number).map(leaf).collect()
}

/// The chunks of a range of rows.
pub(crate) fn chunks(rows: Range<usize>) -> impl Iterator<Item = Range<usize>> {
    let end = rows.end;
    rows.step_by(CHUNK)
        .map(move |first| first..end.min(first + CHUNK))
}

/// Arrays with the widths of their rows.
pub(crate) type Arrays<'a, T, const N: usize> = [(&'a mut [T], usize); N];

/// Arrays with rows of vertices and arrays with rows of arcs, of some leaves: each with the width of
/// its rows. An empty array is one that is not wanted.
pub(crate) struct Rows<'a, T, const V: usize, const A: usize> {
    pub(crate) vertices: Arrays<'a, T, V>,
    pub(crate) arcs: Arrays<'a, T, A>,
}

/// The first `rows` rows of each array, and the others.
fn split<T, const N: usize>(
    arrays: [(&mut [T], usize); N],
    rows: usize,
) -> [[(&mut [T], usize); N]; 2] {
    let mut both = [(); 2].map(|()| [(); N].map(|()| <(&mut [T], usize)>::default()));
    for (k, (array, width)) in arrays.into_iter().enumerate() {
        let (first, second) = array.split_at_mut((rows * width).min(array.len()));
        both[0][k] = (first, width);
        both[1][k] = (second, width);
    }
    both
}

/// Which groups of leaves there are in all, and the number of the first one.
#[derive(Clone, Copy)]
struct Share {
    first: usize,
    groups: usize,
    leaves: usize,
}

impl Share {
    /// The first leaf of a group.
    fn leaf(self, group: usize) -> usize {
        group * self.leaves / self.groups
    }
}

impl<T: Send, const V: usize, const A: usize> Rows<'_, T, V, A> {
    /// Does `work` on groups of leaves of about the same size with the rows of theirs, on all threads;
    /// `groups`, not more than there are leaves, has something for each of them. Allocates nothing.
    pub(crate) fn share<G: Send>(
        self,
        leaves: &[Leaf],
        groups: &mut [G],
        work: &(impl Fn(&[Leaf], Self, &mut G) + Sync),
    ) {
        let share = Share {
            first: 0,
            groups: groups.len(),
            leaves: leaves.len(),
        };
        self.share_part(share, leaves, groups, work);
    }

    fn share_part<G: Send>(
        self,
        share: Share,
        leaves: &[Leaf],
        groups: &mut [G],
        work: &(impl Fn(&[Leaf], Self, &mut G) + Sync),
    ) {
        match groups {
            [] => {}
            [group] => work(leaves, self, group),
            _ => {
                let middle = groups.len() / 2;
                let later = Share {
                    first: share.first + middle,
                    ..share
                };
                let at = share.leaf(later.first) - share.leaf(share.first);
                let ([leaves0, leaves1], [groups0, groups1]) = (
                    <[_; 2]>::from(leaves.split_at(at)),
                    <[_; 2]>::from(groups.split_at_mut(middle)),
                );
                let vertices = leaves1[0].vertices.start - leaves0[0].vertices.start;
                let arcs = leaves1[0].arcs.start - leaves0[0].arcs.start;
                let [v0, v1] = split(self.vertices, vertices);
                let [a0, a1] = split(self.arcs, arcs);
                let [rows0, rows1] =
                    [(v0, a0), (v1, a1)].map(|(vertices, arcs)| Self { vertices, arcs });
                rayon::join(
                    || rows0.share_part(share, leaves0, groups0, work),
                    || rows1.share_part(later, leaves1, groups1, work),
                );
            }
        }
    }
}

/// `range` in rows of `width` numbers.
pub(crate) fn of_rows(range: &Range<usize>, width: usize) -> Range<usize> {
    range.start * width..range.end * width
}
