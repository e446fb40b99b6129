//! glTF 2.0 in one binary file (.glb): the first frame as the mesh, a morph target per further
//! frame, and an animation that gives exactly one of them the weight 1 at the time of its frame.
//! Between two frames weights go linearly, and so do the vertices. A node per handle moves as it
//! does. An obstacle is a node with a mesh: rigid ones are turned and moved by the node, others go
//! by morph targets with the weights of the cloth.
//!
//! A target holds differences from the first frame, in single precision: vertices come back to
//! within one rounding of their size, 1.2e-7 of it. Every key has a weight for every target, as the
//! format wants it: 4 bytes times the square of the frames. Texture coordinates are (u, 1 - v) of
//! the cloth's, for glTF counts v downwards. Vertices of the file are their points: a vertex with
//! several, as at a seam, is there once for each, with `_VERTEX` as the way back.
//! `_HANDLE` is the number of the handle that a vertex is, or -1.
//!
//! Format: Khronos Group, glTF 2.0 specification, sections 3.7 (meshes), 3.11 (animations), 4
//! (GLB).

use std::io::{self, Write};
use std::path::Path;

use glam::Vec3;
use serde_json::{Value, json};

use super::obstacles::TakenObstacle;
use super::outcome::{ExportError, Pulse, check_size};
use super::take::{Take, extent};
use crate::formats::atomic::write_atomically;

const MAGIC: u32 = 0x4654_6c67;
const VERSION: u32 = 2;
const JSON_CHUNK: u32 = 0x4e4f_534a;
const BINARY_CHUNK: u32 = 0x004e_4942;
/// Bytes of the file's header and of those of its two chunks.
const HEADERS: u64 = 12 + 8 + 8;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
/// Targets of the views of the binary part.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// The front of our pictures, in linear light, and obstacles.
const COLOUR: [f32; 4] = [0.08, 0.13, 0.4, 1.0];
const GREY: [f32; 4] = [0.3, 0.3, 0.3, 1.0];

/// Size of the file in bytes.
pub(super) fn planned_bytes(take: &Take<'_>) -> u64 {
    let (json, binary) = contents(take);
    HEADERS + json.len() as u64 + binary.bytes
}

/// Writes the file.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    let whole = Whole::of(take)?;
    Ok(write_atomically(path, |out| whole.write(out, pulse))?)
}

/// The file in memory.
pub(super) fn bytes(take: &Take<'_>, pulse: &mut Pulse<'_>) -> Result<Vec<u8>, ExportError> {
    let whole = Whole::of(take)?;
    let mut out = Vec::with_capacity(whole.bytes as usize);
    let written = whole.write(&mut out, pulse);
    written.map_err(ExportError::refused)?;
    Ok(out)
}

/// The two chunks of a file, and its length.
struct Whole<'a> {
    json: Vec<u8>,
    binary: Binary<'a>,
    bytes: u64,
}

impl<'a> Whole<'a> {
    fn of(take: &'a Take<'_>) -> Result<Self, ExportError> {
        let (json, binary) = contents(take);
        let bytes = HEADERS + json.len() as u64 + binary.bytes;
        check_size(".glb", bytes, take.every)?;
        Ok(Self {
            json,
            binary,
            bytes,
        })
    }

    fn write(&self, out: &mut dyn Write, pulse: &mut Pulse<'_>) -> io::Result<()> {
        write_numbers(out, &[MAGIC, VERSION, self.bytes as u32])?;
        write_numbers(out, &[self.json.len() as u32, JSON_CHUNK])?;
        out.write_all(&self.json)?;
        write_numbers(out, &[self.binary.bytes as u32, BINARY_CHUNK])?;
        let mut parts = self.binary.parts.iter();
        parts.try_for_each(|part| part(out, pulse))
    }
}

/// Writes a part of the binary part.
type Part<'a> = Box<dyn Fn(&mut dyn Write, &mut Pulse<'_>) -> io::Result<()> + 'a>;

/// The binary part: views one after another, and the accessors to them.
#[derive(Default)]
struct Binary<'a> {
    views: Vec<Value>,
    accessors: Vec<Value>,
    parts: Vec<Part<'a>>,
    bytes: u64,
}

/// Elements of a view: corners of faces, something per vertex, or something per key.
#[derive(Clone, Copy)]
enum Kind {
    Corners,
    PerVertex(usize),
    PerKey(usize),
}

/// A view, and its elements.
#[derive(Clone, Copy)]
struct View {
    /// None where it has no elements.
    number: Option<usize>,
    kind: Kind,
}

