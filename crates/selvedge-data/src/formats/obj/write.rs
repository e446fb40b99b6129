//! Writing one frame of a cloth as OBJ: positions, material coordinates as texture coordinates,
//! normals where there are some, faces. Numbers are written so that they are read back exactly.

use std::io::{self, Write};
use std::path::Path;

use glam::{Vec2, Vec3};
use selvedge_cloth::Topology;

use crate::formats::atomic::{WriteError, write_atomically};

/// Parts of a cloth that are written.
pub(crate) struct ObjFrame<'a> {
    /// Connectivity of the cloth.
    pub(crate) topology: &'a Topology,
    /// `[m]`, `[vertices]`.
    pub(crate) positions: &'a [Vec3],
    /// `[m]`, `[vertices]`.
    pub(crate) material_coordinates: &'a [Vec2],
    /// Normals of length one, `[vertices]`.
    pub(crate) normals: Option<&'a [Vec3]>,
}

/// Writes `positions` `[m]`, `[vertices]`, and `material_coordinates` `[m]`, `[vertices]`, of a
/// cloth with this topology, all or nothing.
///
/// # Errors
/// [`WriteError`].
pub fn write_obj(
    path: &Path,
    topology: &Topology,
    positions: &[Vec3],
    material_coordinates: &[Vec2],
) -> Result<(), WriteError> {
    let frame = ObjFrame {
        topology,
        positions,
        material_coordinates,
        normals: None,
    };
    write_obj_frame(path, &frame)
}

/// Writes a frame, all or nothing.
pub(crate) fn write_obj_frame(path: &Path, frame: &ObjFrame<'_>) -> Result<(), WriteError> {
    write_atomically(path, |out| frame.write(out))
}

impl ObjFrame<'_> {
    /// Writes the text of the file.
    pub(crate) fn write(&self, out: &mut impl Write) -> io::Result<()> {
        for p in self.positions {
            writeln!(out, "v {} {} {}", p.x, p.y, p.z)?;
        }
        for c in self.material_coordinates {
            writeln!(out, "vt {} {}", c.x, c.y)?;
        }
        for n in self.normals.unwrap_or_default() {
            writeln!(out, "vn {} {} {}", n.x, n.y, n.z)?;
        }
        for face in self.topology.faces() {
            let [a, b, c] = face.map(|v| v.0 + 1);
            match self.normals {
                None => writeln!(out, "f {a}/{a} {b}/{b} {c}/{c}")?,
                Some(_) => writeln!(out, "f {a}/{a}/{a} {b}/{b}/{b} {c}/{c}/{c}")?,
            }
        }
        Ok(())
    }
}
