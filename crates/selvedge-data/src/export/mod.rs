//! A trajectory in the formats of other programs: .usdc, .usdz, .abc, .glb, .pc2 with
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

use std::cell::{Cell, RefCell};
use std::io;
use std::ops::ControlFlow;
use std::path::Path;

use self::take::Take;
use crate::formats::file_error::Problem;
use crate::trajectory::Trajectory;

pub use self::options::{ExportFormat, ExportOptions, FrameSpan};
pub use self::take::files_beside;

/// Writes frames of `trajectory` to `path`; after each frame `observe` is told, and may stop. Returns
/// false where it did: nothing is then written.
///
/// # Errors
/// [`Problem`] says what cannot be written, and why; nothing is then written. What stands in the place
/// of a [file beside](files_beside) `path` is never overwritten.
pub fn export(
    trajectory: &Trajectory,
    path: &Path,
    options: &ExportOptions,
    observe: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<bool, Problem> {
    let observe = RefCell::new(observe);
    let is_stopped = Cell::new(false);
    let beat = || {
        is_stopped.set((observe.borrow_mut())().is_break());
        if is_stopped.get() { Err(io::Error::other("stopped")) } else { Ok(()) }
    };
    let take = Take::new(trajectory, options, &beat)?;
    for beside in files_beside(trajectory, options.format, path) {
        check_free(&beside)?;
    }
    let written = match options.format {
        ExportFormat::Usdc => usd::write(&take, path),
        ExportFormat::Usdz => usd::write_archive(&take, path),
        ExportFormat::Glb => glb::write(&take, path),
        ExportFormat::Pc2 => obj::write_cache(&take, path),
        ExportFormat::Obj => obj::write_one(&take, path),
        ExportFormat::ObjSequence => obj::write_all(&take, path),
        ExportFormat::Abc => abc::write(&take, path),
        ExportFormat::Npz => npz::write(&take, path),
    };
    match written {
        Err(_) if is_stopped.get() => Ok(false),
        written => written.map(|()| true),
    }
}

/// Checks that nothing is at `path`, which is written beside a file that was named.
///
/// # Errors
/// [`Problem`] names the file that would be overwritten.
pub fn check_free(path: &Path) -> Result<(), Problem> {
    if path.exists() {
        Err(Problem(format!(
            "{}: there is such a file already, and one of this name is written beside the one that was named: move it away, or choose another name",
            path.display()
        )))
    } else {
        Ok(())
    }
}

/// A .glb of all frames of `trajectory`, in memory.
pub fn glb(trajectory: &Trajectory) -> Result<Vec<u8>, Problem> {
    let take = Take::new(
        trajectory,
        &ExportOptions::usual(ExportFormat::Glb),
        &|| Ok(()),
    )?;
    glb::bytes(&take).map_err(|error| Problem(error.to_string()))
}

/// About the size of a .glb in bytes, which grows with the square of its frames; none of others.
pub fn planned_bytes(
    trajectory: &Trajectory,
    options: &ExportOptions,
) -> Result<Option<u64>, Problem> {
    let take = Take::new(trajectory, options, &|| Ok(()))?;
    let is_glb = options.format == ExportFormat::Glb;
    Ok(is_glb.then(|| glb::planned_bytes(&take)))
}
