//! Choices for an export: format, frames, axis, normals and velocities.

use std::str::FromStr;

use crate::UpAxis;
use crate::formats::file_error::Problem;

/// A format that trajectories are written in.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportFormat {
    /// USD as a binary crate: a mesh with time samples.
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
    pub fn holds_one_frame(self) -> bool {
        self == Self::Obj
    }

    /// True for a file that can hold velocities.
    pub fn has_velocities(self) -> bool {
        matches!(self, Self::Usdc | Self::Usdz | Self::Abc)
    }
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
    /// True for a normal of each vertex and frame, the mean of those of the faces by their areas;
    /// a point cache has none.
    pub normals: bool,
    /// True for a velocity of each vertex and frame, for motion blur: the slope of the parabola
    /// through the frame and its neighbours in the trajectory. Of a format that [can
    /// hold](ExportFormat::has_velocities) them.
    pub velocities: bool,
}

impl ExportOptions {
    /// All frames with y up, without normals and velocities.
    pub fn plain(format: ExportFormat) -> Self {
        Self {
            format,
            frames: FrameSpan::default(),
            up: UpAxis::default(),
            normals: false,
            velocities: false,
        }
    }

    /// All frames with y up, and what who opens such a file expects in it.
    pub fn usual(format: ExportFormat) -> Self {
        use ExportFormat::{Abc, Glb, Usdc, Usdz};
        Self {
            normals: format == Glb,
            velocities: matches!(format, Abc | Usdc | Usdz),
            ..Self::plain(format)
        }
    }

    /// The usual options of the format whose files end in `.ending`, in small or capital letters; none for an ending of none.
    pub fn of_ending(ending: &str) -> Option<Self> {
        use ExportFormat::{Abc, Glb, Npz, Obj, Pc2, Usdc, Usdz};
        let formats = [
            ("usdc", Usdc),
            ("usdz", Usdz),
            ("glb", Glb),
            ("pc2", Pc2),
            ("obj", Obj),
            ("abc", Abc),
            ("npz", Npz),
        ];
        let found = formats
            .iter()
            .find(|(name, _)| name.eq_ignore_ascii_case(ending));
        found.map(|(_, format)| Self::usual(*format))
    }
}

/// A span of frames: from one to another, both included, and every so many of them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameSpan {
    /// The first one; the first there is, if there is none.
    pub first: Option<usize>,
    /// The last one; the last there is, if there is none.
    pub last: Option<usize>,
    /// Every so many of them, from the first.
    pub every: usize,
}

impl Default for FrameSpan {
    fn default() -> Self {
        Self {
            first: None,
            last: None,
            every: 1,
        }
    }
}

impl FromStr for FrameSpan {
    type Err = Problem;

    /// Reads `20..80`, `20..`, `..80` or `20`; every one of them.
    fn from_str(text: &str) -> Result<Self, Problem> {
        let wrong = || {
            Problem(format!(
                "{text:?} says no frames: write 20..80 (both included), 20.., ..80, or one number"
            ))
        };
        let number = |part: &str| match part.trim() {
            "" => Ok(None),
            digits => digits.parse().map(Some).map_err(|_| wrong()),
        };
        let (first, last) = match text.split_once("..") {
            Some((first, last)) => (number(first)?, number(last)?),
            None => {
                let only = number(text)?.ok_or_else(wrong)?;
                (Some(only), Some(only))
            }
        };
        Ok(Self {
            first,
            last,
            every: 1,
        })
    }
}

impl FrameSpan {
    /// The numbers of the frames, of a run of `count` (at least one).
    ///
    /// # Errors
    /// [`Problem`] where there are none, or one that the run does not have.
    pub fn of(&self, count: usize) -> Result<Vec<usize>, Problem> {
        let end = count.saturating_sub(1);
        let (first, last) = (self.first.unwrap_or(0), self.last.unwrap_or(end));
        if let Some(frame) = [first, last].into_iter().find(|&frame| frame > end) {
            return Err(Problem(format!(
                "frame {frame} was asked for, but the run has the frames 0 to {end}"
            )));
        }
        if first > last {
            return Err(Problem(format!(
                "frames {first}..{last}: there are none, for the last is before the first"
            )));
        }
        if self.every == 0 {
            let problem = "every 0th frame was asked for: 1 is every frame";
            return Err(Problem(problem.to_owned()));
        }
        Ok((first..=last).step_by(self.every).collect())
    }
}
