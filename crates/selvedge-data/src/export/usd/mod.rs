//! A trajectory as a USD stage, as a binary crate (.usdc), or as an archive of one crate
//! (.usdz).
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
//! Format: the USD documentation, `UsdGeomMesh`, `UsdGeomPointBased`, `UsdPreviewSurface` and "Usdz
//! File Format Specification".

mod cloth;
mod crate_file;
mod stage;
mod tables;

use std::io::{self, Cursor, Seek, Write};
use std::path::Path;

use zip::ZipWriter;

use self::cloth::stage_of;
use self::stage::Stage;
use super::common::check_size;
use super::take::{Body, Take};
use crate::formats::atomic::write_atomically;
use crate::formats::file_error::Problem;
use crate::formats::npz::STORED;

/// Multiple of bytes at which the file in an archive begins.
const ALIGNED: u16 = 64;

/// Writes the stage as a crate.
pub(super) fn write(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    let stage = stage_of(take);
    Ok(write_atomically(path, |out| {
        crate_file::write(&stage, out)
    })?)
}

/// Writes the stage as an archive of one crate, which is called as the archive is.
pub(super) fn write_archive(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    check_size(".usdz", package_bytes(take), take.every)?;
    let stage = stage_of(take);
    Ok(write_atomically(path, |out| {
        write_package(&stage, &crate_name(path), out)
    })?)
}

/// Writes an archive (.usdz) of one crate of this name: ZIP without packing, and without the 64-bit
/// extension, which a .usdz must not have.
fn write_package(stage: &Stage<'_>, name: &str, out: &mut (impl Write + Seek)) -> io::Result<()> {
    let mut inside = Cursor::new(Vec::new());
    crate_file::write(stage, &mut inside)?;
    let mut archive = ZipWriter::new(out);
    archive.start_file(name, STORED.with_alignment(ALIGNED))?;
    archive.write_all(inside.get_ref())?;
    archive.finish()?;
    Ok(())
}

/// A name of letters that every ZIP knows, and of a length that its header can hold.
fn crate_name(path: &Path) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let plain = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    stem.chars().map(plain).take(100).collect::<String>() + ".usdc"
}

/// Bytes of an archive, not fewer than it will have.
fn package_bytes(take: &Take<'_>) -> u64 {
    let of_body = |body: &Body<'_>| {
        let is_cloth = body.track.is_none();
        let lists = 1 + u64::from(body.has_velocities()) + u64::from(is_cloth && take.normals);
        let (frames, points) = (body.frame_count() as u64, body.point_count() as u64);
        let faces = body.faces().len() as u64;
        frames * (12 * points * lists + 200) + if is_cloth { 100 * points } else { 20 * faces }
    };
    let bodies: u64 = take.obstacles().iter().map(of_body).sum();
    let handles = take.trajectory.handles().vertices().len() as u64;
    of_body(&take.sheet()) + bodies + 40 * handles * take.len() as u64 + (1 << 20)
}

#[cfg(test)]
mod tests;
