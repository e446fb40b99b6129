//! Areas, normals and the signed dihedral angle, each for one element.

use glam::{DVec2, DVec3};

/// Signed area of a triangle in material space [m²]; positive when counter-clockwise.
#[must_use]
pub fn signed_area_2d(a: DVec2, b: DVec2, c: DVec2) -> f64 {
    0.5 * (b - a).perp_dot(c - a)
}

/// Area vector of a triangle: unit normal times area [m²].
#[must_use]
pub fn area_vector(a: DVec3, b: DVec3, c: DVec3) -> DVec3 {
    0.5 * (b - a).cross(c - a)
}

/// Signed dihedral angle at the edge `from` → `to` [rad], in (-π, π].
///
/// 0 where the two faces are flat, ±π where they fold onto each other. `left` is the opposite
/// vertex of the face in which `from` → `to` runs counter-clockwise, `right` that of the other.
/// Positive where the wings rise towards the normals (a valley seen from the side of the normals),
/// θ = atan2(n_left × n_right · ê, n_left · n_right) with the sign so chosen; simulator.md §2.2.
/// Swapping the faces together with the edge's direction leaves it unchanged, as does any rigid
/// motion. 0 for a degenerate face.
#[must_use]
pub fn dihedral_angle(from: DVec3, to: DVec3, left: DVec3, right: DVec3) -> f64 {
    let along = to - from;
    let normal_left = along.cross(left - from);
    let normal_right = (right - from).cross(along);
    // sin θ · |n_l||n_r| = -(n_l × n_r) · ê, for wings that rise towards the normals.
    let sine = -normal_left.cross(normal_right).dot(along) / along.length();
    let cosine = normal_left.dot(normal_right);
    if sine.is_finite() && (sine != 0.0 || cosine != 0.0) {
        sine.atan2(cosine)
    } else {
        0.0
    }
}
