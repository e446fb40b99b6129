//! A trajectory as a USD stage, in each of USD's containers: as text (.usda), as a binary crate
//! (.usdc), and as an archive of one crate (.usdz).
//!
//! The stage has one `Mesh` with `points` at time codes, and an `Xform` per handle that moves as it
//! does. Obstacles are meshes below `/obstacles`. Meshes are bound to a `UsdPreviewSurface`.
//!
//! A time code is a frame of the trajectory, counted from the first exported one; with every nth
//! frame only every nth code has a sample, and readers go linearly from one to the next or, with
//! `velocities` `[m/s]`, along these. Material coordinates [m] are `primvars:st`, of a sewn cloth
//! one per corner of a face; the rest pose is `primvars:rest`, and `primvars:handle` is the number
//! of the handle that a vertex is, or -1.
//!
//! Format: the USD documentation, `UsdGeomMesh`, `UsdGeomPointBased` and `UsdPreviewSurface`.

mod cloth;
mod crate_file;
mod package;
mod stage;
mod tables;
mod text;

use std::path::Path;

use self::cloth::stage_of;
use super::options::ExportFormat;
use super::outcome::{ExportError, Pulse, check_size};
use super::take::Take;
use crate::formats::atomic::write_atomically;

/// Writes the stage: as text, whose numbers are the shortest decimals that are read back exactly, as
/// a crate, or as an archive of one crate, which is called as the archive is.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    format: ExportFormat,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    if format == ExportFormat::Usdz {
        check_size(".usdz", package_bytes(take), take.every)?;
    }
    let stage = stage_of(take);
    Ok(write_atomically(path, |out| match format {
        ExportFormat::Usda => text::write(&stage, out, pulse),
        ExportFormat::Usdz => package::write(&stage, &crate_name(path), out, pulse),
        _ => crate_file::write(&stage, out, pulse),
    })?)
}

/// A name of letters that every ZIP knows, and of a length that its header can hold.
fn crate_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    stem.chars().map(plain).take(100).collect::<String>() + ".usdc"
}

/// Bytes of an archive, not fewer than it will have.
fn package_bytes(take: &Take<'_>) -> u64 {
    let lists = 1 + u64::from(take.velocities) + u64::from(take.normals);
    let vertices = take.trajectory.vertex_count() as u64;
    let cloth = take.len() as u64 * (12 * vertices * lists + 200);
    let handles = take.trajectory.handles().vertices().len() as u64;
    let bodies = take.obstacles();
    let bodies = bodies.iter().map(|body| {
        let points = 12 * body.track.point_count() as u64 * (1 + u64::from(take.velocities));
        body.frame_count(take) as u64 * (points + 200) + 20 * body.track.faces().len() as u64
    });
    cloth + 40 * handles * take.len() as u64 + bodies.sum::<u64>() + 100 * vertices + (1 << 20)
}
