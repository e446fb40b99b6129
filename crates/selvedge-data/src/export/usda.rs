//! USD as text (.usda, version 1.0): one `Mesh` with `points` at time codes, and an `Xform` per
//! handle that moves as it does. Obstacles are meshes below `/obstacles`.
//!
//! A time code is a frame of the trajectory, counted from the first exported one; with every nth
//! frame only every nth code has a sample, and readers go linearly from one to the next. Numbers
//! are the shortest decimals that are read back exactly. Material coordinates [m] are
//! `primvars:st`, of a sewn cloth one per corner of a face; the rest pose is `primvars:rest`, and
//! `primvars:handle` is the number of the handle that a vertex is, or -1. No material is written.
//!
//! Format: the USD documentation, "Usd ASCII" and `UsdGeomMesh`.

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;

use super::outcome::{ExportError, Pulse};
use super::take::Take;
use super::take::extent;
use crate::UpAxis;
use crate::formats::atomic::write_atomically;

/// The colour of the cloth in viewers that show no materials: the front of our pictures.
const COLOUR: &str = "(0.08, 0.13, 0.4)";

/// The colour of obstacles.
const GREY: &str = "(0.3, 0.3, 0.3)";

/// Writes the stage.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    Ok(write_atomically(path, |out| {
        write_header(take, out)?;
        writeln!(
            out,
            "def Xform \"cloth\" (\n    kind = \"component\"\n)\n{{"
        )?;
        writeln!(out, "    def Mesh \"sheet\"\n    {{")?;
        write_unchanging(take, out)?;
        write_points(take, out, pulse)?;
        if take.has_normals() {
            write_normals(take, out)?;
        }
        writeln!(out, "    }}")?;
        for handle in 0..take.trajectory().handles().vertices().len() {
            write_handle(take, out, handle)?;
        }
        writeln!(out, "}}")?;
        write_obstacles(take, out)
    })?)
}

fn write_header(take: &Take<'_>, out: &mut impl Write) -> io::Result<()> {
    let rate = take.trajectory().frame_rate();
    let up = match take.up() {
        UpAxis::Y => "Y",
        UpAxis::Z => "Z",
    };
    let made_by = quoted(&take.trajectory().provenance().made_by);
    let end = take.frames_since_first(take.len() - 1);
    writeln!(out, "#usda 1.0\n(")?;
    writeln!(out, "    defaultPrim = \"cloth\"")?;
    writeln!(out, "    doc = {made_by}")?;
    writeln!(out, "    endTimeCode = {end}")?;
    writeln!(out, "    framesPerSecond = {rate}")?;
    writeln!(out, "    metersPerUnit = 1")?;
    writeln!(out, "    startTimeCode = 0")?;
    writeln!(out, "    timeCodesPerSecond = {rate}")?;
    writeln!(out, "    upAxis = \"{up}\"\n)\n")
}

/// A string of USD: what cannot stand in one is escaped.
fn quoted(text: &str) -> String {
    let mut quoted = String::from("\"");
    for character in text.chars() {
        match character {
            '"' | '\\' => quoted.extend(['\\', character]),
            c if c.is_control() => quoted.push(' '),
            c => quoted.push(c),
        }
    }
    quoted.push('"');
    quoted
}

fn write_unchanging(take: &Take<'_>, out: &mut impl Write) -> io::Result<()> {
    let cloth = take.trajectory().cloth();
    let faces = cloth.topology().face_indices();
    writeln!(out, "        uniform bool doubleSided = 1")?;
    writeln!(out, "        uniform token orientation = \"rightHanded\"")?;
    writeln!(out, "        uniform token subdivisionScheme = \"none\"")?;
    write!(out, "        int[] faceVertexCounts = ")?;
    write_list(out, faces.iter(), |out, _| write!(out, "3"))?;
    writeln!(out)?;
    write!(out, "        int[] faceVertexIndices = ")?;
    write_list(out, faces.as_flattened().iter(), |out, corner| {
        write!(out, "{corner}")
    })?;
    writeln!(out)?;
    write!(out, "        texCoord2f[] primvars:st = ")?;
    let pattern = cloth.pattern();
    if pattern.is_sewn() {
        let corners = pattern.faces().flatten();
        write_list(out, corners, |out, c| write!(out, "({}, {})", c.x, c.y))?;
        interpolated(out, "faceVarying")?;
    } else {
        let points = pattern.points().iter();
        write_list(out, points, |out, c| write!(out, "({}, {})", c.x, c.y))?;
        per_vertex(out)?;
    }
    write!(out, "        point3f[] primvars:rest = ")?;
    write_list(out, take.rest_positions().iter(), write_point)?;
    per_vertex(out)?;
    write!(out, "        int[] primvars:handle = ")?;
    write_list(out, take.handle_numbers().iter(), |out, number| {
        write!(out, "{number}")
    })?;
    per_vertex(out)?;
    writeln!(
        out,
        "        color3f[] primvars:displayColor = [{COLOUR}] (\n            interpolation = \"constant\"\n        )"
    )
}