impl Kind {
    /// Numbers of an element.
    fn width(self) -> usize {
        match self {
            Self::Corners => 1,
            Self::PerVertex(width) | Self::PerKey(width) => width,
        }
    }
}

impl<'a> Binary<'a> {
    /// Adds a view of `count` elements, which `write` writes.
    fn view(
        &mut self,
        kind: Kind,
        count: usize,
        write: impl Fn(&mut dyn Write, &mut Pulse<'_>) -> io::Result<()> + 'a,
    ) -> View {
        let mut number = None;
        let length = 4 * (kind.width() * count) as u64;
        if length > 0 {
            let mut view = json!({ "buffer": 0, "byteOffset": self.bytes, "byteLength": length });
            match kind {
                Kind::Corners => view["target"] = json!(INDICES),
                Kind::PerVertex(width) => {
                    view["byteStride"] = json!(4 * width);
                    view["target"] = json!(VERTICES);
                }
                Kind::PerKey(_) => {}
            }
            number = Some(self.views.len());
            self.views.push(view);
            self.parts.push(Box::new(write));
            self.bytes += length;
        }
        View { number, kind }
    }

    /// Adds an accessor to `count` elements of a view after the first `skipped`; its number.
    fn accessor(&mut self, view: View, skipped: usize, count: usize) -> usize {
        let component = match view.kind {
            Kind::Corners => UNSIGNED_INT,
            Kind::PerVertex(_) | Kind::PerKey(_) => FLOAT,
        };
        let form = ["SCALAR", "VEC2", "VEC3", "VEC4"][view.kind.width() - 1];
        self.accessors.push(json!({
            "bufferView": view.number,
            "byteOffset": 4 * view.kind.width() * skipped,
            "componentType": component,
            "count": count,
            "type": form,
        }));
        self.accessors.len() - 1
    }

    /// Says the bounds of an accessor.
    fn bound(&mut self, accessor: usize, low: &[f32], high: &[f32]) {
        self.accessors[accessor]["min"] = json!(low);
        self.accessors[accessor]["max"] = json!(high);
    }

    /// An accessor to the `frame`th `count` points of a view, with their extent as its bounds.
    fn points(&mut self, view: View, frame: usize, count: usize, [low, high]: [Vec3; 2]) -> usize {
        let accessor = self.accessor(view, count * frame, count);
        self.bound(accessor, &low.to_array(), &high.to_array());
        accessor
    }
}

/// The text of the file, padded to a multiple of four bytes, and its binary part.
fn contents<'a>(take: &'a Take<'_>) -> (Vec<u8>, Binary<'a>) {
    let mut binary = Binary::default();
    let frames = take.len();
    let (mesh, mut animation) = cloth(take, &mut binary);
    let mut nodes = vec![json!({ "name": "sheet", "mesh": 0 })];
    let handles = take.handle_positions(0).into_iter().enumerate();
    nodes.extend(handles.map(|(number, position)| {
        json!({ "name": format!("handle_{number}"), "translation": position.to_array() })
    }));
    let mut meshes = vec![mesh];
    let mut materials = vec![material("cloth", COLOUR)];
    for obstacle in take.obstacles() {
        let (mut node, mesh) = body(take, &obstacle, nodes.len(), &mut binary, &mut animation);
        node["mesh"] = json!(meshes.len());
        nodes.push(node);
        meshes.push(mesh);
    }
    if meshes.len() > 1 {
        materials.push(material("obstacle", GREY));
    }
    let mut document = json!({
        "asset": { "version": "2.0", "generator": take.trajectory.provenance().made_by },
        "scene": 0,
        "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": binary.accessors,
        "bufferViews": binary.views,
        "buffers": [{ "byteLength": binary.bytes }],
    });
    if frames > 1 {
        document["animations"] = json!([animation.into_json()]);
    }
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    (text, binary)
}

/// The animation: samplers and the channels that they move, all at the same times.
#[derive(Default)]
struct Animation {
    times: usize,
    samplers: Vec<Value>,
    channels: Vec<Value>,
}

impl Animation {
    /// Moves what `path` names of a node by the values of an accessor.
    fn moves(&mut self, node: usize, path: &str, output: usize) {
        self.samplers
            .push(json!({ "input": self.times, "output": output, "interpolation": "LINEAR" }));
        self.goes_with(self.samplers.len() - 1, node, path);
    }

    fn goes_with(&mut self, sampler: usize, node: usize, path: &str) {
        self.channels
            .push(json!({ "sampler": sampler, "target": { "node": node, "path": path } }));
    }

    fn into_json(self) -> Value {
        json!({ "name": "cloth", "samplers": self.samplers, "channels": self.channels })
    }
}

