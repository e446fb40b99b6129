//! Material coordinates of a flat sheet that has no texture coordinates: its own plane, isometric.
//!
//! The wale axis v is as near to up as the plane allows (in a level plane, to -z), the course axis
//! u = v × n, and the smallest u and v are 0. Only one plane for all vertices is taken.

use glam::{DVec2, DVec3};

use super::soup::Polygons;

/// Distance from the plane that still counts as flat, in units of the sheet's extent: files often
/// have six digits.
const FLATNESS: f64 = 1e-5;

/// Coordinates of the vertices in the plane of all faces `[m]`, `[vertices]`; none if they are not
/// in one.
pub(super) fn planar_coordinates(polygons: &Polygons) -> Option<Vec<DVec2>> {
    let positions = &polygons.positions;
    let normal = mean_normal(polygons).try_normalize()?;
    let center = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let extent = positions
        .iter()
        .map(|p| p.distance(center))
        .fold(0.0, f64::max);
    let is_off = |p: &DVec3| (*p - center).dot(normal).abs() > FLATNESS * extent;
    if positions.iter().any(is_off) {
        return None;
    }
    let (u, v) = axes(normal);
    let coordinates: Vec<DVec2> = positions
        .iter()
        .map(|p| DVec2::new(p.dot(u), p.dot(v)))
        .collect();
    let lowest = coordinates
        .iter()
        .copied()
        .fold(DVec2::INFINITY, DVec2::min);
    Some(coordinates.iter().map(|c| *c - lowest).collect())
}

/// Sum of the faces' area vectors.
fn mean_normal(polygons: &Polygons) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for polygon in &polygons.polygons {
        let corner = |k: usize| {
            let corner = &polygon.corners[k % polygon.corners.len()];
            polygons.positions[corner.vertex as usize]
        };
        for k in 1..polygon.corners.len().saturating_sub(1) {
            sum += (corner(k) - corner(0)).cross(corner(k + 1) - corner(0));
        }
    }
    sum
}

fn axes(normal: DVec3) -> (DVec3, DVec3) {
    let level = normal.y.abs() > 0.999;
    let up = if level { DVec3::NEG_Z } else { DVec3::Y };
    let v = (up - up.dot(normal) * normal).normalize();
    (v.cross(normal), v)
}
