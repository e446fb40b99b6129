//! The order of a cloth's unknowns in its matrix.

use std::collections::VecDeque;

use crate::lists::Lists;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ordering {
    /// Little fill in a complete factorisation (nested dissection; George and Liu 1978).
    Dissection,
    /// Neighbours near each other: a preconditioner by tiles loses little, and memory is read in
    /// order (Cuthill and McKee 1969, reversed).
    Banded,
}

/// The order of `unknown_count` unknowns coupled in `pairs` (smaller first). Entry k is the unknown
/// at place k.
pub(crate) fn order(ordering: Ordering, unknown_count: usize, pairs: &[(u32, u32)]) -> Vec<usize> {
    match ordering {
        Ordering::Dissection => dissected(unknown_count, pairs),
        Ordering::Banded => banded(unknown_count, pairs),
    }
}

/// Breadth-first order from an end of each piece, neighbours with few neighbours first, reversed.
fn banded(unknown_count: usize, pairs: &[(u32, u32)]) -> Vec<usize> {
    let neighbours = both_ways(unknown_count, pairs);
    let mut order = Vec::with_capacity(unknown_count);
    let mut placed = vec![false; unknown_count];
    for seed in 0..unknown_count {
        if !placed[seed] {
            search_from_end(&neighbours, seed, &mut placed, &mut order);
        }
    }
    order.reverse();
    order
}

fn both_ways(unknown_count: usize, pairs: &[(u32, u32)]) -> Lists {
    let both: Vec<(u32, u32)> = pairs.iter().flat_map(|&(a, b)| [(a, b), (b, a)]).collect();
    Lists::group(unknown_count, &both)
}

/// Appends the piece of `seed` to `order`, from one of its ends.
fn search_from_end(neighbours: &Lists, seed: usize, placed: &mut [bool], order: &mut Vec<usize>) {
    // The last unknown of a search from anywhere lies near an end; two searches are enough.
    let mut first = seed;
    for _ in 0..2 {
        let begin = order.len();
        search(neighbours, first, placed, order);
        first = order[order.len() - 1];
        order.drain(begin..).for_each(|k| placed[k] = false);
    }
    search(neighbours, first, placed, order);
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

/// Parts of at most so many unknowns are not divided further.
const LEAF: usize = 8;

/// By nested dissection: of each part those last that separate what a breadth-first search meets
/// first from the others, so that the two fill nothing in each other.
fn dissected(unknown_count: usize, pairs: &[(u32, u32)]) -> Vec<usize> {
    let neighbours = both_ways(unknown_count, pairs);
    let mut order = Vec::with_capacity(unknown_count);
    let mut placed = vec![true; unknown_count];
    let mut ranks = vec![usize::MAX; unknown_count];
    let mut parts: Vec<Vec<usize>> = vec![(0..unknown_count).collect()];
    while let Some(part) = parts.pop() {
        if part.len() <= LEAF {
            order.extend(part);
            continue;
        }
        part.iter().for_each(|k| placed[*k] = false);
        let mut found = Vec::with_capacity(part.len());
        search_from_end(&neighbours, part[0], &mut placed, &mut found);
        let (rest, _): (Vec<usize>, Vec<usize>) = part.iter().partition(|k| !placed[**k]);
        rest.iter().for_each(|k| placed[*k] = true);

        for (rank, unknown) in found.iter().enumerate() {
            ranks[*unknown] = rank;
        }
        let least = |k: &usize| neighbours.of(*k).iter().map(|n| ranks[*n as usize]).min();
        let nearest: Vec<usize> = found.iter().map(|k| least(k).unwrap_or(0)).collect();
        let (near, far) = found.split_at(best_cut(&nearest));
        let far = far.iter().zip(&nearest[near.len()..]);
        let (between, far): (Vec<_>, Vec<_>) = far.partition(|(_, nearest)| **nearest < near.len());
        found.iter().for_each(|k| ranks[*k] = usize::MAX);

        let unknowns = |of: Vec<(&usize, &usize)>| of.into_iter().map(|(k, _)| *k).collect();
        let between: Vec<usize> = unknowns(between);
        order.extend(between);
        let halves = [near.to_vec(), unknowns(far), rest];
        parts.extend(halves.into_iter().filter(|part| !part.is_empty()));
    }
    order.reverse();
    order
}

/// How many unknowns of a search come before the cut that separates two halves with the fewest
/// others between them. An unknown lies between where it comes after the cut, and the `nearest` of
/// its neighbours before.
fn best_cut(nearest: &[usize]) -> usize {
    let count = nearest.len();
    let mut change = vec![0_i64; count + 1];
    for (rank, nearest) in nearest.iter().enumerate() {
        if *nearest < rank {
            change[*nearest + 1] += 1;
            change[rank + 1] -= 1;
        }
    }
    let mut between = 0;
    let (mut least, mut best) = (f64::INFINITY, count / 2);
    for (cut, change) in change.iter().enumerate().take(3 * count / 5 + 1) {
        between += change;
        let left = count as f64 - cut as f64 - between as f64;
        let cost = between as f64 * (1.0 + (cut as f64 - left).abs() / count as f64);
        if cut > count / 3 && cost < least {
            (least, best) = (cost, cut);
        }
    }
    best
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
        let order = order(Ordering::Banded, 120, &pairs);
        let mut place = vec![usize::MAX; 120];
        for (k, &unknown) in order.iter().enumerate() {
            place[unknown] = k;
        }
        let width = |&(a, b): &(u32, u32)| place[a as usize].abs_diff(place[b as usize]);
        // Breadth first has levels of at most three unknowns: neighbours are within two of them.
        assert!(pairs.iter().map(width).max().unwrap() <= 5);
    }
}
