//! glTF 2.0 in one binary file (.glb): the first frame as the mesh, a morph target per further
//! frame, and an animation that gives exactly one of them the weight 1 at the time of its frame.
//! Between two frames weights go linearly, and so do the vertices. A node per handle moves as it
//! does. An obstacle is a node with a mesh: rigid ones are turned and moved by the node, others go
//! by morph targets with the weights of the cloth.
//!
//! A target holds differences from the first frame, in single precision: vertices come back to
//! within one rounding of their size, 1.2e-7 of it. Every key has a weight for every target, as the
//! format wants it: 4 bytes times the square of the frames. Texture coordinates are (u, 1 - v) of
//! the material's, for glTF counts v downwards. Vertices of the file are the points of the pattern:
//! where the cloth is sewn, a vertex is there once per panel, with `_VERTEX` as the way back.
//! `_HANDLE` is the number of the handle that a vertex is, or -1.
//!
//! Format: Khronos Group, glTF 2.0 specification, sections 3.7 (meshes), 3.11 (animations), 4
//! (GLB).

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;

use super::glb_json::{self, Layout};
use super::obstacles::TakenObstacle;
use super::outcome::{ExportError, Pulse, check_size};
use super::take::Take;
use super::take::extent;
use crate::formats::atomic::write_atomically;

const MAGIC: u32 = 0x4654_6c67;
const VERSION: u32 = 2;
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BINARY_CHUNK: u32 = 0x004e_4942;
/// Bytes of the file's header and of those of its two chunks.
const HEADERS: u64 = 12 + 8 + 8;

/// Size of the file in bytes.
pub(super) fn planned_bytes(take: &Take<'_>) -> u64 {
    let layout = Layout::new(take);
    HEADERS + json(take, &layout).len() as u64 + layout.bytes()
}

/// Writes the file.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    let layout = Layout::new(take);
    let json = json(take, &layout);
    let bytes = HEADERS + json.len() as u64 + layout.bytes();
    check_size(".glb", bytes, take.every())?;
    Ok(write_atomically(path, |out| {
        let numbers = |out: &mut dyn Write, numbers: &[u32]| {
            numbers
                .iter()
                .try_for_each(|number| out.write_all(&number.to_le_bytes()))
        };
        numbers(out, &[MAGIC, VERSION, bytes as u32])?;
        numbers(out, &[json.len() as u32, JSON_CHUNK])?;
        out.write_all(&json)?;
        numbers(out, &[layout.bytes() as u32, BINARY_CHUNK])?;
        write_binary(take, out, pulse)
    })?)
}

/// The text of the file, padded to a multiple of four bytes.
fn json(take: &Take<'_>, layout: &Layout) -> Vec<u8> {
    let extents = targets(take).map(|target| extent(&target));
    let mut text = glb_json::document(take, layout, extents).into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    text
}

/// The first frame, then what each further one differs from it by.
fn targets<'a>(take: &'a Take<'_>) -> impl Iterator<Item = Vec<Vec3>> + 'a {
    let first = take.positions(0);
    (0..take.len()).map(move |number| difference(take.positions(number), &first, number))
}

/// Difference of the frame taken as `number` from the `first`; the first stays as it is.
fn difference(mut values: Vec<Vec3>, first: &[Vec3], number: usize) -> Vec<Vec3> {
    if number > 0 {
        values.iter_mut().zip(first).for_each(|(v, f)| *v -= *f);
    }
    values
}

/// Everything in the order of [`Layout`].
fn write_binary(take: &Take<'_>, out: &mut impl Write, pulse: &mut Pulse<'_>) -> io::Result<()> {
    let cloth = take.trajectory().cloth();
    let pattern = cloth.pattern();
    let vertices = pattern.vertices();
    for corner in pattern.corners().as_flattened() {
        out.write_all(&corner.to_le_bytes())?;
    }
    for target in targets(take) {
        write_points(out, &split(&vertices, &target))?;
        pulse.beat()?;
    }
    if take.has_normals() {
        let first = take.normals_at(&take.positions(0));
        for number in 0..take.len() {
            let normals = take.normals_at(&take.positions(number));
            let normals = difference(normals, &first, number);
            write_points(out, &split(&vertices, &normals))?;
        }
    }
    for c in cloth.material_coordinates() {
        write_floats(out, &[c.x, 1.0 - c.y])?;
    }
    for number in split(&vertices, &take.handle_numbers()) {
        write_floats(out, &[number as f32])?;
    }
    if pattern.is_sewn() {
        for &vertex in &vertices {
            write_floats(out, &[vertex as f32])?;
        }
    }
    for number in 0..take.len() {
        write_floats(out, &[take.time(number) as f32])?;
    }
    write_weights(take.len(), out)?;
    for handle in 0..cloth.handles().vertices().len() {
        for number in 0..take.len() {
            write_floats(out, &take.handle_positions(number)[handle].to_array())?;
        }
    }
    for obstacle in take.obstacles() {
        write_obstacle(take, &obstacle, out)?;
    }
    Ok(())
}

/// Faces and points of an obstacle; of a rigid one then its turns and places, of another that moves
/// what its points differ from the first frame by.
fn write_obstacle(
    take: &Take<'_>,
    obstacle: &TakenObstacle<'_>,
    out: &mut impl Write,
) -> io::Result<()> {
    for corner in obstacle.faces().as_flattened() {
        out.write_all(&corner.to_le_bytes())?;
    }
    let Some(points) = obstacle.rigid_points() else {
        let first = obstacle.positions(take, 0);
        for number in 0..obstacle.frame_count(take) {
            let points = obstacle.positions(take, number);
            write_points(out, &difference(points, &first, number))?;
        }
        return Ok(());
    };
    write_points(out, points)?;
    let poses = || (0..take.len()).filter_map(|number| obstacle.pose(take, number));
    for (turn, _) in poses() {
        write_floats(out, &turn.to_array())?;
    }
    for (_, place) in poses() {
        write_floats(out, &place.to_array())?;
    }
    Ok(())
}

/// For each of `keys` times a weight for each target: those of frame 1, frame 2 and so on.
fn write_weights(keys: usize, out: &mut impl Write) -> io::Result<()> {
    let mut weights = vec![0.0_f32; keys - 1];
    for key in 0..keys {
        weights.fill(0.0);
        if let Some(own) = key.checked_sub(1) {
            weights[own] = 1.0;
        }
        write_floats(out, &weights)?;
    }
    Ok(())
}

/// The value of each point's vertex: glTF has one texture coordinate per vertex, so that it has
/// the points of the pattern for vertices.
fn split<T: Copy>(vertices: &[u32], values: &[T]) -> Vec<T> {
    vertices.iter().map(|&v| values[v as usize]).collect()
}

fn write_points(out: &mut impl Write, points: &[Vec3]) -> io::Result<()> {
    points
        .iter()
        .try_for_each(|p| write_floats(out, &p.to_array()))
}

fn write_floats(out: &mut impl Write, values: &[f32]) -> io::Result<()> {
    values
        .iter()
        .try_for_each(|value| out.write_all(&value.to_le_bytes()))
}
