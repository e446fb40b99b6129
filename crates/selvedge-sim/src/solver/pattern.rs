//! The block pattern of the system matrix: one 3x3 block per pair of free vertices that share a
//! face or an interior edge's stencil, lower triangle only.
//!
//! Free vertices are numbered as unknowns in the order of their solver
//! ([`crate::solver::ordering`]), so the matrix can be factorised as it is. Held vertices are no
//! unknowns. Each block has a slot: first those on the diagonal, then those below it column by
//! column.

use crate::lists::Lists;
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
    ) -> Self {
        let free: Vec<u32> = (0..held.len() as u32)
            .filter(|&v| !held[v as usize])
            .collect();
        let number = number_unknowns(held.len(), &free);
        let pairs = coupled_pairs(&number, free.len(), triangles, stencils);
        let order = order(ordering, free.len(), &pairs);
        let vertex_of_unknown: Vec<u32> = order.iter().map(|&k| free[k]).collect();
        let unknown_of_vertex = number_unknowns(held.len(), &vertex_of_unknown);
        let renumbered = coupled_pairs(&unknown_of_vertex, free.len(), triangles, stencils);
        Self {
            unknown_of_vertex,
            vertex_of_unknown,
            rows: Lists::group(free.len(), &renumbered),
        }
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
