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
#[derive(Clone, Debug, Default)]
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
    pub goals: Vec<(u32, DVec3)>,
    /// Positions `[m]`, `[tracks][vertices]`.
    pub tracks: Vec<&'a [Vec3]>,
    /// Points of all bodies `[m]`.
    pub bodies: Vec<Vec3>,
    /// Smallest gaps of the vertices `[m]`, `[tracks][vertices]`, or nothing.
    pub gaps: Vec<Vec<f32>>,
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

/// The greeting of the page that is `client`.
pub fn hello(client: u32, catalogue: &Catalogue) -> Vec<u8> {
    let program = concat!("selvedge ", env!("CARGO_PKG_VERSION"));
    json(
        kind::HELLO,
        &Hello {
            client,
            program,
            catalogue,
        },
    )
}

/// The cloth of a generation, and the bodies beside it.
pub fn cloth(generation: u32, cloth: &Cloth, bodies: &[Body]) -> Vec<u8> {
    let faces = cloth.topology().face_indices();
    let pattern = cloth.pattern();
    let points = pattern.points();
    let size = 20 + 24 * faces.len() + 8 * points.len();
    let mut bytes = header(kind::CLOTH, size);
    put(&mut bytes, [generation]);
    let counts = [cloth.vertex_count(), faces.len(), points.len()];
    put(&mut bytes, counts.map(|count| count as u32));
    put(&mut bytes, faces.into_iter().flatten());
    put(&mut bytes, pattern.corners().into_iter().flatten());
    put(&mut bytes, points.iter().flat_map(|p| bits(p.to_array())));
    put(&mut bytes, [bodies.len() as u32]);
    for body in bodies {
        let counts = [body.kind as usize, body.points, body.faces.len()];
        put(&mut bytes, counts.map(|count| count as u32));
        put(&mut bytes, body.faces.iter().copied().flatten());
    }
    bytes
}

/// A file for the page to save.
pub fn file(name: &str, contents: &[u8]) -> Vec<u8> {
    let mut bytes = header(kind::FILE, 8 + name.len() + contents.len());
    put(&mut bytes, [name.len() as u32]);
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
    let time = (parts.time as f32).to_bits();
    put(&mut bytes, [parts.generation, parts.number, time]);
    put(&mut bytes, parts.drag);
    let (goals, tracks, bodies) = (parts.goals.len(), parts.tracks.len(), parts.bodies.len());
    let counts = [goals, tracks, vertices, bodies, gaps];
    put(&mut bytes, counts.map(|count| count as u32));
    for (vertex, goal) in &parts.goals {
        put(&mut bytes, [*vertex]);
        put(&mut bytes, bits(goal.as_vec3().to_array()));
    }
    let cloths = parts.tracks.iter().copied().flatten();
    for point in cloths.chain(&parts.bodies) {
        put(&mut bytes, bits(point.to_array()));
    }
    let gaps = parts.gaps.iter().flatten().map(|gap| gap.to_bits());
    put(&mut bytes, gaps);
    bytes
}

fn header(kind: u8, size: usize) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(size);
    bytes.extend_from_slice(&[VERSION, kind, 0, 0]);
    bytes
}

fn put(bytes: &mut Vec<u8>, words: impl IntoIterator<Item = u32>) {
    for word in words {
        bytes.extend_from_slice(&word.to_le_bytes());
    }
}

fn bits<const N: usize>(numbers: [f32; N]) -> [u32; N] {
    numbers.map(f32::to_bits)
}
