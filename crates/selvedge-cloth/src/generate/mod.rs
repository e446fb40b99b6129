//! Meshes made from numbers: irregular sheets (random, then relaxed; no grid lines) with evenly
//! spaced boundary vertices and all faces counter-clockwise, as the irregular meshes of Libao et al.
//! 2023.
//!
//! A shape is an outline, and what its labels mean; the mesh comes from one routine for all
//! outlines. The same numbers give the same bytes on every machine.

mod outline;
mod relax;
mod scatter;

use std::collections::BTreeMap;

use glam::{DVec2, DVec3};
use thiserror::Error;

use self::outline::sheet_from_outline;
use crate::{Mesh, MeshError};

/// Most vertices that are made: a million take a minute or so.
const MOST_VERTICES: usize = 1_000_000;

/// A square sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SquareSpec {
    /// Number of vertices, at least 4; the mesh has exactly so many.
    pub vertices: usize,
    /// Length of a side `[m]`.
    pub size: f64,
    /// Decides where the inner vertices lie.
    pub seed: u64,
}

/// A mesh and the names of some of its vertices.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    /// The mesh, hanging flat.
    pub mesh: Mesh,
    /// Lists of vertices by what they are called.
    pub labels: BTreeMap<String, Vec<u32>>,
}

/// Why a sheet cannot be made.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum GenerateError {
    #[error("a sheet of this shape needs at least {needed} vertices, found {found}")]
    TooFewVertices { found: usize, needed: usize },
    #[error("vertices must be at most {MOST_VERTICES}, found {found}")]
    TooManyVertices { found: usize },
    #[error("size must be finite and positive, found {found} m")]
    Size { found: f64 },
    #[error(
        "the outline encloses {area} m² of the {around} m² around it, too little to place vertices in: give it width, and sides that do not cross"
    )]
    Area { area: f64, around: f64 },
    #[error("the sheet cannot be triangulated: {why}")]
    Triangulation { why: String },
    #[error(transparent)]
    Mesh(#[from] MeshError),
}

/// A square sheet that hangs flat in the plane x = 0, its top edge at y = 0, its material x axis u
/// along z: (u, v) is at (0, v - size, u - size/2), its normals (-1, 0, 0). Vertex 0 is the upper
/// left corner (u = 0, v = size); the boundary is numbered on from there along the top edge
/// and round, then the inner vertices from top to bottom.
///
/// From 16 vertices on no angle is below 28° (the relaxation aims at 30°), and edges are 0.55 to 1.6
/// times as long as their mean.
///
/// Labels: `upper-corners` and `lower-corners` (left, then right), `upper-edge` (left to right),
/// `boundary`.
///
/// ```
/// use selvedge_cloth::generate::{SquareSpec, square};
///
/// let sheet = square(&SquareSpec { vertices: 1024, size: 1.0, seed: 1 })?;
/// assert_eq!(sheet.mesh.topology().vertex_count(), 1024);
/// assert_eq!(sheet.labels["upper-corners"], [0, 30]);
/// # Ok::<(), selvedge_cloth::generate::GenerateError>(())
/// ```
///
/// # Errors
/// [`GenerateError`] names what cannot be used.
pub fn square(spec: &SquareSpec) -> Result<Sheet, GenerateError> {
    if !(spec.size.is_finite() && spec.size > 0.0) {
        return Err(GenerateError::Size { found: spec.size });
    }
    let outline = vec![DVec2::Y, DVec2::ONE, DVec2::X, DVec2::ZERO];
    let flat = sheet_from_outline(&[outline], spec.vertices, spec.seed)?;
    let upper_left = flat.corners[0][0];
    let [upper_right, lower_right, lower_left] = [1, 2, 3].map(|k| flat.corners[0][k]);
    let labels = [
        ("upper-corners", vec![upper_left, upper_right]),
        ("lower-corners", vec![lower_left, lower_right]),
        ("upper-edge", (upper_left..=upper_right).collect()),
        ("boundary", (0..flat.boundary_count as u32).collect()),
    ];
    let coordinates: Vec<DVec2> = flat.points.iter().map(|p| spec.size * *p).collect();
    let hang = |c: &DVec2| DVec3::new(0.0, c.y - spec.size, c.x - spec.size / 2.0);
    let positions = coordinates.iter().map(hang).collect();
    Ok(Sheet {
        mesh: Mesh::new(&flat.faces, coordinates, positions)?,
        labels: labels.map(|(name, list)| (name.to_owned(), list)).into(),
    })
}

#[cfg(test)]
mod tests;
