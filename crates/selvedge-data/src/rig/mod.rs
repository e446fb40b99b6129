//! A rig: nodes that move, and their meshes, from the file of another program (.glb, USD).
//!
//! Nodes are placed in each other; a node's transform is the product of its operations, from the
//! outermost to the innermost, after that of its parent. Everything is brought into our world:
//! metres, y up, seconds. What else is in the file (materials, lights) is passed over.

mod body;
pub(crate) mod glb;
mod mesh;
mod node;
mod track;
mod usda;

use std::path::Path;

use glam::DMat4;

use self::mesh::RigMesh;
use crate::formats::file_error::FileError;
use crate::formats::input::{ending_of, read_file};

pub use self::body::MeshMotion;
pub(crate) use self::node::Wanted;
pub use self::node::{Rig, RigError, RigNode};

/// A format of files with nodes and meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RigFormat {
    Glb,
    Usd,
}

impl RigFormat {
    /// The format of a file whose name ends so, in lower case.
    pub(crate) fn of(extension: &str) -> Option<Self> {
        match extension {
            "glb" => Some(Self::Glb),
            "usda" | "usdc" | "usdz" | "usd" => Some(Self::Usd),
            _ => None,
        }
    }
}

impl Rig {
    /// Reads a .glb or USD (.usda, .usdc, .usdz) file; nodes of a .glb with several animations of one
    /// node stand still.
    ///
    /// # Errors
    /// [`FileError`] names the file, and what in it cannot be understood.
    pub fn read(path: &Path) -> Result<Self, FileError<RigError>> {
        Self::of_file(path, |bytes, format| {
            match Self::parse(bytes, format, Wanted::Nodes(None)) {
                Err(RigError::Animations { .. }) => Self::parse(bytes, format, Wanted::Still),
                read => read,
            }
        })
    }

    /// The rig in the bytes of a file; where meshes are wanted there is one, and the nodes that
    /// place them can be placed.
    pub(crate) fn parse(
        bytes: &[u8],
        format: RigFormat,
        wanted: Wanted<'_>,
    ) -> Result<Self, RigError> {
        let rig = match (format, wanted) {
            (RigFormat::Glb, _) => match glb::parse(bytes, wanted) {
                Err(RigError::Animations { .. }) if wanted == Wanted::Meshes => {
                    glb::parse(bytes, Wanted::Still)?
                }
                read => read?,
            },
            (RigFormat::Usd, Wanted::Motion(Some(name)) | Wanted::Nodes(Some(name))) => {
                let known = "only a .glb has animations with names";
                return Err(RigError::no_animation(name, known));
            }
            (RigFormat::Usd, _) => usda::parse(bytes, wanted)?,
        };
        if matches!(wanted, Wanted::Nodes(_)) {
            return Ok(rig);
        }
        if rig.meshes.is_empty() {
            return Err(RigError::NoMesh(rig.warnings));
        }
        for node in rig.meshes.iter().flat_map(RigMesh::nodes) {
            rig.check_chain(node)?;
        }
        Ok(rig)
    }

    /// Reads a file by its bytes, with the file named in errors.
    fn of_file<T>(
        path: &Path,
        read: impl Fn(&[u8], RigFormat) -> Result<T, RigError>,
    ) -> Result<T, FileError<RigError>> {
        let format = RigFormat::of(&ending_of(path)).ok_or_else(|| {
            let known = "the name must end in .glb, .usda, .usdc, .usdz or .usd";
            RigError::Content(known.to_owned())
        });
        let unread = |error| RigError::Content(format!("could not be read: {error}"));
        let made = format.and_then(|format| read(&read_file(path).map_err(unread)?, format));
        made.map_err(FileError::at(path))
    }

    /// The transforms M(t) M(t₀)⁻¹ of the nodes of these names in the file at `path`, from the start
    /// t₀ of the file to their last key, `[frames][names]`; M leads from a node's space to the
    /// world, by the `animation` of this name or by all. What moves by them goes rigidly with a node
    /// from wherever it starts.
    pub(crate) fn read_motion(
        path: &Path,
        animation: Option<&str>,
        names: &[String],
        frame_rate: f64,
    ) -> Result<Vec<Vec<DMat4>>, FileError<RigError>> {
        Self::of_file(path, |bytes, format| {
            Self::parse(bytes, format, Wanted::Nodes(animation))?.motion(names, frame_rate)
        })
    }
}

#[cfg(test)]
mod caches_tests;
#[cfg(test)]
mod tests;
