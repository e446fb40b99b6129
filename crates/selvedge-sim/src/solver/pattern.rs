//! The block pattern of the system matrix: one 3x3 block per pair of free vertices that share a
//! face or an interior edge's stencil, lower triangle only.
//!
//! Free vertices are numbered as unknowns in the order of their solver
//! ([`crate::solver::ordering`]), so the matrix can be factorised as it is. Held vertices are no
//! unknowns. Each block has a slot: first those on the diagonal, then those below it column by
//! column.

use glam::DMat3;

use crate::lists::Lists;
use crate::solver::SolveError;
use crate::solver::ordering::{Ordering, order};

#[derive(Clone, Debug)]
pub(crate) struct Pattern {
    /// Unknown of each vertex; for a held vertex the number of unknowns.
    unknown_of_vertex: Vec<u32>,
    /// Vertex of each unknown.
    vertex_of_unknown: Vec<u32>,
    /// Row of each block below the diagonal, by columns, ascending within each.
    rows: Lists,
}

impl Pattern {
    /// The pattern of a matrix that couples the vertices of each triangle and stencil. Vertices
    /// that are `held` are no unknowns.
    pub(crate) fn new(
        ordering: Ordering,
        held: &[bool],
        triangles: &[[u32; 3]],
        stencils: &[[u32; 4]],
    ) -> Result<Self, SolveError> {
        let free: Vec<u32> = (0..held.len() as u32)
            .filter(|&v| !held[v as usize])
            .collect();
        let number = number_unknowns(held.len(), &free);
        let pairs = coupled_pairs(&number, free.len(), triangles, stencils);
        let order = order(ordering, free.len(), &pairs)?;
        let vertex_of_unknown: Vec<u32> = order.iter().map(|&k| free[k]).collect();
        let unknown_of_vertex = number_unknowns(held.len(), &vertex_of_unknown);
        let renumbered = coupled_pairs(&unknown_of_vertex, free.len(), triangles, stencils);
        Ok(Self {
            unknown_of_vertex,
            vertex_of_unknown,
            rows: Lists::group(free.len(), &renumbered),
        })
    }

    pub(crate) fn unknown_count(&self) -> usize {
        self.vertex_of_unknown.len()
    }

    /// Vertex of each unknown.
    pub(crate) fn vertices(&self) -> &[u32] {
        &self.vertex_of_unknown
    }

    /// Unknown of `vertex`; [`Self::unknown_count`] if it is held.
    pub(crate) fn unknown(&self, vertex: u32) -> u32 {
        self.unknown_of_vertex[vertex as usize]
    }

    pub(crate) fn slot_count(&self) -> usize {
        self.unknown_count() + self.rows.len()
    }

    /// Slot and row of each block below the diagonal in a column, rows ascending.
    pub(crate) fn below(&self, column: usize) -> impl Iterator<Item = (u32, u32)> {
        let slots = (self.unknown_count() + self.rows.range(column).start) as u32..;
        slots.zip(self.rows.of(column).iter().copied())
    }

    /// Slot of the block that couples two vertices, if they are free and coupled. Its row belongs
    /// to the vertex with the larger unknown.
    pub(crate) fn slot(&self, first: u32, second: u32) -> Option<u32> {
        let (first, second) = (self.unknown(first), self.unknown(second));
        let (row, column) = (first.max(second), first.min(second));
        if row as usize == self.unknown_count() {
            return None;
        }
        if row == column {
            return Some(row);
        }
        let column = column as usize;
        let place = self.rows.of(column).binary_search(&row).ok()?;
        Some((self.unknown_count() + self.rows.range(column).start + place) as u32)
    }

    /// The lower triangle as compressed scalar columns: starts and row indices.
    pub(crate) fn scalar_columns(&self) -> (Vec<usize>, Vec<usize>) {
        let mut starts = vec![0];
        let mut rows = Vec::with_capacity(6 * self.unknown_count() + 9 * self.rows.len());
        for column in 0..self.unknown_count() {
            let below = self.rows.of(column);
            for axis in 0..3 {
                rows.extend((axis..3).map(|r| 3 * column + r));
                for &row in below {
                    rows.extend((0..3).map(|r| 3 * row as usize + r));
                }
                starts.push(rows.len());
            }
        }
        (starts, rows)
    }

