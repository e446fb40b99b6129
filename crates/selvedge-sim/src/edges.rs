//! The edges that are not held at both ends, and their strain, which is watched.

use glam::DVec3;
use selvedge_cloth::{Handles, Mesh, VertexId};

/// An edge that is not held at both ends.
pub(crate) struct FreeEdge {
    pub(crate) ends: [usize; 2],
    /// Parts of a change of length that the ends take: halves, or all of it beside a held end.
    pub(crate) parts: [f64; 2],
    /// Length in the pattern `[m]`, and the edge's number.
    pub(crate) length: f64,
    pub(crate) number: usize,
}

/// The edges of `mesh` that are not `held` at both ends, `[vertices]`.
pub(crate) fn free_edges(mesh: &Mesh, held: &[bool]) -> Vec<FreeEdge> {
    let edges = mesh.topology().edges().iter();
    let edges = edges.zip(mesh.pattern().edge_lengths()).enumerate();
    let free = edges.filter_map(|(number, (edge, length))| {
        let ends = edge.vertices.map(VertexId::index);
        let parts = match ends.map(|v| held[v]) {
            [false, false] => [0.5, 0.5],
            [false, true] => [1.0, 0.0],
            [true, false] => [0.0, 1.0],
            [true, true] => return None,
        };
        Some(FreeEdge {
            ends,
            parts,
            length,
            number,
        })
    });
    free.collect()
}

/// The watched edges of a cloth.
pub(crate) struct WatchedEdges(Vec<WatchedEdge>);

struct WatchedEdge {
    ends: [usize; 2],
    /// 1/l₀ `[1/m]`.
    inverse_rest: f64,
}

/// An edge that is strained beyond what cloth can.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Overstretched {
    /// Ends of the edge.
    pub(crate) vertices: [VertexId; 2],
    /// Its strain l/l₀ - 1.
    pub(crate) strain: f64,
}

impl WatchedEdge {
    /// Returns true if |l - l'|/l₀ ≤ `bound`. Where it surely is, that is found without a root:
    /// (l² - l'²)² is (l - l')² (l + l')², and (l + l')² ≥ l² + l'².
    #[inline]
    fn keeps_its_length(&self, bound: f64, before: &[DVec3], after: &[DVec3]) -> bool {
        let [a, b] = self.ends;
        let from = before[a].distance_squared(before[b]);
        let to = after[a].distance_squared(after[b]);
        let difference = (to - from) * self.inverse_rest;
        if difference * difference <= bound * bound * (from + to) {
            return true;
        }
        let change = (to.sqrt() - from.sqrt()).abs() * self.inverse_rest;
        // A position that is no number is found elsewhere.
        change <= bound || change.is_nan()
    }
}

impl WatchedEdges {
    /// The edges of `mesh` that `handles` do not hold at both ends.
    pub(crate) fn new(mesh: &Mesh, handles: &Handles) -> Self {
        let held = handles.mask(mesh.topology().vertex_count());
        let watched = free_edges(mesh, &held).into_iter().map(|edge| WatchedEdge {
            ends: edge.ends,
            inverse_rest: edge.length.recip(),
        });
        Self(watched.collect())
    }

    /// Returns true if no stretch of an edge changes by more than `bound` between `before` and
    /// `after` `[m]`, `[vertices]`. `[eq:stretch-change]`
    pub(crate) fn keep_their_lengths(&self, before: &[DVec3], after: &[DVec3], bound: f64) -> bool {
        let mut edges = self.0.iter();
        edges.all(|edge| edge.keeps_its_length(bound, before, after))
    }

    /// Checks the lengths of the edges `after` a frame that began at `before` `[m]`, `[vertices]`.
    ///
    /// # Errors
    /// The edge with the largest strain of those that are longer than before, if
    /// l/l₀ - 1 > `bound`.
    pub(crate) fn check_stretch(
        &self,
        before: &[DVec3],
        after: &[DVec3],
        bound: f64,
    ) -> Result<(), Overstretched> {
        let square = |[a, b]: [usize; 2], of: &[DVec3]| of[a].distance_squared(of[b]);
        let mut most = (1.0 + bound).powi(2);
        let mut worst = None;
        for edge in &self.0 {
            let now = square(edge.ends, after);
            let stretch = now * edge.inverse_rest * edge.inverse_rest;
            if stretch > most && now > square(edge.ends, before) {
                most = stretch;
                worst = Some(edge.ends.map(|v| VertexId(v as u32)));
            }
        }
        let strain = most.sqrt() - 1.0;
        worst.map_or(Ok(()), |vertices| Err(Overstretched { vertices, strain }))
    }
}
