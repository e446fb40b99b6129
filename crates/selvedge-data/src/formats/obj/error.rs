//! Errors of OBJ files.

use std::path::PathBuf;

use selvedge_cloth::MeshError;
use thiserror::Error;

/// A file that is not a cloth.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct ReadObjError {
    /// The file.
    pub path: PathBuf,
    /// The problem.
    #[source]
    pub source: ObjError,
}

/// Text that is not a cloth. Lines and vertices in messages count from 1, as in the file.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ObjError {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("line {line}: {problem}")]
    Line { line: usize, problem: String },
    #[error("has no faces")]
    NoFaces,
    #[error("line {line}: this face names vertex {vertex} twice: remove it, or mend its corners")]
    RepeatedVertex { line: usize, vertex: usize },
    #[error(
        "vertex {vertex} has the texture coordinates {first} and {second}: a cloth must be cut along such a seam, each side with vertices of its own (a scene does that with mesh.seams = \"cut\"), or its texture made to agree"
    )]
    Seam {
        vertex: usize,
        first: String,
        second: String,
    },
    #[error(
        "the texture coordinates of the sheet of vertex {vertex} cannot be stretched along u and v to fit its shape: they need some extent along both"
    )]
    Fit { vertex: usize },
    #[error("line {line}: this face has no texture coordinates, but others have")]
    MissingTexture { line: usize },
    #[error(
        "has no texture coordinates and is not flat (vertex {vertex} is {distance:.3e} m out of the plane of the others): give it texture coordinates, which are the material coordinates in metres"
    )]
    Curved { vertex: usize, distance: f64 },
    #[error(
        "line {line}: this face of {corners} corners cannot be split into triangles from one of its corners: triangulate it"
    )]
    Polygon { line: usize, corners: usize },
    #[error("{0} (numbers from 0)")]
    Mesh(#[from] MeshError),
}
