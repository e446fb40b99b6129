//! Rest shapes of a cloth without a pattern: each face as it is in space, lengths and all, with its
//! wale axis v as near to a given direction as the face allows.
//!
//! The course axis is u = v × n, as in the plane of a flat sheet. On a face across the direction
//! the wale axis is as near to -z as the face allows, and to x across that.

use glam::{DVec2, DVec3};

/// Parts of a direction's length below which a face counts as across it.
const ACROSS: f64 = 1e-3;

/// The corners of a triangle in its own plane `[m]`, its first at the origin. `[eq:own-shape]`
pub(super) fn own_shape(corners: [DVec3; 3], thread: DVec3) -> [DVec2; 3] {
    let [a, b, c] = corners;
    let normal = (b - a).cross(c - a).normalize_or(DVec3::Z);
    let (u, v) = axes(normal, thread);
    corners.map(|corner| DVec2::new((corner - a).dot(u), (corner - a).dot(v)))
}

/// Course and wale axis in the plane with this unit `normal`.
pub(super) fn axes(normal: DVec3, thread: DVec3) -> (DVec3, DVec3) {
    let within = |direction: DVec3| direction - direction.dot(normal) * normal;
    let directions = [thread.normalize_or(DVec3::Y), DVec3::NEG_Z, DVec3::X];
    let nearest = directions
        .into_iter()
        .map(within)
        .find(|d| d.length() > ACROSS);
    let v = nearest.unwrap_or(DVec3::Y).normalize();
    (v.cross(normal), v)
}

/// Corners of a polygon in the plane of its mean normal (Newell's).
pub(super) fn in_own_plane(corners: &[DVec3]) -> Vec<DVec2> {
    let count = corners.len();
    let normal: DVec3 = (0..count)
        .map(|k| (corners[k] - corners[0]).cross(corners[(k + 1) % count] - corners[0]))
        .sum();
    let (u, v) = axes(normal.normalize_or(DVec3::Z), DVec3::Y);
    corners
        .iter()
        .map(|p| DVec2::new(p.dot(u), p.dot(v)))
        .collect()
}
