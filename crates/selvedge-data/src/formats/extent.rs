//! How large a mesh is, and how near its vertices may be and yet be two.

use glam::DVec3;

/// Part of a mesh's extent up to which vertices of formats that split them coincide: single
/// precision at some ten roundings.
pub(crate) const COINCIDENT: f64 = 1e-6;

/// Longest side of the box around `positions`.
pub(crate) fn extent(positions: &[DVec3]) -> f64 {
    let first = positions.first().copied().unwrap_or_default();
    let low = positions.iter().fold(first, |low, p| low.min(*p));
    let high = positions.iter().fold(first, |high, p| high.max(*p));
    (high - low).max_element()
}
