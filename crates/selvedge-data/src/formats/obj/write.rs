//! Writing one frame of a cloth as OBJ: positions, texture coordinates and normals where
//! there are some, faces. Numbers are written so that they are read back exactly.

use std::io::{self, Write};
use std::path::Path;

use glam::{Vec2, Vec3};
use selvedge_cloth::{Cloth, FaceId, Pattern, Topology};

use crate::formats::atomic::{WriteError, write_atomically};

/// Parts of a cloth that are written.
pub(crate) struct ObjFrame<'a> {
    /// Connectivity of the cloth.
    pub(crate) topology: &'a Topology,
    /// `[m]`, `[vertices]`.
    pub(crate) positions: &'a [Vec3],
    /// Texture coordinates, if there are some.
    pub(crate) texture: Option<Pattern<'a, Vec2>>,
    /// Normals of length one, `[vertices]`.
    pub(crate) normals: Option<&'a [Vec3]>,
}

/// Writes `positions` `[m]`, `[vertices]`, and the pattern of `cloth`, all or nothing.
pub fn write_obj(path: &Path, cloth: &Cloth, positions: &[Vec3]) -> Result<(), WriteError> {
    let frame = ObjFrame {
        topology: cloth.topology(),
        positions,
        texture: Some(cloth.pattern()),
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
        for c in self.texture.map_or(&[][..], |texture| texture.points()) {
            writeln!(out, "vt {} {}", c.x, c.y)?;
        }
        for n in self.normals.unwrap_or_default() {
            writeln!(out, "vn {} {} {}", n.x, n.y, n.z)?;
        }
        for number in 0..self.topology.faces().len() as u32 {
            let face = FaceId(number);
            let [a, b, c] = self.topology.faces()[face.index()].map(|v| v.0 + 1);
            let texture = self.texture.map(|texture| texture.corner_points(face));
            match (
                texture.map(|corners| corners.map(|point| point + 1)),
                self.normals,
            ) {
                (None, None) => writeln!(out, "f {a} {b} {c}")?,
                (None, Some(_)) => writeln!(out, "f {a}//{a} {b}//{b} {c}//{c}")?,
                (Some([p, q, r]), None) => writeln!(out, "f {a}/{p} {b}/{q} {c}/{r}")?,
                (Some([p, q, r]), Some(_)) => {
                    writeln!(out, "f {a}/{p}/{a} {b}/{q}/{b} {c}/{r}/{c}")?
                }
            }
        }
        Ok(())
    }
}
