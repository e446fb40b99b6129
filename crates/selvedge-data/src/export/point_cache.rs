//! Point caches (.pc2, .mdd): the positions of every vertex in every frame, and beside them the
//! mesh of the first frame as .obj of the same name, whose vertices they are. Obstacles are beside
//! them as `x.NAME.obj`, and as `x.NAME.pc2` or `x.NAME.mdd` where they move.
//!
//! A .pc2 is little-endian: "POINTCACHE2\0", version 1 (i32), vertices (i32), first frame (f32),
//! frames from one sample to the next (f32), samples (i32), then x, y, z (f32) by sample and
//! vertex. The rate is not in the file. A .mdd is big-endian: samples (i32), vertices (i32), the
//! time of each sample (f32, s), then x, y, z (f32) by sample and vertex. Formats: as Blender's
//! Mesh Cache and LightWave read them.

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;

use super::obj;
use super::obstacles::TakenObstacle;
use super::options::PointCache;
use super::outcome::{ExportError, Pulse};
use super::take::Take;
use crate::formats::atomic::write_atomically;

const MAGIC: &[u8; 12] = b"POINTCACHE2\0";
const PC2_HEADER: u64 = 32;
const MDD_HEADER: u64 = 8;

/// Size of the cache in bytes.
pub(super) fn planned_bytes(kind: PointCache, take: &Take<'_>) -> u64 {
    let samples = take.len() as u64;
    let header = match kind {
        PointCache::Pc2 => PC2_HEADER,
        PointCache::Mdd => MDD_HEADER + 4 * samples,
    };
    header + 12 * samples * take.trajectory().vertex_count() as u64
}

/// Writes the cache, then the mesh.
pub(super) fn write(
    kind: PointCache,
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    write_atomically(path, |out| {
        kind.write_header(take, take.trajectory().vertex_count(), out)?;
        for number in 0..take.len() {
            kind.write_points(&take.positions(number), out)?;
            pulse.beat()?;
        }
        Ok(())
    })?;
    obj::write_frame(take, 0, &path.with_extension("obj"))?;
    obj::write_obstacles(take, path)?;
    for obstacle in take.obstacles() {
        if !obstacle.is_still() {
            kind.write_obstacle(take, &obstacle, path)?;
        }
    }
    Ok(())
}

impl PointCache {
    /// Writes the cache of an obstacle that moves, as `x.NAME.pc2` or `x.NAME.mdd`.
    fn write_obstacle(
        self,
        take: &Take<'_>,
        obstacle: &TakenObstacle<'_>,
        path: &Path,
    ) -> Result<(), ExportError> {
        let beside = obstacle.beside(path, self.extension());
        Ok(write_atomically(&beside, |out| {
            self.write_header(take, obstacle.point_count(), out)?;
            for number in 0..take.len() {
                self.write_points(&obstacle.positions(take, number), out)?;
            }
            Ok(())
        })?)
    }

    fn write_header(self, take: &Take<'_>, points: usize, out: &mut impl Write) -> io::Result<()> {
        let count = |number: usize| i32::try_from(number).map_err(io::Error::other);
        match self {
            Self::Pc2 => {
                out.write_all(MAGIC)?;
                out.write_all(&1_i32.to_le_bytes())?;
                out.write_all(&count(points)?.to_le_bytes())?;
                out.write_all(&0_f32.to_le_bytes())?;
                out.write_all(&(take.every() as f32).to_le_bytes())?;
                out.write_all(&count(take.len())?.to_le_bytes())
            }
            Self::Mdd => {
                out.write_all(&count(take.len())?.to_be_bytes())?;
                out.write_all(&count(points)?.to_be_bytes())?;
                (0..take.len())
                    .try_for_each(|k| out.write_all(&(take.time(k) as f32).to_be_bytes()))
            }
        }
    }

    fn write_points(self, points: &[Vec3], out: &mut impl Write) -> io::Result<()> {
        for coordinate in points.iter().flat_map(|p| p.to_array()) {
            out.write_all(&match self {
                Self::Pc2 => coordinate.to_le_bytes(),
                Self::Mdd => coordinate.to_be_bytes(),
            })?;
        }
        Ok(())
    }
}
