//! The columns of a model that corrects physics: how many there are of a vertex and of an arc, and
//! which of them share a unit.

use crate::spec::Differences;

/// Columns of a vertex whose differences are over frames.
pub(crate) const NODE_COLUMNS: usize = 20;
/// Columns of a vertex whose differences are over substeps.
pub(super) const SUBSTEP_NODE_COLUMNS: usize = 34;
/// Columns of an arc.
pub(crate) const ARC_COLUMNS: usize = 24;
/// Vectors of an arc that are summed: those of [`ARC_COLUMNS`] that begin a row, 3 columns each.
pub(super) const SUMMED_VECTORS: usize = 4;
/// Scalars of an arc that are summed: strains and angles.
pub(super) const SUMMED_SCALARS: usize = 4;
/// Weights of a sum of vectors: of the direction φ of an arc cos φ, sin φ, 1, cos 2φ and sin 2φ.
pub(super) const VECTOR_WEIGHTS: usize = 5;
/// Weights of a sum of scalars: 1, cos 2φ and sin 2φ.
pub(super) const SCALAR_WEIGHTS: usize = 3;
/// Columns of the sums over the arcs of a vertex: vectors, scalars, and the mean logarithms of
/// length and stiffnesses.
pub(super) const SUM_COLUMNS: usize =
    3 * SUMMED_VECTORS * VECTOR_WEIGHTS + SUMMED_SCALARS * SCALAR_WEIGHTS + 3;
/// Columns of an arc that do not change: see [`StillColumns`].
pub(super) const STILL_COLUMNS: usize = 5;

/// The columns by which a vertex knows its neighbours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Neighbours {
    /// Those of every arc.
    Arcs,
    /// Sums over the arcs that arrive at the vertex, among its own columns. `[eq:arc-sums]`
    Sums,
}

/// The columns of a model.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct ColumnSet {
    /// Those by which a vertex knows its neighbours.
    pub neighbours: Neighbours,
    /// The differences of the motion.
    pub differences: Differences,
}

impl ColumnSet {
    /// Columns of a vertex that are its own.
    pub(super) const fn own_columns(self) -> usize {
        match self.differences {
            Differences::Frames => NODE_COLUMNS,
            Differences::Substeps => SUBSTEP_NODE_COLUMNS,
        }
    }

    /// Columns of a vertex.
    pub(crate) const fn node_columns(self) -> usize {
        match self.neighbours {
            Neighbours::Arcs => self.own_columns(),
            Neighbours::Sums => self.own_columns() + SUM_COLUMNS,
        }
    }

    /// Columns of an arc.
    pub(crate) const fn arc_columns(self) -> usize {
        match self.neighbours {
            Neighbours::Arcs => ARC_COLUMNS,
            Neighbours::Sums => 0,
        }
    }

    /// Widths of the groups of columns that share a unit and a scale, as the normaliser wants them:
    /// of vertices, of arcs and of corrections.
    #[must_use]
    pub fn groups(self) -> [Vec<usize>; 3] {
        let mut nodes = match self.differences {
            Differences::Frames => vec![3, 3, 3, 3, 3, 3, 1, 1],
            Differences::Substeps => vec![3, 3, 3, 3, 3, 3, 3, 3, 3, 3, 1, 1, 1, 1],
        };
        let arcs = match self.neighbours {
            Neighbours::Arcs => vec![3, 3, 3, 3, 3, 2, 2, 2, 1, 1, 1],
            Neighbours::Sums => {
                nodes.extend([3 * VECTOR_WEIGHTS; SUMMED_VECTORS]);
                nodes.extend([2 * SCALAR_WEIGHTS, 2 * SCALAR_WEIGHTS, 1, 1, 1]);
                Vec::new()
            }
        };
        [nodes, arcs, vec![3, 3]]
    }
}
