//! The order of a cloth's unknowns in its matrix.

use std::collections::VecDeque;

use faer::dyn_stack::{MemBuffer, MemStack};
use faer::sparse::SymbolicSparseColMat;
use faer::sparse::linalg::amd;

use crate::lists::Lists;
use crate::solver::cholesky::FactorError;

/// Kind of an order, by its purpose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ordering {
    /// Little fill in a complete factorisation (approximate minimum degree; Amestoy, Davis and Duff
    /// 1996).
    MinimumDegree,
    /// Neighbours near each other, so that memory is read in order (Cuthill and McKee 1969,
    /// reversed), in so many parts that nothing couples, and a separator after them.
    Banded {
        /// Number of parts.
        parts: usize,
    },
}

/// An order of unknowns.
pub(crate) struct Order {
    /// The unknown at each place.
    pub(crate) unknowns: Vec<usize>,
    /// Places at which parts end that nothing couples; the separator follows the last.
    pub(crate) part_ends: Vec<usize>,
}

/// The order of `unknown_count` unknowns coupled in `pairs` (smaller first).
pub(crate) fn order(
    ordering: Ordering,
    unknown_count: usize,
    pairs: &[(u32, u32)],
) -> Result<Order, FactorError> {
    match ordering {
        Ordering::MinimumDegree => Ok(Order {
            unknowns: minimum_degree(unknown_count, pairs)?,
            part_ends: vec![unknown_count],
        }),
        Ordering::Banded { parts } => {
            let both: Vec<_> = pairs.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
            let neighbours = Lists::group(unknown_count, &both);
            Ok(parted(
                &banded(&neighbours, unknown_count),
                &neighbours,
                parts,
            ))
        }
    }
}

/// Cuts a banded order into `parts`: those of a part that have a neighbour in a later one go to the
/// separator.
fn parted(banded: &[usize], neighbours: &Lists, parts: usize) -> Order {
    let share = banded.len().div_ceil(parts).max(1);
    let mut part_of = vec![0; banded.len()];
    for (place, unknown) in banded.iter().enumerate() {
        part_of[*unknown] = place / share;
    }
    let separates = |unknown: &usize| {
        let own = part_of[*unknown];
        let mut near = neighbours.of(*unknown).iter();
        near.any(|other| part_of[*other as usize] > own)
    };
    let (mut unknowns, mut part_ends) = (Vec::with_capacity(banded.len()), Vec::new());
    for part in banded.chunks(share) {
        unknowns.extend(part.iter().filter(|unknown| !separates(unknown)));
        part_ends.push(unknowns.len());
    }
    unknowns.extend(banded.iter().filter(|unknown| separates(unknown)));
    Order {
        unknowns,
        part_ends,
    }
}

/// Breadth-first order from an end of each piece, neighbours with few neighbours first, reversed.
fn banded(neighbours: &Lists, unknown_count: usize) -> Vec<usize> {
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
            search(neighbours, first, &mut placed, &mut order);
            first = order[order.len() - 1];
            order.drain(begin..).for_each(|k| placed[k] = false);
        }
        search(neighbours, first, &mut placed, &mut order);
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

/// Order by approximate minimum degree.
fn minimum_degree(unknown_count: usize, pairs: &[(u32, u32)]) -> Result<Vec<usize>, FactorError> {
    let resources = |cause: String| FactorError::Resources {
        unknowns: 3 * unknown_count,
        cause,
    };
    // The upper triangle by columns: column = larger unknown.
    let mut entries: Vec<(u32, u32)> = pairs.iter().map(|&(a, b)| (b, a)).collect();
    entries.extend((0..unknown_count as u32).map(|k| (k, k)));
    entries.sort_unstable();
    let mut starts = vec![0_usize; unknown_count + 1];
    for &(column, _) in &entries {
        starts[column as usize + 1] += 1;
    }
    for column in 0..unknown_count {
        starts[column + 1] += starts[column];
    }
    let rows: Vec<usize> = entries.iter().map(|&(_, row)| row as usize).collect();
    let count = rows.len();
    let graph = SymbolicSparseColMat::new_checked(unknown_count, unknown_count, starts, None, rows);
    let mut order = vec![0_usize; unknown_count];
    let mut inverse = vec![0_usize; unknown_count];
    let mut workspace = MemBuffer::try_new(amd::order_scratch::<usize>(unknown_count, count))
        .map_err(|_| resources("out of memory".to_owned()))?;
    amd::order(
        &mut order,
        &mut inverse,
        graph.as_ref(),
        amd::Control::default(),
        MemStack::new(&mut workspace),
    )
    .map_err(|cause| resources(format!("{cause:?}")))?;
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
        let order = order(Ordering::Banded { parts: 1 }, 120, &pairs)
            .unwrap()
            .unknowns;
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
        let pairs = [(0, 3), (3, 5), (1, 2)];
        let banded = |parts| Ordering::Banded { parts };
        for ordering in [banded(1), banded(2), banded(6), Ordering::MinimumDegree] {
            let mut order = order(ordering, 6, &pairs).unwrap().unknowns;
            order.sort_unstable();
            assert_eq!(order, [0, 1, 2, 3, 4, 5]);
        }
    }

    #[test]
    fn parts_are_coupled_by_the_separator_alone() {
        // A grid of 12 by 10.
        let pairs: Vec<(u32, u32)> = (0..120)
            .flat_map(|k| [(k, k + 1), (k, k + 12)])
            .filter(|&(a, b)| b < 120 && (b != a + 1 || b % 12 > 0))
            .collect();
        for parts in [1, 2, 3, 5] {
            let order = order(Ordering::Banded { parts }, 120, &pairs).unwrap();
            let mut part = vec![parts; 120];
            for (place, &unknown) in order.unknowns.iter().enumerate() {
                part[unknown] = order.part_ends.partition_point(|&end| end <= place);
            }
            let joins = |&(a, b): &(u32, u32)| {
                let [a, b] = [a, b].map(|k| part[k as usize]);
                a != b && a.max(b) < parts
            };
            assert!(!pairs.iter().any(joins));
            let separator = part.iter().filter(|&&part| part == parts).count();
            assert!(
                separator <= 12 * (parts - 1),
                "{separator} of {parts} parts"
            );
        }
    }
}
