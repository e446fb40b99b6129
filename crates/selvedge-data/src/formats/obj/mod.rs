//! Meshes as Wavefront OBJ: texture coordinates are the material coordinates `[m]`, vertices keep the
//! numbers that they have in the file (from 0 here, from 1 there), and objects and groups become
//! labels of vertices.
//!
//! Files of other programs often have texture coordinates from 0 to 1 and seams, where a vertex has
//! two of them: [`ObjOptions`] says what is done then.
//!
//! Several objects make one mesh of several sheets. The reader is our own: the common ones number
//! vertices anew in every group, so that handles chosen by number would be others. Normals,
//! materials and smoothing are passed over; curves and surfaces are errors. Bytes that are not UTF-8
//! can only be part of names, where they become the replacement character.

mod assemble;
mod fit;
mod flat;
mod parse;
mod write;

use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::MeshError;
use selvedge_cloth::generate::Sheet;
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use write::write_obj;
pub(crate) use write::{ObjFrame, write_obj_frame};

/// What is done with texture coordinates that are not those of a cloth in metres.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ObjOptions {
    /// Where a vertex has two texture coordinates.
    pub seams: Seams,
    /// The unit of texture coordinates.
    pub texture: TextureUnit,
}

/// What is done where a vertex has two texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Seams {
    /// The file is refused.
    #[default]
    Refuse,
    /// The sheet is cut open along the seam: the side that comes later in the file gets vertices of
    /// its own, numbered after those of the file.
    Cut,
}

/// The unit of texture coordinates.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum TextureUnit {
    /// They are in metres.
    #[default]
    Metres,
    /// Any: each sheet's are stretched along u and along v to be as long as the sheet is at the
    /// start, and mirrored back where they are mirrored.
    Fit,
}

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

/// Reads a mesh and its labels.
///
/// # Errors
/// [`ReadObjError`] names the file, and the line or vertex that cannot be used.
pub fn read_obj(path: &Path) -> Result<Sheet, ReadObjError> {
    std::fs::read(path)
        .map_err(ObjError::Read)
        .and_then(|bytes| parse_obj_bytes(&bytes, ObjOptions::default()))
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
pub(crate) fn parse_obj_bytes(bytes: &[u8], options: ObjOptions) -> Result<Sheet, ObjError> {
    parse_obj_with(&String::from_utf8_lossy(bytes), options)
}

/// Reads a mesh and its labels from the text of a file.
///
/// # Errors
/// [`ObjError`] names the line or vertex that cannot be used.
pub fn parse_obj(text: &str) -> Result<Sheet, ObjError> {
    parse_obj_with(text, ObjOptions::default())
}

/// As [`parse_obj`], with texture coordinates taken as `options` say.
///
/// # Errors
/// As for [`parse_obj`]; [`ObjError::Fit`].
pub fn parse_obj_with(text: &str, options: ObjOptions) -> Result<Sheet, ObjError> {
    assemble::assemble(parse::parse(text)?, options)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_byte_order_mark_is_passed_over_in_a_mesh_and_in_its_vertices() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("marked.obj");
        std::fs::write(&path, "\u{feff}v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n").unwrap();
        let positions = read_obj_positions(&path).unwrap();
        assert_eq!(positions, [DVec3::ZERO, DVec3::X, DVec3::Y]);
        assert_eq!(read_obj(&path).unwrap().mesh.positions(), positions);
    }
}
