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
const HEADERS: usize = 12 + 8 + 8;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
/// Targets of the views of the binary part.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// The front of our pictures, in linear light, and obstacles.
const COLOUR: [f32; 4] = [0.08, 0.13, 0.4, 1.0];
const GREY: [f32; 4] = [0.3, 0.3, 0.3, 1.0];

/// About the size of the file in bytes: what grows with its frames.
pub(super) fn planned_bytes(take: &Take<'_>) -> u64 {
    let (frames, vertices) = (take.len() as u64, take.trajectory.vertex_count() as u64);
    let vectors = if take.normals { 2 } else { 1 };
    4 * frames * frames + 12 * frames * vertices * vectors
}

/// Writes the file.
pub(super) fn write(
    take: &Take<'_>,
    path: &Path,
    pulse: &mut Pulse<'_>,
) -> Result<(), ExportError> {
    check_size(".glb", planned_bytes(take), take.every)?;
    let written = write_atomically(path, |out| out.write_all(&bytes(take, pulse)?));
    Ok(written?)
}

/// The file in memory.
pub(super) fn bytes(take: &Take<'_>, pulse: &mut Pulse<'_>) -> io::Result<Vec<u8>> {
    let (json, binary) = contents(take, pulse)?;
    let length = HEADERS + json.len() + binary.data.len();
    // What does not grow with the frames may still be too much.
    let length = u32::try_from(length).map_err(io::Error::other)?;
    let mut out = Vec::with_capacity(length as usize);
    put_numbers(&mut out, &[MAGIC, VERSION, length]);
    put_numbers(&mut out, &[json.len() as u32, JSON_CHUNK]);
    out.extend(json);
    put_numbers(&mut out, &[binary.data.len() as u32, BINARY_CHUNK]);
    out.extend(binary.data);
    Ok(out)
}

/// The binary part: views one after another, and the accessors to them.
#[derive(Default)]
struct Binary {
    views: Vec<Value>,
    accessors: Vec<Value>,
    data: Vec<u8>,
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

impl Binary {
    /// Adds a view of what `write` puts at the end of the data.
    fn view(&mut self, kind: Kind, write: impl FnOnce(&mut Vec<u8>)) -> View {
        let start = self.data.len();
        write(&mut self.data);
        self.view_from(start, kind)
    }

