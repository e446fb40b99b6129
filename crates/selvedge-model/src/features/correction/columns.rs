//! The columns of a vertex of a model that corrects physics: how many there are, and which of them
//! share a unit.

/// Columns of a vertex that are its own.
pub(super) const OWN_COLUMNS: usize = 34;
/// Vectors of an arc that are summed.
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
/// Numbers of an arc that do not change.
pub(super) const STILL_COLUMNS: usize = 5;
/// Columns of a vertex.
pub(crate) const NODE_COLUMNS: usize = OWN_COLUMNS + SUM_COLUMNS;

/// Widths of the groups of columns that share a unit and a scale, as the normaliser wants them: of
/// vertices and of corrections.
#[must_use]
pub fn correction_groups() -> [Vec<usize>; 2] {
    let mut nodes = vec![3; 10];
    nodes.extend([1; 4]);
    nodes.extend([3 * VECTOR_WEIGHTS; SUMMED_VECTORS]);
    nodes.extend([2 * SCALAR_WEIGHTS, 2 * SCALAR_WEIGHTS, 1, 1, 1]);
    [nodes, vec![3, 3]]
}
