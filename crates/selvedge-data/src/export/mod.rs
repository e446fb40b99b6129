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
mod glb;
mod npz;
mod obj;
mod obstacles;
mod options;
mod outcome;
mod point_cache;
mod take;
mod usd;

use std::ops::ControlFlow;
use std::path::Path;

pub use self::obstacles::files_beside;
pub use self::options::{ExportFormat, ExportOptions, FrameSpan};
pub use self::outcome::ExportError;
use self::outcome::{Pulse, is_stop};
use self::take::Take;
use crate::trajectory::Trajectory;

/// End of an export that did not fail.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ExportEnd {
    /// All frames were written.
    Complete,
    /// `observe` asked to stop: nothing was written.
    Stopped,
}

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
        format @ (ExportFormat::Usda | ExportFormat::Usdc | ExportFormat::Usdz) => {
            usd::write(&take, path, format, &mut pulse)
        }
        ExportFormat::Glb => glb::write(&take, path, &mut pulse),
        ExportFormat::Pc2 => point_cache::write(&take, path, &mut pulse),
        ExportFormat::Obj => obj::write_one(&take, path, &mut pulse),
        ExportFormat::ObjSequence => obj::write_all(&take, path, &mut pulse),
        ExportFormat::Abc => abc::write(&take, path, &mut pulse),
        ExportFormat::Npz => npz::write(&take, path, &mut pulse),
    };
    match written {
        Ok(()) => Ok(ExportEnd::Complete),
        Err(ExportError::Write(error)) if is_stop(&error.source) => Ok(ExportEnd::Stopped),
        Err(error) => Err(error),
    }
}

/// A .glb of all frames of `trajectory`, in memory.
pub fn glb(trajectory: &Trajectory) -> Result<Vec<u8>, ExportError> {
    let take = Take::new(trajectory, &ExportOptions::usual(ExportFormat::Glb))?;
    let made = glb::bytes(&take, &mut Pulse(&mut || ControlFlow::Continue(())));
    made.map_err(ExportError::refused)
}

/// About the size of a .glb in bytes, which grows with the square of its frames; none of others.
pub fn planned_bytes(
    trajectory: &Trajectory,
    options: &ExportOptions,
) -> Result<Option<u64>, ExportError> {
    let take = Take::new(trajectory, options)?;
    let is_glb = options.format == ExportFormat::Glb;
    Ok(is_glb.then(|| glb::planned_bytes(&take)))
}

#[cfg(test)]
mod tests {
    use super::outcome::{LARGEST, check_size};

    #[test]
    fn what_is_too_large_is_told_with_the_thinning_that_helps() {
        check_size(".npz", LARGEST, 2).unwrap();
        let error = check_size(".npz", 5 * LARGEST - 1, 2).unwrap_err();
        assert!(error.to_string().contains("every 10th frame"), "{error}");
    }
}
