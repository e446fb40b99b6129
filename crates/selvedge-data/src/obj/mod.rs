//! Meshes as Wavefront OBJ: texture coordinates are the material coordinates `[m]`, vertices keep the
//! numbers that they have in the file (from 0 here, from 1 there), and objects and groups become
//! labels of vertices.
//!
//! Several objects make one mesh of several sheets. The reader is our own: the common ones number
//! vertices anew in every group, so that handles chosen by number would be others. Normals,
//! materials and smoothing are passed over; curves and surfaces are errors. Bytes that are not UTF-8
//! can only be part of names, where they become the replacement character.

mod assemble;
mod flat;
mod parse;
mod write;

use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::MeshError;
use selvedge_cloth::generate::Sheet;
use thiserror::Error;

pub use write::write_obj;

/// Why a file is not a cloth.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct ReadObjError {
    /// The file.
    pub path: PathBuf,
    /// What is wrong with it.
    #[source]
    pub source: ObjError,
}

/// Why text is not a cloth. Lines and vertices in messages count from 1, as in the file.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ObjError {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("line {line}: {problem}")]
    Line { line: usize, problem: String },
    #[error("has no faces")]
    NoFaces,
    #[error(
        "vertex {vertex} has the texture coordinates {first} and {second}: a cloth must be cut along such a seam, each side with vertices of its own, or its texture made to agree"
    )]
    Seam {
        vertex: usize,
        first: String,
        second: String,
    },
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

/// Reads a mesh and its labels.
///
/// # Errors
/// [`ReadObjError`] names the file, and the line or vertex that cannot be used.
pub fn read_obj(path: &Path) -> Result<Sheet, ReadObjError> {
    std::fs::read(path)
        .map_err(ObjError::Read)
        .and_then(|bytes| parse_obj_bytes(&bytes))
        .map_err(|source| ReadObjError {
            path: path.to_owned(),
            source,
        })
}

/// Reads the vertices of a mesh only `[m]`, `[vertices]`; faces may be of any kind.
pub(crate) fn read_obj_positions(path: &Path) -> Result<Vec<DVec3>, ReadObjError> {
    let positions = std::fs::read(path)
        .map_err(ObjError::Read)
        .and_then(|bytes| Ok(parse::parse(&String::from_utf8_lossy(&bytes))?.positions));
    positions.map_err(|source| ReadObjError {
        path: path.to_owned(),
        source,
    })
}

/// Reads a mesh and its labels from the bytes of a file.
pub(crate) fn parse_obj_bytes(bytes: &[u8]) -> Result<Sheet, ObjError> {
    parse_obj(&String::from_utf8_lossy(bytes))
}

/// Reads a mesh and its labels from the text of a file.
///
/// # Errors
/// [`ObjError`] names the line or vertex that cannot be used.
pub fn parse_obj(text: &str) -> Result<Sheet, ObjError> {
    // Some programs put a byte-order mark before the first line.
    let text = text.trim_start_matches('\u{feff}');
    assemble::assemble(&parse::parse(text)?)
}
