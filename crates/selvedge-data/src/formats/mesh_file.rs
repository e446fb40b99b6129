//! Meshes in files of any kind that is known: the ending of the name says which.

use std::path::Path;

use super::obj::parse_obj_polygons;
use super::polygons::{MeshFileError, MeshOptions, ReadMesh, ReadMeshError, Sewing, assemble, sew};
use crate::formats::extent::{COINCIDENT, extent};
use crate::formats::file_error::FileError;
use crate::formats::input::{ending_of, read_file};
use crate::rig::{Rig, RigError, RigFormat, Wanted};

/// Reads a mesh from a file (.obj, .glb, USD), as `options` say.
///
/// # Errors
/// [`ReadMeshError`] names the file, and the line, face or vertex that cannot be used.
pub fn read_mesh(path: &Path, options: MeshOptions) -> Result<ReadMesh, ReadMeshError> {
    read_file(path)
        .map_err(MeshFileError::Read)
        .and_then(|bytes| parse_mesh_bytes(path, &bytes, options, &Sewing::default()))
        .map_err(FileError::at(path))
}

/// Reads a mesh from the bytes of the file at `path`, whose name says its format, and sews it.
pub(crate) fn parse_mesh_bytes(
    path: &Path,
    bytes: &[u8],
    mut options: MeshOptions,
    sewing: &Sewing,
) -> Result<ReadMesh, MeshFileError> {
    let ending = ending_of(path);
    let format = RigFormat::of(&ending);
    let mut polygons = match (ending.as_str(), format) {
        (_, Some(format)) => {
            let rig = Rig::parse(bytes, format, Wanted::Meshes);
            rig.and_then(|rig| rig.polygons())
                .map_err(|error| match error {
                    RigError::NoMesh(left) if left.is_empty() => MeshFileError::NoMesh,
                    other => MeshFileError::content(other),
                })?
        }
        ("obj" | "", None) => parse_obj_polygons(bytes)?,
        (_, None) => {
            let known =
                "is no kind of mesh that can be read: .obj, .glb, .usda, .usdc, .usdz or .usd";
            return Err(MeshFileError::content(known));
        }
    };
    sew(&mut polygons, sewing)?;
    if format.is_some() {
        // These formats split vertices along seams.
        let apart = COINCIDENT * extent(&polygons.positions);
        options.weld.get_or_insert(apart);
    }
    assemble(polygons, options)
}