    /// A view of the data from `start` on.
    fn view_from(&mut self, start: usize, kind: Kind) -> View {
        let length = self.data.len() - start;
        if length == 0 {
            return View { number: None, kind };
        }
        let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length });
        match kind {
            Kind::Corners => view["target"] = json!(INDICES),
            Kind::PerVertex(width) => {
                view["byteStride"] = json!(4 * width);
                view["target"] = json!(VERTICES);
            }
            Kind::PerKey(_) => {}
        }
        self.views.push(view);
        let number = Some(self.views.len() - 1);
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
fn contents(take: &Take<'_>, pulse: &mut Pulse<'_>) -> io::Result<(Vec<u8>, Binary)> {
    let mut binary = Binary::default();
    let frames = take.len();
    let (mesh, mut animation) = cloth(take, &mut binary, pulse)?;
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
        "buffers": [{ "byteLength": binary.data.len() }],
    });
    if frames > 1 {
        document["animations"] = json!([animation.into_json()]);
    }
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    Ok((text, binary))
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
fn cloth(
    take: &Take<'_>,
    binary: &mut Binary,
    pulse: &mut Pulse<'_>,
) -> io::Result<(Value, Animation)> {
    let cloth = take.trajectory.cloth();
    let (texture, frames) = (cloth.texture_points(), take.len());
    // The vertex of each point.
    let of_points = match texture {
        Some(texture) => texture.vertices(),
        None => (0..cloth.vertex_count() as u32).collect(),
    };
    let is_split = texture.is_some_and(|texture| texture.is_sewn());
    let (vertices, corners) = (of_points.len(), 3 * cloth.face_area().len());
    let handles = cloth.handles().vertices().len();
    let position = |number| take.positions(number);
    // glTF has one texture coordinate per vertex, so that it has their points for vertices.
    let split = |values: &[Vec3]| -> Vec<Vec3> {
        let vertices = of_points.iter();
        vertices.map(|v| values[*v as usize]).collect()
    };
    let indices = binary.view(Kind::Corners, |out| {
        let corners = texture.map(|texture| texture.corners());
        let corners = corners.unwrap_or_else(|| cloth.topology().face_indices());
        put_numbers(out, corners.as_flattened());
    });
    let start = binary.data.len();
    for target in targets(frames, position) {
        put_points(&mut binary.data, &split(&target));
        pulse.beat()?;
    }
    let positions = binary.view_from(start, Kind::PerVertex(3));
    let normals = take.normals.then(|| {
        binary.view(Kind::PerVertex(3), |out| {
            let normals = |number| take.normals_at(&take.positions(number));
            targets(frames, normals).for_each(|target| put_points(out, &split(&target)));
        })
    });
    let coordinates = binary.view(Kind::PerVertex(2), |out| {
        let coordinates = texture.map_or(&[][..], |texture| texture.points()).iter();
        put_floats(out, coordinates.flat_map(|c| [c.x, 1.0 - c.y]));
    });
    let of_handles = binary.view(Kind::PerVertex(1), |out| {
        let numbers = take.handle_numbers();
        put_floats(out, of_points.iter().map(|v| numbers[*v as usize] as f32));
    });
    let of_vertices = binary.view(Kind::PerVertex(1), |out| {
        let split = of_points.iter().filter(|_| is_split);
        put_floats(out, split.map(|v| *v as f32));
    });
    let times = binary.view(Kind::PerKey(1), |out| {
        put_floats(out, (0..frames).map(|number| take.time(number) as f32));
    });
    // For each key a weight for each target: those of frame 1, frame 2 and so on.
    let weights = binary.view(Kind::PerKey(1), |out| {
        let row = |key: usize| (1..frames).map(move |target| f32::from(u8::from(target == key)));
        put_floats(out, (0..frames).flat_map(row));
    });
    let paths = binary.view(Kind::PerKey(3), |out| {
        for handle in 0..handles {
            let path = (0..frames).map(|number| take.handle_positions(number)[handle]);
            put_points(out, &path.collect::<Vec<_>>());
        }
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
    Ok((mesh, animation))
}

/// The node of an obstacle, of this number, and its mesh. A rigid one is moved by its node, another
/// that moves by morph targets, which go with the weights of the cloth.
fn body(
    take: &Take<'_>,
    obstacle: &TakenObstacle<'_>,
    number: usize,
    binary: &mut Binary,
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
    let at = |number: usize| match rigid {
        Some(points) => points.to_vec(),
        None => take.turned(&track.frame(take.frame(number))),
    };
    let poses = || (0..keys).filter_map(|number| track.pose(take.frame(number)));
    let indices = binary.view(Kind::Corners, |out| {
        put_numbers(out, track.faces().as_flattened());
    });
    let points = binary.view(Kind::PerVertex(3), |out| {
        targets(frames, at).for_each(|target| put_points(out, &target));
    });
    let turns = binary.view(Kind::PerKey(4), |out| {
        put_floats(out, poses().flat_map(|(turn, _)| turn.to_array()));
    });
    let places = binary.view(Kind::PerKey(3), |out| {
        put_floats(out, poses().flat_map(|(_, place)| place.to_array()));
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

fn put_points(out: &mut Vec<u8>, points: &[Vec3]) {
    put_floats(out, points.iter().flat_map(|p| p.to_array()));
}

fn put_floats(out: &mut Vec<u8>, values: impl IntoIterator<Item = f32>) {
    out.extend(values.into_iter().flat_map(f32::to_le_bytes));
}

fn put_numbers(out: &mut Vec<u8>, numbers: &[u32]) {
    out.extend(numbers.iter().flat_map(|number| number.to_le_bytes()));
}