/// The mesh of the cloth, and the animation of its morph targets and of its handles.
fn cloth<'a>(take: &'a Take<'_>, binary: &mut Binary<'a>) -> (Value, Animation) {
    let cloth = take.trajectory.cloth();
    let (texture, frames) = (cloth.texture_points(), take.len());
    let texture_points = texture.map_or(&[][..], |texture| texture.points());
    // The vertex of each point.
    let of_points = move || match texture {
        Some(texture) => texture.vertices(),
        None => (0..cloth.vertex_count() as u32).collect(),
    };
    let is_split = texture.is_some_and(|texture| texture.is_sewn());
    let (vertices, corners) = (of_points().len(), 3 * cloth.face_area().len());
    let handles = cloth.handles().vertices().len();
    let position = move |number| take.positions(number);
    // glTF has one texture coordinate per vertex, so that it has their points for vertices.
    let split = move |values: &[Vec3]| -> Vec<Vec3> {
        let vertices = of_points().into_iter();
        vertices.map(|v| values[v as usize]).collect()
    };
    let indices = binary.view(Kind::Corners, corners, move |out, _| {
        let corners = texture.map(|texture| texture.corners());
        let corners = corners.unwrap_or_else(|| cloth.topology().face_indices());
        write_numbers(out, corners.as_flattened())
    });
    let positions = binary.view(Kind::PerVertex(3), vertices * frames, move |out, pulse| {
        targets(frames, position).try_for_each(|target| {
            write_points(out, &split(&target))?;
            pulse.beat()
        })
    });
    let normals = take.normals.then(|| {
        binary.view(Kind::PerVertex(3), vertices * frames, move |out, _| {
            let normals = |number| take.normals_at(&take.positions(number));
            targets(frames, normals).try_for_each(|target| write_points(out, &split(&target)))
        })
    });
    let coordinates = binary.view(Kind::PerVertex(2), texture_points.len(), move |out, _| {
        let coordinates = texture_points.iter();
        write_floats(out, coordinates.flat_map(|c| [c.x, 1.0 - c.y]))
    });
    let of_handles = binary.view(Kind::PerVertex(1), vertices, move |out, _| {
        let numbers = take.handle_numbers();
        let of_points = of_points().into_iter();
        write_floats(out, of_points.map(|v| numbers[v as usize] as f32))
    });
    let count = if is_split { vertices } else { 0 };
    let of_vertices = binary.view(Kind::PerVertex(1), count, move |out, _| {
        write_floats(out, of_points().into_iter().map(|v| v as f32))
    });
    let times = binary.view(Kind::PerKey(1), frames, move |out, _| {
        write_floats(out, (0..frames).map(|number| take.time(number) as f32))
    });
    // For each key a weight for each target: those of frame 1, frame 2 and so on.
    let weights = binary.view(Kind::PerKey(1), frames * (frames - 1), move |out, _| {
        let row = |key: usize| (1..frames).map(move |target| f32::from(u8::from(target == key)));
        write_floats(out, (0..frames).flat_map(row))
    });
    let paths = binary.view(Kind::PerKey(3), frames * handles, move |out, _| {
        (0..handles).try_for_each(|handle| {
            let path = (0..frames).map(|number| take.handle_positions(number)[handle]);
            write_points(out, &path.collect::<Vec<_>>())
        })
    });
    let indices = binary.accessor(indices, 0, corners);
    let numbered = targets(frames, position).enumerate();
    let shapes = numbered.map(|(number, target)| {
        let position = binary.points(positions, number, vertices, extent(&target));
        let mut shape = json!({ "POSITION": position });
        if let Some(normals) = normals {
            shape["NORMAL"] = json!(binary.accessor(normals, vertices * number, vertices));
        }
        shape
    });
    let mut shapes: Vec<Value> = shapes.collect();
    let attributes = &mut shapes[0];
    if texture.is_some() {
        attributes["TEXCOORD_0"] = json!(binary.accessor(coordinates, 0, vertices));
    }
    attributes["_HANDLE"] = json!(binary.accessor(of_handles, 0, vertices));
    if is_split {
        attributes["_VERTEX"] = json!(binary.accessor(of_vertices, 0, vertices));
    }
    let mut mesh = mesh("sheet", shapes, indices, 0);
    let mut animation = Animation::default();
    if frames > 1 {
        let names: Vec<String> = (1..frames).map(|k| format!("frame {k}")).collect();
        mesh["extras"] = json!({ "targetNames": names });
        animation.times = binary.accessor(times, 0, frames);
        binary.bound(animation.times, &[0.0], &[take.time(frames - 1) as f32]);
        animation.moves(
            0,
            "weights",
            binary.accessor(weights, 0, frames * (frames - 1)),
        );
        for handle in 0..handles {
            let path = binary.accessor(paths, frames * handle, frames);
            animation.moves(1 + handle, "translation", path);
        }
    }
    (mesh, animation)
}

