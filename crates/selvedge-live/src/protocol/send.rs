//! Messages to a page.

use glam::{DVec3, Vec3};
use selvedge_cloth::Cloth;
use serde::Serialize;

use super::{VERSION, kind};
use crate::body::Body;
use crate::order::Catalogue;

/// The first message that a page gets.
#[derive(Clone, Debug, Serialize)]
pub struct Hello<'a> {
    /// The number of the page, as frames name it.
    pub client: u32,
    /// Program and version.
    pub program: &'a str,
    /// The names that an order may use.
    pub catalogue: &'a Catalogue,
}

/// The parts of a frame.
#[derive(Clone, Copy, Debug)]
pub struct FrameParts<'a> {
    /// The generation of its cloth.
    pub generation: u32,
    /// The number of the frame, from 1.
    pub number: u32,
    /// Time since the start `[s]`.
    pub time: f64,
    /// The last drag that this frame follows: the page, and its number.
    pub drag: [u32; 2],
    /// The vertices of the handles, and their goals `[m]`.
    pub goals: &'a [(u32, DVec3)],
    /// Positions `[m]`, `[tracks][vertices]`.
    pub tracks: &'a [&'a [Vec3]],
    /// Points of all bodies `[m]`.
    pub bodies: &'a [Vec3],
    /// Smallest gaps of the vertices `[m]`, `[tracks][vertices]`, or nothing.
    pub gaps: &'a [Vec<f32>],
}

/// A message of `kind` with `value` as JSON.
pub fn json<T: Serialize>(kind: u8, value: &T) -> Vec<u8> {
    let mut bytes = header(kind, 1024);
    // Our own structures have no maps with keys that are not strings: this writes always.
    if serde_json::to_writer(&mut bytes, value).is_err() {
        bytes.truncate(4);
        bytes.extend_from_slice(b"null");
    }
    bytes
}

/// The cloth of a generation, and the bodies beside it.
pub fn cloth(generation: u32, cloth: &Cloth, bodies: &[Body]) -> Vec<u8> {
    let faces = cloth.topology().face_indices();
    let pattern = cloth.pattern();
    let coordinates = pattern.points();
    let size = 20 + 24 * faces.len() + 8 * coordinates.len();
    let mut bytes = header(kind::CLOTH, size);
    let counts = [cloth.vertex_count(), faces.len(), coordinates.len()];
    for word in std::iter::once(generation).chain(counts.map(|count| count as u32)) {
        bytes.extend_from_slice(&word.to_le_bytes());
    }
    for word in [faces, pattern.corners()].concat().as_flattened() {
        bytes.extend_from_slice(&word.to_le_bytes());
    }
    for point in coordinates {
        bytes.extend_from_slice(&point.x.to_le_bytes());
        bytes.extend_from_slice(&point.y.to_le_bytes());
    }
    bytes.extend_from_slice(&(bodies.len() as u32).to_le_bytes());
    for body in bodies {
        let counts = [body.kind as usize, body.points, body.faces.len()];
        let numbers = counts.into_iter().map(|count| count as u32);
        for word in numbers.chain(body.faces.as_flattened().iter().copied()) {
            bytes.extend_from_slice(&word.to_le_bytes());
        }
    }
    bytes
}

/// A file for the page to save.
pub fn file(name: &str, contents: &[u8]) -> Vec<u8> {
    let mut bytes = header(kind::FILE, 8 + name.len() + contents.len());
    bytes.extend_from_slice(&(name.len() as u32).to_le_bytes());
    bytes.extend_from_slice(name.as_bytes());
    bytes.extend_from_slice(contents);
    bytes
}

/// A frame.
pub fn frame(parts: &FrameParts<'_>) -> Vec<u8> {
    let vertices = parts.tracks.first().map_or(0, |track| track.len());
    let gaps: usize = parts.gaps.iter().map(Vec::len).sum();
    let points = vertices * parts.tracks.len() + parts.bodies.len();
    let size = 44 + 16 * parts.goals.len() + 12 * points + 4 * gaps;
    let mut bytes = header(kind::FRAME, size);
    let [client, drag] = parts.drag;
    for word in [
        parts.generation,
        parts.number,
        (parts.time as f32).to_bits(),
        client,
        drag,
        parts.goals.len() as u32,
        parts.tracks.len() as u32,
        vertices as u32,
        parts.bodies.len() as u32,
        gaps as u32,
    ] {
        bytes.extend_from_slice(&word.to_le_bytes());
    }
    for (vertex, goal) in parts.goals {
        bytes.extend_from_slice(&vertex.to_le_bytes());
        push(&mut bytes, goal.as_vec3());
    }
    let cloths = parts.tracks.iter().flat_map(|track| track.iter());
    for position in cloths.chain(parts.bodies) {
        push(&mut bytes, *position);
    }
    for gap in parts.gaps.iter().flatten() {
        bytes.extend_from_slice(&gap.to_le_bytes());
    }
    bytes
}

fn header(kind: u8, size: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(size);
    bytes.extend_from_slice(&[VERSION, kind, 0, 0]);
    bytes
}

fn push(bytes: &mut Vec<u8>, position: Vec3) {
    for part in position.to_array() {
        bytes.extend_from_slice(&part.to_le_bytes());
    }
}
