//! Choices for an export: format, frames, axis, normals and velocities.

use super::frame_span::FrameSpan;
use crate::UpAxis;

/// A format that trajectories are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// USD as text: a mesh with time samples.
    Usda,
    /// USD as a binary crate.
    Usdc,
    /// USD as an archive of one crate.
    Usdz,
    /// glTF in one binary file: a mesh with a morph target per frame.
    Glb,
    /// A point cache of all frames, and the mesh of the first beside it (.obj).
    Pc2,
    /// One frame as a mesh.
    Obj,
    /// A folder with a mesh per frame.
    ObjSequence,
    /// Alembic, in Ogawa: meshes with samples.
    Abc,
    /// NumPy's archive of arrays.
    Npz,
}

impl ExportFormat {
    /// True for a file that holds one frame.
    #[must_use]
    pub fn holds_one_frame(self) -> bool {
        match self {
            Self::Obj => true,
            Self::Usda
            | Self::Usdc
            | Self::Usdz
            | Self::Glb
            | Self::Pc2
            | Self::ObjSequence
            | Self::Abc
            | Self::Npz => false,
        }
    }

    /// True for a file that can hold velocities.
    #[must_use]
    pub fn has_velocities(self) -> bool {
        match self {
            Self::Usda | Self::Usdc | Self::Usdz | Self::Abc => true,
            Self::Glb | Self::Pc2 | Self::Obj | Self::ObjSequence | Self::Npz => false,
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

/// Choice of writing a velocity for each vertex and frame, for motion blur.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Velocities {
    /// Velocities are written: the slope of the parabola through the frame and its neighbours in
    /// the trajectory.
    Written,
    /// Velocities are left out.
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
    /// Velocities, of a format that [can hold](ExportFormat::has_velocities) them.
    pub velocities: Velocities,
}

impl ExportOptions {
    /// All frames with y up, and what who opens such a file expects in it.
    #[must_use]
    pub fn usual(format: ExportFormat) -> Self {
        use ExportFormat::{Abc, Glb, Npz, Obj, ObjSequence, Pc2, Usda, Usdc, Usdz};
        Self {
            format,
            frames: FrameSpan::default(),
            up: UpAxis::default(),
            normals: match format {
                Glb => Normals::Written,
                Usda | Usdc | Usdz | Pc2 | Obj | ObjSequence | Abc | Npz => Normals::LeftOut,
            },
            velocities: match format {
                Abc | Usdc | Usdz => Velocities::Written,
                Usda | Glb | Pc2 | Obj | ObjSequence | Npz => Velocities::LeftOut,
            },
        }
    }

    /// The usual options of the format whose files end in `.ending`; none for an ending of none.
    #[must_use]
    pub fn of_ending(ending: &str) -> Option<Self> {
        use ExportFormat::{Abc, Glb, Npz, Obj, Pc2, Usda, Usdc, Usdz};
        let formats = [
            ("usda", Usda),
            ("usdc", Usdc),
            ("usdz", Usdz),
            ("glb", Glb),
            ("pc2", Pc2),
            ("obj", Obj),
            ("abc", Abc),
            ("npz", Npz),
        ];
        let found = formats.iter().find(|(name, _)| *name == ending);
        found.map(|(_, format)| Self::usual(*format))
    }
}
