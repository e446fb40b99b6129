//! Writing one frame of a cloth as OBJ: positions, material coordinates as texture coordinates,
//! faces. Numbers are written so that they are read back exactly.

use std::io::Write;
use std::path::Path;

use glam::{Vec2, Vec3};
use selvedge_cloth::Topology;

use crate::atomic::{WriteError, write_atomically};

/// Writes `positions` `[m]`, `[vertices]`, and `material_coordinates` `[m]`, `[vertices]`, of a cloth
/// with this topology, all or nothing.
///
/// # Errors
/// [`WriteError`].
pub fn write_obj(
    path: &Path,
    topology: &Topology,
    positions: &[Vec3],
    material_coordinates: &[Vec2],
) -> Result<(), WriteError> {
    write_atomically(path, |writer| {
        for p in positions {
            writeln!(writer, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for c in material_coordinates {
            writeln!(writer, "vt {} {}", c.x, c.y)?;
        }
        for face in topology.faces() {
            let [a, b, c] = face.map(|v| v.0 + 1);
            writeln!(writer, "f {a}/{a} {b}/{b} {c}/{c}")?;
        }
        Ok(())
    })
}
