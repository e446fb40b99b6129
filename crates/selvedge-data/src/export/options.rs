//! Choices for an export: format, frames, axis and normals.

use super::frame_span::FrameSpan;
use crate::UpAxis;

/// A format that trajectories are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// USD as text: a mesh with time samples.
    Usda,
    /// glTF in one binary file: a mesh with a morph target per frame.
    Glb,
    /// A point cache of all frames, and the mesh of the first beside it (.obj).
    Pc2,
    /// One frame as a mesh.
    Obj,
    /// A folder with a mesh per frame.
    ObjSequence,
    /// NumPy's archive of arrays.
    Npz,
}

impl ExportFormat {
    /// True for a file that holds one frame.
    #[must_use]
    pub fn holds_one_frame(self) -> bool {
        match self {
            Self::Obj => true,
            Self::Usda | Self::Glb | Self::Pc2 | Self::ObjSequence | Self::Npz => false,
        }
    }
}

/// Choice of writing a normal for each vertex and frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normals {
    /// Normals are written: the mean of the normals of the faces by their areas.
    Written,
    /// Normals are left out: the other program makes its own.
    #[default]
    LeftOut,
}

/// Options of an export.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExportOptions {
    /// The format.
    pub format: ExportFormat,
    /// The frames.
    pub frames: FrameSpan,
    /// Axis that points up in the file; glTF has y up.
    pub up: UpAxis,
    /// Normals; a point cache has none.
    pub normals: Normals,
}