    /// Copies blocks (by slot) into the order of [`Self::scalar_columns`].
    pub(crate) fn expand(&self, blocks: &[DMat3], values: &mut [f64]) {
        let mut rest = values;
        for column in 0..self.unknown_count() {
            let diagonal = blocks[column].to_cols_array_2d();
            let below = &blocks[self.unknown_count()..][self.rows.range(column)];
            for axis in 0..3 {
                let head = 3 - axis;
                let (now, later) = rest.split_at_mut(head + 3 * below.len());
                now[..head].copy_from_slice(&diagonal[axis][axis..]);
                for (entry, block) in now[head..].chunks_exact_mut(3).zip(below) {
                    entry.copy_from_slice(&block.col(axis).to_array());
                }
                rest = later;
            }
        }
    }
}

fn number_unknowns(vertex_count: usize, vertices: &[u32]) -> Vec<u32> {
    let mut number = vec![vertices.len() as u32; vertex_count];
    for (unknown, &vertex) in vertices.iter().enumerate() {
        number[vertex as usize] = unknown as u32;
    }
    number
}

/// Pairs (column, row) of coupled unknowns with column < row, sorted, each once.
fn coupled_pairs(
    number: &[u32],
    unknown_count: usize,
    triangles: &[[u32; 3]],
    stencils: &[[u32; 4]],
) -> Vec<(u32, u32)> {
    let mut pairs = Vec::with_capacity(3 * triangles.len() + 8 * stencils.len());
    let mut couple = |vertices: &[u32]| {
        for (k, &a) in vertices.iter().enumerate() {
            for &b in &vertices[k + 1..] {
                let (a, b) = (number[a as usize], number[b as usize]);
                if a != b && a.max(b) < unknown_count as u32 {
                    pairs.push((a.min(b), a.max(b)));
                }
            }
        }
    };
    triangles.iter().for_each(|triangle| couple(triangle));
    stencils.iter().for_each(|stencil| couple(stencil));
    pairs.sort_unstable();
    pairs.dedup();
    pairs
}

#[cfg(test)]
mod tests {
    use super::*;

    const TRIANGLES: [[u32; 3]; 4] = [[0, 1, 2], [2, 1, 3], [2, 3, 4], [4, 3, 5]];
    const HINGES: [[u32; 4]; 3] = [[1, 2, 0, 3], [2, 3, 1, 4], [3, 4, 2, 5]];

    fn pattern(held: &[u32]) -> Pattern {
        let held: Vec<bool> = (0..6).map(|v| held.contains(&v)).collect();
        Pattern::new(Ordering::MinimumDegree, &held, &TRIANGLES, &HINGES).unwrap()
    }

    fn coupled(a: u32, b: u32) -> bool {
        HINGES
            .iter()
            .any(|hinge| hinge.contains(&a) && hinge.contains(&b))
    }

    #[test]
    fn every_coupled_pair_of_free_vertices_has_its_own_slot() {
        let pattern = pattern(&[1]);
        let mut seen = std::collections::HashSet::new();
        for a in 0..6 {
            for b in a..6 {
                let slot = pattern.slot(a, b);
                assert_eq!(slot, pattern.slot(b, a));
                let expected = a != 1 && b != 1 && (a == b || coupled(a, b));
                assert_eq!(slot.is_some(), expected, "{a} {b}");
                assert!(slot.is_none_or(|slot| seen.insert(slot)));
            }
        }
        assert_eq!(seen.len(), pattern.slot_count());
    }

    #[test]
    fn expanded_values_stand_where_the_columns_say() {
        let pattern = pattern(&[5]);
        // Block of slot s: entry (r, c) = 100 s + 10 r + c.
        let blocks: Vec<DMat3> = (0..pattern.slot_count())
            .map(|slot| {
                let entry = |r: usize, c: usize| (100 * slot + 10 * r + c) as f64;
                DMat3::from_cols_array_2d(&[0, 1, 2].map(|c| [0, 1, 2].map(|r| entry(r, c))))
            })
            .collect();
        let (starts, rows) = pattern.scalar_columns();
        let mut values = vec![f64::NAN; rows.len()];
        pattern.expand(&blocks, &mut values);
        for column in 0..15 {
            let range = starts[column]..starts[column + 1];
            assert!(rows[range.clone()].is_sorted());
            assert_eq!(rows[range.start], column);
            for (row, value) in rows[range.clone()].iter().zip(&values[range]) {
                let [a, b] = [row / 3, column / 3].map(|unknown| pattern.vertices()[unknown]);
                let slot = pattern.slot(a, b).unwrap() as usize;
                assert_eq!(*value, (100 * slot + 10 * (row % 3) + column % 3) as f64);
            }
        }
    }
}
