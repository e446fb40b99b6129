//! Rest shapes of a cloth without texture coordinates.
//!
//! A sheet in one plane has its own plane as the pattern: the wale axis v is as near to up as the
//! plane allows (in a level plane, to -z), the course axis u = v × n, and the smallest u and v are 0.
//!
//! Any other cloth rests face by face as it is in space, with the wale axis as near to a given
//! direction as the face allows. On a face across the direction it is as near to -z as the face
//! allows, and to x across that.

use glam::{DVec2, DVec3};

use super::Polygons;

/// Parts of a direction's length below which a face counts as across it.
const ACROSS: f64 = 1e-3;

/// The corners of a triangle in its own plane `[m]`, its first at the origin. `[eq:own-shape]`
pub(crate) fn own_shape(corners: [DVec3; 3], thread: DVec3) -> [DVec2; 3] {
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

/// Twice the area vectors of the triangles that the first corner makes with each side of a polygon.
fn area_vectors(corners: &[DVec3]) -> impl Iterator<Item = DVec3> {
    let first = corners.first().copied().unwrap_or_default();
    let sides = corners.windows(2);
    sides.map(move |side| (side[0] - first).cross(side[1] - first))
}

/// Corners of a polygon in the plane of its mean normal (Newell's).
pub(super) fn in_own_plane(corners: &[DVec3]) -> Vec<DVec2> {
    let normal: DVec3 = area_vectors(corners).sum();
    let (u, v) = axes(normal.normalize_or(DVec3::Z), DVec3::Y);
    let drawn = corners.iter().map(|p| DVec2::new(p.dot(u), p.dot(v)));
    drawn.collect()
}

/// Distance from the plane that still counts as flat, in units of the sheet's extent: files often
/// have six digits.
const FLATNESS: f64 = 1e-5;

/// Coordinates of the vertices in the plane of all faces `[m]`, `[vertices]`; none if they are not
/// in one.
pub(super) fn planar_coordinates(polygons: &Polygons) -> Option<Vec<DVec2>> {
    let positions = &polygons.positions;
    let mut normal = DVec3::ZERO;
    for polygon in &polygons.polygons {
        normal = area_vectors(&polygons.places(polygon)).fold(normal, |sum, area| sum + area);
    }
    let normal = normal.try_normalize()?;
    let center = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let extent = positions.iter().map(|p| p.distance(center));
    let extent = extent.fold(0.0, f64::max);
    let is_off = |p: &DVec3| (*p - center).dot(normal).abs() > FLATNESS * extent;
    if positions.iter().any(is_off) {
        return None;
    }
    let (u, v) = upward_axes(normal);
    let coordinates = positions.iter().map(|p| DVec2::new(p.dot(u), p.dot(v)));
    let coordinates: Vec<DVec2> = coordinates.collect();
    let lowest = coordinates.iter().copied();
    let lowest = lowest.fold(DVec2::INFINITY, DVec2::min);
    Some(coordinates.iter().map(|c| *c - lowest).collect())
}

fn upward_axes(normal: DVec3) -> (DVec3, DVec3) {
    let level = normal.y.abs() > 0.999;
    let up = if level { DVec3::NEG_Z } else { DVec3::Y };
    let v = (up - up.dot(normal) * normal).normalize();
    (v.cross(normal), v)
}
