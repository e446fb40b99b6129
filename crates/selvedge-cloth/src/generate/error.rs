//! Errors of generated meshes.

use thiserror::Error;

use crate::MeshError;

/// Most vertices that are made: a million take a minute or so.
pub(super) const MOST_VERTICES: usize = 1_000_000;

/// A sheet that cannot be made.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum GenerateError {
    #[error("a sheet of this shape needs at least {needed} vertices, found {found}")]
    TooFewVertices { found: usize, needed: usize },
    #[error("vertices must be at most {MOST_VERTICES}, found {found}")]
    TooManyVertices { found: usize },
    #[error("size must be finite and positive, found {found} m")]
    Size { found: f64 },
    #[error("width must be finite and positive, found {found} m")]
    Width { found: f64 },
    #[error(
        "the outline encloses {area} m² of the {around} m² around it, too little to place vertices in: give it width, and sides that do not cross"
    )]
    Area { area: f64, around: f64 },
    #[error("the sheet cannot be triangulated: {why}")]
    Triangulation { why: String },
    #[error("interrupted while the mesh was being made")]
    Interrupted,
    #[error(transparent)]
    Mesh(#[from] MeshError),
}
