//! A trajectory in the formats of other programs: .usda, .usdc, .usdz, .abc, .glb, .pc2 with
//! an .obj, .obj by the frame, .npz. One file per format; all of them write a `Take`, frames
//! of the trajectory as they are wanted.
//!
//! Frames are streamed: beside the trajectory, memory holds a frame or two; of .glb and .usdz all of it.
//! Files are written beside their place and renamed, folders as a whole. Positions are those of the
//! trajectory, in metres; the first exported frame is at time 0. Vertices keep their numbers.
//! Texture coordinates are the material coordinates, or those of the mesh's file where these are
//! others; a cloth without a pattern has none. Obstacles stand beside the cloth: in the same file
//! where it has meshes with names (USD, .abc, .glb) or arrays (.npz), else in files of their own.

mod abc;
mod common;
mod glb;
mod npz;
mod obj;
mod options;
mod take;
mod usd;

use std::cell::RefCell;
use std::io;
use std::ops::ControlFlow;
use std::path::Path;

use thiserror::Error;

use self::take::Take;
use crate::formats::file_error::Problem;
use crate::trajectory::Trajectory;

pub use self::common::ExportError;
pub use self::options::{ExportFormat, ExportOptions, FrameSpan};
pub use self::take::files_beside;

/// End of an export that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportEnd {
    /// All frames were written.
    Complete,
    /// `observe` asked to stop: nothing was written.
    Stopped,
}

/// The observer asked to stop.
#[derive(Debug, Error)]
#[error("stopped")]
struct Stop;

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
    let observe = RefCell::new(observe);
    let beat = || match (observe.borrow_mut())() {
        ControlFlow::Continue(()) => Ok(()),
        ControlFlow::Break(()) => Err(io::Error::other(Stop)),
    };
    let take = Take::new(trajectory, options, &beat)?;
    let is_stop = |error: &io::Error| error.get_ref().is_some_and(|inner| inner.is::<Stop>());
    let written = match options.format {
        format @ (ExportFormat::Usda | ExportFormat::Usdc | ExportFormat::Usdz) => {
            usd::write(&take, path, format)
        }
        ExportFormat::Glb => glb::write(&take, path),
        ExportFormat::Pc2 => obj::write_cache(&take, path),
        ExportFormat::Obj => obj::write_one(&take, path),
        ExportFormat::ObjSequence => obj::write_all(&take, path),
        ExportFormat::Abc => abc::write(&take, path),
        ExportFormat::Npz => npz::write(&take, path),
    };
    match written {
        Ok(()) => Ok(ExportEnd::Complete),
        Err(ExportError::Write(error)) if is_stop(&error.source) => Ok(ExportEnd::Stopped),
        Err(error) => Err(error),
    }
}

/// A .glb of all frames of `trajectory`, in memory.
pub fn glb(trajectory: &Trajectory) -> Result<Vec<u8>, ExportError> {
    let take = Take::new(
        trajectory,
        &ExportOptions::usual(ExportFormat::Glb),
        &|| Ok(()),
    )?;
    let made = glb::bytes(&take);
    Ok(made.map_err(|error| Problem(error.to_string()))?)
}

/// About the size of a .glb in bytes, which grows with the square of its frames; none of others.
pub fn planned_bytes(
    trajectory: &Trajectory,
    options: &ExportOptions,
) -> Result<Option<u64>, ExportError> {
    let take = Take::new(trajectory, options, &|| Ok(()))?;
    let is_glb = options.format == ExportFormat::Glb;
    Ok(is_glb.then(|| glb::planned_bytes(&take)))
}
