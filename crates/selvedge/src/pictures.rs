//! Contact sheets and clips of one or two runs of a cloth as files, with progress.

use std::io::{self, Write};
use std::path::Path;

use selvedge_data::{Trajectory, write_atomically};
use selvedge_lab::pictures;
pub(crate) use selvedge_lab::pictures::{MODEL, Show, run_of_frames};

use crate::interrupt;
use crate::output::End;
use crate::progress::Progress;

/// Writes a contact sheet (.png) of even moments; beside a truth, the model's run once
/// more in the colours of its error.
pub(crate) fn write_sheet(path: &Path, show: &Show<'_>) -> anyhow::Result<()> {
    let png = pictures::sheet(show)?;
    Ok(write_atomically(path, |out| out.write_all(&png))?)
}

/// Writes a contact sheet (.png) of even moments in the colours of the strain: of each vertex,
/// the largest elongation of its edges against the material.
pub(crate) fn write_strain_sheet(
    path: &Path,
    title: &str,
    trajectory: &Trajectory,
) -> anyhow::Result<()> {
    let png = pictures::strain_sheet(title, trajectory)?;
    Ok(write_atomically(path, |out| out.write_all(&png))?)
}

/// Writes a clip (.gif) in real time. A clip that is interrupted ends early, but is whole.
pub(crate) fn write_clip_of(path: &Path, show: &Show<'_>) -> anyhow::Result<End> {
    let count = pictures::clip_pictures(show.prediction);
    let progress = Progress::new("drawing the clip", count, "pictures");
    let mut end = End::Complete;
    write_atomically(path, |out| {
        let result = pictures::clip(out, show, &mut || {
            progress.advance();
            interrupt::flow()
        });
        if result.map_err(io::Error::other)?.is_break() {
            end = End::Interrupted;
        }
        Ok(())
    })?;
    Ok(end)
}
