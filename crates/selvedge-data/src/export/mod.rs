//! A trajectory in the formats of other programs: .usda, .glb, .pc2 with an .obj, .obj by the frame,
//! .npz. One file per format; all of them write a [`Take`], frames of the trajectory as they are
//! wanted.
//!
//! Frames are streamed: beside the trajectory, memory holds a frame or two. Files are written beside
//! their place and renamed, folders as a whole. Positions are those of the trajectory, in metres;
//! the first exported frame is at time 0. Vertices keep their numbers, material coordinates become
//! texture coordinates.

mod glb;
mod glb_json;
mod npz;
mod obj;
mod pc2;
mod take;
mod usda;

use std::io;
use std::ops::ControlFlow;
use std::path::Path;

use thiserror::Error;

pub use self::npz::NpzTrajectoryError;
pub(crate) use self::npz::handle_positions;
pub use self::take::{FrameSpan, FrameSpanError, Take};
use crate::UpAxis;
use crate::formats::atomic::WriteError;
use crate::trajectory::Trajectory;

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

/// Whether a normal is written for each vertex and frame.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Normals {
    /// It is: the mean of its faces' normals by their areas.
    Written,
    /// It is not: the other program makes its own.
    #[default]
    LeftOut,
}

/// What is written, and how.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ExportOptions {
    /// The format.
    pub format: ExportFormat,
    /// Which frames.
    pub frames: FrameSpan,
    /// Which axis points up in the file; glTF has y up.
    pub up: UpAxis,
    /// Whether normals are written; a point cache has none.
    pub normals: Normals,
}

/// How an export ended that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportEnd {
    /// All frames were written.
    Complete,
    /// `observe` asked to stop: nothing was written.
    Stopped,
}

/// Why a trajectory was not exported; what was there before still is.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ExportError {
    #[error(transparent)]
    Frames(#[from] FrameSpanError),
    #[error(
        "{format} would have {bytes} bytes, more than the 4 GiB that the format can hold: {remedy}"
    )]
    TooLarge {
        format: &'static str,
        bytes: u64,
        remedy: String,
    },
    #[error(
        "an .obj file holds one frame, and {frames} were asked for: choose one, or a folder for all of them"
    )]
    OneFrame { frames: usize },
    #[error("glTF has y up: the axis cannot be chosen")]
    YUp,
    #[error(transparent)]
    Write(#[from] WriteError),
}

/// The most bytes that a file can have whose lengths have 32 bits.
const LARGEST: u64 = u32::MAX as u64;

/// Writes frames of `trajectory` to `path`; after each frame `observe` is told, and may stop.
///
/// # Errors
/// [`ExportError`] says what cannot be written, and why; nothing is then written.
pub fn export(
    trajectory: &Trajectory,
    path: &Path,
    options: &ExportOptions,
    observe: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<ExportEnd, ExportError> {
    let take = Take::new(trajectory, options)?;
    let mut pulse = Pulse(observe);
    let written = match options.format {
        ExportFormat::Usda => usda::write(&take, path, &mut pulse),
        ExportFormat::Glb => glb::write(&take, path, &mut pulse),
        ExportFormat::Pc2 => pc2::write(&take, path, &mut pulse),
        ExportFormat::Obj => obj::write_one(&take, path, &mut pulse),
        ExportFormat::ObjSequence => obj::write_all(&take, path, &mut pulse),
        ExportFormat::Npz => npz::write(&take, path, &mut pulse),
    };
    match written {
        Ok(()) => Ok(ExportEnd::Complete),
        Err(ExportError::Write(error)) if is_stop(&error.source) => Ok(ExportEnd::Stopped),
        Err(error) => Err(error),
    }
}

/// How many bytes the file will have, where that is known before it is written.
///
/// # Errors
/// As [`export`].
pub fn planned_bytes(
    trajectory: &Trajectory,
    options: &ExportOptions,
) -> Result<Option<u64>, ExportError> {
    let take = Take::new(trajectory, options)?;
    Ok(match options.format {
        ExportFormat::Glb => Some(glb::planned_bytes(&take)),
        ExportFormat::Pc2 => Some(pc2::planned_bytes(&take)),
        _ => None,
    })
}

/// Tells the observer of each frame.
struct Pulse<'a>(&'a mut dyn FnMut() -> ControlFlow<()>);

/// The observer asked to stop.
#[derive(Debug, Error)]
#[error("stopped")]
struct Stop;

impl Pulse<'_> {
    /// One more frame is written; an error that [`is_stop`] knows where that is to be the last.
    fn beat(&mut self) -> io::Result<()> {
        match (self.0)() {
            ControlFlow::Continue(()) => Ok(()),
            ControlFlow::Break(()) => Err(io::Error::other(Stop)),
        }
    }
}

fn is_stop(error: &io::Error) -> bool {
    error.get_ref().is_some_and(|inner| inner.is::<Stop>())
}

/// An error where `bytes`, of every `every`th frame, are more than lengths of 32 bits can say, with the
/// thinning that helps.
fn check_size(format: &'static str, bytes: u64, every: usize) -> Result<(), ExportError> {
    if bytes <= LARGEST {
        return Ok(());
    }
    let every = every as u64 * bytes.div_ceil(LARGEST);
    Err(ExportError::TooLarge {
        format,
        bytes,
        remedy: format!(
            "take every {every}th frame, or fewer frames, or .usda, which has no limit"
        ),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_too_large_is_told_with_the_thinning_that_helps() {
        check_size(".npz", LARGEST, 2).unwrap();
        let error = check_size(".npz", 5 * LARGEST - 1, 2).unwrap_err();
        assert!(error.to_string().contains("every 10th frame"), "{error}");
    }
}
