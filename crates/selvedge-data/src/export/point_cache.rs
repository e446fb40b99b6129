//! A point cache (.pc2): the positions of every vertex in every frame, and beside it the mesh of the
//! first frame as .obj of the same name, whose vertices they are. Obstacles are beside it as
//! `x.NAME.obj`, and as `x.NAME.pc2` where they move.

use std::path::Path;

use super::obj;
use super::outcome::{ExportError, Pulse};
use super::take::Take;
use crate::formats::atomic::write_atomically;
use crate::formats::pc2;

/// Writes the cache, then the mesh, then the obstacles.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    write_atomically(path, |out| {
        let points = take.trajectory.vertex_count();
        pc2::write_header(out, take.len(), points, take.every)?;
        for number in 0..take.len() {
            pc2::write_points(out, &take.positions(number))?;
            pulse.beat()?;
        }
        Ok(())
    })?;
    obj::write_frame(take, 0, &path.with_extension("obj"))?;
    obj::write_obstacles(take, path)?;
    for obstacle in take.obstacles() {
        if obstacle.is_still() {
            continue;
        }
        write_atomically(&obstacle.beside(path, "pc2"), |out| {
            pc2::write_header(out, take.len(), obstacle.track.point_count(), take.every)?;
            (0..take.len())
                .try_for_each(|number| pc2::write_points(out, &obstacle.positions(take, number)))
        })?;
    }
    Ok(())
}
