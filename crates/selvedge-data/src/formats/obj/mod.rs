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

use super::polygons::{MeshFileError, MeshOptions, Polygons, ReadMesh, assemble};
pub use write::write_obj;
pub(crate) use write::{ObjFrame, write_obj_frame};

/// The polygons in the bytes of a file.
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
