//! Material coordinates of a flat sheet that has no texture coordinates: its own plane, isometric.
//!
//! The wale axis v is as near to up as the plane allows (in a level plane, to -z), the course axis
//! u = v × n, and the smallest u and v are 0. Only one plane for all vertices is taken.

use glam::{DVec2, DVec3};
use selvedge_cloth::{MeshError, Topology, TopologyError};

use super::error::ObjError;
use super::parse::Statements;

/// Distance from the plane that still counts as flat, in units of the sheet's extent: files often
/// have six digits.
const FLATNESS: f64 = 1e-5;

pub(super) fn planar_coordinates(statements: &Statements) -> Result<Vec<DVec2>, ObjError> {
    let positions = &statements.positions;
    let normal = mean_normal(statements).normalize_or(DVec3::X);
    let center = positions.iter().sum::<DVec3>() / positions.len() as f64;
    let extent = positions
        .iter()
        .map(|p| p.distance(center))
        .fold(0.0, f64::max);
    for (vertex, position) in positions.iter().enumerate() {
        let distance = (*position - center).dot(normal).abs();
        if distance > FLATNESS * extent {
            // Faces that turn opposite ways have no mean normal: then flatness is not the trouble.
            check_orientation(statements)?;
            return Err(ObjError::Curved {
                vertex: vertex + 1,
                distance,
            });
        }
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
    Ok(coordinates.iter().map(|c| *c - lowest).collect())
}

/// Checks that the polygons, split in any way, all turn the same way.
fn check_orientation(statements: &Statements) -> Result<(), ObjError> {
    let mut faces = Vec::with_capacity(statements.polygons.len());
    for polygon in &statements.polygons {
        let corner = |k: usize| polygon.corners[k].vertex;
        faces.extend((1..polygon.corners.len() - 1).map(|k| [0, k, k + 1].map(corner)));
    }
    match Topology::new(statements.positions.len(), &faces) {
        Err(error @ TopologyError::InconsistentOrientation { .. }) => {
            Err(MeshError::from(error).into())
        }
        _ => Ok(()),
    }
}

/// Sum of the faces' area vectors.
fn mean_normal(statements: &Statements) -> DVec3 {
    let mut sum = DVec3::ZERO;
    for polygon in &statements.polygons {
        let corner = |k: usize| {
            let corner = &polygon.corners[k % polygon.corners.len()];
            statements.positions[corner.vertex as usize]
        };
        for k in 1..polygon.corners.len() - 1 {
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