fn write_points(take: &Take<'_>, out: &mut impl Write, pulse: &mut Pulse<'_>) -> io::Result<()> {
    writeln!(out, "        point3f[] points.timeSamples = {{")?;
    for number in 0..take.len() {
        write!(out, "            {}: ", take.frames_since_first(number))?;
        write_points_of(out, &take.positions(number))?;
        pulse.beat()?;
    }
    writeln!(out, "        }}")?;
    writeln!(out, "        float3[] extent.timeSamples = {{")?;
    for number in 0..take.len() {
        write!(out, "            {}: ", take.frames_since_first(number))?;
        write_points_of(out, &extent(&take.positions(number)))?;
    }
    writeln!(out, "        }}")
}

fn write_normals(take: &Take<'_>, out: &mut impl Write) -> io::Result<()> {
    writeln!(
        out,
        "        normal3f[] normals (\n            interpolation = \"vertex\"\n        )"
    )?;
    writeln!(out, "        normal3f[] normals.timeSamples = {{")?;
    for number in 0..take.len() {
        write!(out, "            {}: ", take.frames_since_first(number))?;
        write_points_of(out, &take.normals_at(&take.positions(number)))?;
    }
    writeln!(out, "        }}")
}

fn write_handle(take: &Take<'_>, out: &mut impl Write, handle: usize) -> io::Result<()> {
    writeln!(out, "\n    def Xform \"handle_{handle}\"\n    {{")?;
    writeln!(out, "        double3 xformOp:translate.timeSamples = {{")?;
    for number in 0..take.len() {
        let code = take.frames_since_first(number);
        write!(out, "            {code}: ")?;
        write_point(out, &take.handle_positions(number)[handle])?;
        writeln!(out, ",")?;
    }
    writeln!(out, "        }}")?;
    writeln!(
        out,
        "        uniform token[] xformOpOrder = [\"xformOp:translate\"]\n    }}"
    )
}

fn write_obstacles(take: &Take<'_>, out: &mut impl Write) -> io::Result<()> {
    let obstacles = take.obstacles();
    if obstacles.is_empty() {
        return Ok(());
    }
    writeln!(out, "\ndef Xform \"obstacles\"\n{{")?;
    for obstacle in obstacles {
        writeln!(out, "    def Mesh \"{}\"\n    {{", obstacle.name)?;
        writeln!(out, "        uniform bool doubleSided = 1")?;
        writeln!(out, "        uniform token subdivisionScheme = \"none\"")?;
        let faces = obstacle.faces();
        write!(out, "        int[] faceVertexCounts = ")?;
        write_list(out, faces.iter(), |out, _| write!(out, "3"))?;
        write!(out, "\n        int[] faceVertexIndices = ")?;
        write_list(out, faces.as_flattened().iter(), |out, c| {
            write!(out, "{c}")
        })?;
        writeln!(
            out,
            "\n        color3f[] primvars:displayColor = [{GREY}] (\n            interpolation = \"constant\"\n        )"
        )?;
        if obstacle.is_still() {
            write!(out, "        point3f[] points = ")?;
            write_list(out, obstacle.positions(take, 0).iter(), write_point)?;
            writeln!(out)?;
        } else {
            writeln!(out, "        point3f[] points.timeSamples = {{")?;
            for number in 0..take.len() {
                write!(out, "            {}: ", take.frames_since_first(number))?;
                write_points_of(out, &obstacle.positions(take, number))?;
            }
            writeln!(out, "        }}")?;
        }
        writeln!(out, "    }}")?;
    }
    writeln!(out, "}}")
}

fn write_points_of(out: &mut impl Write, points: &[Vec3]) -> io::Result<()> {
    write!(out, "[")?;
    for (k, point) in points.iter().enumerate() {
        write!(out, "{}", separator(k))?;
        write_point(out, point)?;
    }
    writeln!(out, "],")
}

fn write_point<W: Write>(out: &mut W, p: &Vec3) -> io::Result<()> {
    write!(out, "({}, {}, {})", p.x, p.y, p.z)
}

/// `[a, b]`.
fn write_list<W: Write, T>(
    out: &mut W,
    items: impl Iterator<Item = T>,
    write_item: impl Fn(&mut W, T) -> io::Result<()>,
) -> io::Result<()> {
    write!(out, "[")?;
    for (k, item) in items.enumerate() {
        write!(out, "{}", separator(k))?;
        write_item(out, item)?;
    }
    write!(out, "]")
}

/// The end of a value that there is one of for each vertex.
fn per_vertex(out: &mut impl Write) -> io::Result<()> {
    interpolated(out, "vertex")
}

fn interpolated(out: &mut impl Write, how: &str) -> io::Result<()> {
    writeln!(out, " (\n            interpolation = \"{how}\"\n        )")
}

fn separator(k: usize) -> &'static str {
    if k == 0 { "" } else { ", " }
}
