//! Meshes as Wavefront OBJ: texture coordinates are the material coordinates `[m]`, vertices keep
//! the numbers that they have in the file (from 0 here, from 1 there), and objects and groups
//! become labels of vertices.
//!
//! A vertex with several texture coordinates lies on a seam. Files of other programs often have
//! texture coordinates from 0 to 1: [`MeshOptions`] says what is done then.
//!
//! Several objects make one mesh of several sheets. The reader is our own: the common ones number
//! vertices anew in every group, so that handles chosen by number would be others. Normals and
//! smoothing are passed over, other statements with a warning that counts them. Bytes that are not
//! UTF-8 can only be part of names, where they become the replacement character.

mod parse;
mod write;

use std::path::Path;

use glam::DVec3;
use selvedge_cloth::generate::Sheet;

use super::polygons::{MeshFileError, MeshOptions, Polygons, ReadMesh, ReadMeshError, assemble};
use crate::formats::file_error::FileError;
use crate::formats::input::read_file;
pub use write::write_obj;
pub(crate) use write::{ObjFrame, write_obj_frame};

/// Reads a mesh and its labels.
///
/// # Errors
/// [`ReadMeshError`] names the file, and the line or vertex that cannot be used.
pub fn read_obj(path: &Path) -> Result<Sheet, ReadMeshError> {
    read_file(path)
        .map_err(MeshFileError::Read)
        .and_then(|bytes| assemble(parse_obj_polygons(&bytes)?, MeshOptions::default()))
        .map(|read| read.sheet)
        .map_err(FileError::at(path))
}

/// Reads the vertices of a mesh only `[m]`, `[vertices]`; faces may be of any kind.
pub(crate) fn read_obj_positions(path: &Path) -> Result<Vec<DVec3>, ReadMeshError> {
    let positions = read_file(path)
        .map_err(MeshFileError::Read)
        .and_then(|bytes| Ok(parse_obj_polygons(&bytes)?.positions));
    positions.map_err(FileError::at(path))
}

pub(crate) fn parse_obj_polygons(bytes: &[u8]) -> Result<Polygons, MeshFileError> {
    parse::parse(&String::from_utf8_lossy(bytes))
}

/// Reads a mesh with all that the file says of it, as `options` say.
///
/// # Errors
/// [`MeshFileError`] names the line or vertex that cannot be used.
pub fn parse_obj_with(text: &str, options: MeshOptions) -> Result<ReadMesh, MeshFileError> {
    assemble(parse::parse(text)?, options)
}
