//! The order of a cloth's unknowns in its matrix.

use std::collections::VecDeque;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::linalg::amd;
use faer::sparse::{Pair, SymbolicSparseColMat};

use crate::lists::Lists;
use crate::solver::SolveError;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ordering {
    /// Little fill in a complete factorisation (approximate minimum degree; Amestoy, Davis and Duff
    /// 1996).
    MinimumDegree,
    /// Neighbours near each other: a preconditioner by tiles loses little, and memory is read in
    /// order (Cuthill and McKee 1969, reversed).
    Banded,
}

/// The order of `unknown_count` unknowns coupled in `pairs` (smaller first). Entry k is the unknown
/// at place k.
pub(crate) fn order(
    ordering: Ordering,
    unknown_count: usize,
    pairs: &[(u32, u32)],
) -> Result<Vec<usize>, SolveError> {
    match ordering {
        Ordering::MinimumDegree => minimum_degree(unknown_count, pairs),
        Ordering::Banded => Ok(banded(unknown_count, pairs)),
    }
}

/// Breadth-first order from an end of each piece, neighbours with few neighbours first, reversed.
fn banded(unknown_count: usize, pairs: &[(u32, u32)]) -> Vec<usize> {
    let both: Vec<(u32, u32)> = pairs.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
    let neighbours = Lists::group(unknown_count, &both);
    let mut order = Vec::with_capacity(unknown_count);
    let mut placed = vec![false; unknown_count];
    for seed in 0..unknown_count {
        if placed[seed] {
            continue;
        }
        // The last unknown of a search from anywhere lies near an end; two searches are enough.
        let mut first = seed;
        for _ in 0..2 {
            let begin = order.len();
            search(&neighbours, first, &mut placed, &mut order);
            first = order[order.len() - 1];
            order.drain(begin..).for_each(|k| placed[k] = false);
        }
        search(&neighbours, first, &mut placed, &mut order);
    }
    order.reverse();
    order
}

fn search(neighbours: &Lists, first: usize, placed: &mut [bool], order: &mut Vec<usize>) {
    let mut waiting = VecDeque::from([first]);
    placed[first] = true;
    while let Some(unknown) = waiting.pop_front() {
        order.push(unknown);
        let begin = waiting.len();
        for &next in neighbours.of(unknown) {
            if !std::mem::replace(&mut placed[next as usize], true) {
                waiting.push_back(next as usize);
            }
        }
        waiting.make_contiguous()[begin..].sort_by_key(|&k| neighbours.of(k).len());
    }
}

fn minimum_degree(unknown_count: usize, pairs: &[(u32, u32)]) -> Result<Vec<usize>, SolveError> {
    let resources = |cause: &str| SolveError::resources(3 * unknown_count, cause);
    // The upper triangle: column = larger unknown.
    let above = pairs
        .iter()
        .map(|&(a, b)| Pair::new(a as usize, b as usize));
    let entries: Vec<_> = above
        .chain((0..unknown_count).map(|k| Pair::new(k, k)))
        .collect();
    let graph = SymbolicSparseColMat::try_new_from_indices(unknown_count, unknown_count, &entries)
        .map_err(|cause| resources(&format!("{cause:?}")))?
        .0;
    let mut order = vec![0_usize; unknown_count];
    let mut inverse = vec![0_usize; unknown_count];
    let mut workspace =
        MemBuffer::try_new(amd::order_scratch::<usize>(unknown_count, entries.len()))
            .map_err(|_| resources("out of memory"))?;
    amd::order(
        &mut order,
        &mut inverse,
        graph.as_ref(),
        amd::Control::default(),
        MemStack::new(&mut workspace),
    )
    .map_err(|cause| resources(&format!("{cause:?}")))?;
    Ok(order)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn banded_order_of_a_strip_has_its_width() {
        // Three unknowns per row, 40 rows, numbered so that neighbours are far apart.
        let number = |row: u32, column: u32| (7 * (3 * row + column)) % 120;
        let mut pairs = Vec::new();
        for row in 0..40 {
            for column in 0..3 {
                let here = number(row, column);
                if column < 2 {
                    pairs.push((here, number(row, column + 1)));
                }
                if row < 39 {
                    pairs.push((here, number(row + 1, column)));
                }
            }
        }
        let order = order(Ordering::Banded, 120, &pairs).unwrap();
        let mut place = vec![usize::MAX; 120];
        for (k, &unknown) in order.iter().enumerate() {
            place[unknown] = k;
        }
        let width = |&(a, b): &(u32, u32)| place[a as usize].abs_diff(place[b as usize]);
        // Breadth first has levels of at most three unknowns: neighbours are within two of them.
        assert!(pairs.iter().map(width).max().unwrap() <= 5);
    }

    #[test]
    fn every_unknown_of_every_piece_is_placed_once() {
        for ordering in [Ordering::Banded, Ordering::MinimumDegree] {
            let mut order = order(ordering, 6, &[(0, 3), (3, 5), (1, 2)]).unwrap();
            order.sort_unstable();
            assert_eq!(order, [0, 1, 2, 3, 4, 5]);
        }
    }
}
