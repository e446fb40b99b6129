//! A point cache (.pc2): the positions of every vertex in every frame, and beside it the mesh of
//! the first frame as .obj of the same name, whose vertices they are. Obstacles are beside them as
//! `x.NAME.obj`, and as `x.NAME.pc2` where they move.
//!
//! Little-endian: "POINTCACHE2\0", version 1 (i32), vertices (i32), first frame (f32), frames from
//! one sample to the next (f32), samples (i32), then x, y, z (f32) by sample and vertex. The rate
//! is not in the file. Format: as Blender's Mesh Cache reads it.

use std::io::{self, Write};
use std::path::Path;

use super::obj;
use super::obstacles::TakenObstacle;
use super::outcome::{ExportError, Pulse};
use super::take::Take;
use crate::formats::atomic::write_atomically;

const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
const HEADER_LENGTH: u64 = 32;

/// Size of the cache in bytes.
pub(super) fn planned_bytes(take: &Take<'_>) -> u64 {
    HEADER_LENGTH + 12 * take.len() as u64 * take.trajectory().vertex_count() as u64
}

/// Writes the cache, then the mesh.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    write_atomically(path, |out| {
        write_header(take, take.trajectory().vertex_count(), out)?;
        for number in 0..take.len() {
            for p in take.positions(number) {
                for coordinate in p.to_array() {
                    out.write_all(&coordinate.to_le_bytes())?;
                }
            }
            pulse.beat()?;
        }
        Ok(())
    })?;
    obj::write_frame(take, 0, &path.with_extension("obj"))?;
    obj::write_obstacles(take, path)?;
    for obstacle in take.obstacles() {
        if !obstacle.is_still() {
            write_obstacle(take, &obstacle, path)?;
        }
    }
    Ok(())
}

/// Writes the cache of an obstacle that moves, as `x.NAME.pc2`.
fn write_obstacle(
    take: &Take<'_>,
    obstacle: &TakenObstacle<'_>,
    path: &Path,
) -> Result<(), ExportError> {
    let beside = obstacle.beside(path, "pc2");
    Ok(write_atomically(&beside, |out| {
        write_header(take, obstacle.point_count(), out)?;
        for number in 0..take.len() {
            for coordinate in obstacle
                .positions(take, number)
                .iter()
                .flat_map(|p| p.to_array())
            {
                out.write_all(&coordinate.to_le_bytes())?;
            }
        }
        Ok(())
    })?)
}

fn write_header(take: &Take<'_>, points: usize, out: &mut impl Write) -> io::Result<()> {
    let count = |number: usize| i32::try_from(number).map_err(io::Error::other);
    out.write_all(MAGIC)?;
    out.write_all(&1_i32.to_le_bytes())?;
    out.write_all(&count(points)?.to_le_bytes())?;
    out.write_all(&0_f32.to_le_bytes())?;
    out.write_all(&(take.every() as f32).to_le_bytes())?;
    out.write_all(&count(take.len())?.to_le_bytes())
}