/// The node of an obstacle, of this number, and its mesh. A rigid one is moved by its node, another
/// that moves by morph targets, which go with the weights of the cloth.
fn body<'a>(
    take: &'a Take<'_>,
    obstacle: &TakenObstacle<'a>,
    number: usize,
    binary: &mut Binary<'a>,
    animation: &mut Animation,
) -> (Value, Value) {
    let track = obstacle.track;
    let (corners, count) = (3 * track.faces().len(), track.point_count());
    let (keys, rigid) = (take.len(), track.rigid_points());
    let frames = if rigid.is_some() {
        1
    } else {
        obstacle.frame_count(take)
    };
    let at = move |number: usize| match rigid {
        Some(points) => points.to_vec(),
        None => take.turned(&track.frame(take.frame(number))),
    };
    let poses = move || (0..keys).filter_map(|number| track.pose(take.frame(number)));
    let indices = binary.view(Kind::Corners, corners, move |out, _| {
        write_numbers(out, track.faces().as_flattened())
    });
    let points = binary.view(Kind::PerVertex(3), count * frames, move |out, _| {
        targets(frames, at).try_for_each(|target| write_points(out, &target))
    });
    let turns = binary.view(Kind::PerKey(4), poses().count(), move |out, _| {
        write_floats(out, poses().flat_map(|(turn, _)| turn.to_array()))
    });
    let places = binary.view(Kind::PerKey(3), poses().count(), move |out, _| {
        write_floats(out, poses().flat_map(|(_, place)| place.to_array()))
    });
    let indices = binary.accessor(indices, 0, corners);
    let shapes = targets(frames, at).enumerate().map(|(number, target)| {
        json!({ "POSITION": binary.points(points, number, count, extent(&target)) })
    });
    let shapes = shapes.collect();
    let mut node = json!({ "name": obstacle.name });
    if let Some((turn, place)) = poses().next() {
        node["rotation"] = json!(turn.to_array());
        node["translation"] = json!(place.to_array());
    }
    if keys > 1 && rigid.is_some() {
        animation.moves(number, "rotation", binary.accessor(turns, 0, keys));
        animation.moves(number, "translation", binary.accessor(places, 0, keys));
    } else if keys > 1 && !track.is_still() {
        animation.goes_with(0, number, "weights");
    }
    (node, mesh(&obstacle.name, shapes, indices, 1))
}

/// A mesh of one primitive: the first shape are its attributes, the others its morph targets.
fn mesh(name: &str, mut shapes: Vec<Value>, indices: usize, material: usize) -> Value {
    let attributes = shapes.remove(0);
    let mut primitive =
        json!({ "attributes": attributes, "indices": indices, "material": material });
    let mut mesh = json!({ "name": name });
    if !shapes.is_empty() {
        mesh["weights"] = json!(vec![0; shapes.len()]);
        primitive["targets"] = json!(shapes);
    }
    mesh["primitives"] = json!([primitive]);
    mesh
}

/// A matte material that is seen from both sides.
fn material(name: &str, colour: [f32; 4]) -> Value {
    json!({
        "name": name,
        "doubleSided": true,
        "pbrMetallicRoughness": {
            "baseColorFactor": colour, "metallicFactor": 0, "roughnessFactor": 0.9,
        },
    })
}

/// The first of `frames` frames, then what each further one differs from it by.
fn targets(frames: usize, at: impl Fn(usize) -> Vec<Vec3>) -> impl Iterator<Item = Vec<Vec3>> {
    let first = at(0);
    (0..frames).map(move |number| {
        let mut values = at(number);
        if number > 0 {
            values.iter_mut().zip(&first).for_each(|(v, f)| *v -= *f);
        }
        values
    })
}

fn write_points(out: &mut dyn Write, points: &[Vec3]) -> io::Result<()> {
    write_floats(out, points.iter().flat_map(|p| p.to_array()))
}

fn write_floats(out: &mut dyn Write, values: impl IntoIterator<Item = f32>) -> io::Result<()> {
    let mut values = values.into_iter();
    values.try_for_each(|value| out.write_all(&value.to_le_bytes()))
}

fn write_numbers(out: &mut dyn Write, numbers: &[u32]) -> io::Result<()> {
    let mut numbers = numbers.iter();
    numbers.try_for_each(|number| out.write_all(&number.to_le_bytes()))
}
