//! Trajectories as files of other programs.

use std::path::Path;

use pyo3::prelude::*;
use selvedge_data::export::{ExportOptions, FrameSpan, export};
use selvedge_data::{Trajectory, UpAxis};

use crate::errors::{raised, wrong};
use crate::long::beside_reporting;

/// Options of an export to `path`, whose name says the format.
///
/// # Errors
/// A name that says no format, or a span that is none.
pub(crate) fn options(
    path: &Path,
    frames: Option<&str>,
    every: usize,
    up: UpAxis,
) -> PyResult<ExportOptions> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    let Some(usual) = ending.and_then(ExportOptions::of_ending) else {
        return Err(wrong(format!(
            "{}: the name must end in .usdc, .usdz, .abc, .glb, .pc2, .npz or .obj",
            path.display()
        )));
    };
    let mut span = match frames {
        Some(text) => text.parse().map_err(raised)?,
        None => FrameSpan::default(),
    };
    span.every = every;
    Ok(ExportOptions {
        frames: span,
        up,
        ..usual
    })
}

/// Writes `trajectory`; Ctrl-C leaves nothing.
pub(crate) fn export_to(
    py: Python<'_>,
    trajectory: &Trajectory,
    path: &Path,
    options: &ExportOptions,
    progress: Option<Py<PyAny>>,
) -> PyResult<()> {
    let frames = options.frames.of(trajectory.frame_count());
    let frames = frames.map_err(raised)?;
    let written = beside_reporting(py, progress, |_, reporter| {
        reporter.begin("writing", Some(frames.len() as u64));
        export(trajectory, path, options, &mut || reporter.advance())
    })?;
    written.map(drop).map_err(raised)
}
