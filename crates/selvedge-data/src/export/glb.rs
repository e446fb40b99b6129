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

use super::common::{check_size, le_floats, le_points, le_words};
use super::take::{Body, Take, extent};
use crate::formats::atomic::write_atomically;
use crate::formats::file_error::Problem;

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
pub(super) fn write(take: &Take<'_>, path: &Path) -> Result<(), Problem> {
    check_size(".glb", planned_bytes(take), take.every)?;
    let written = write_atomically(path, |out| out.write_all(&bytes(take)?));
    Ok(written?)
}

/// The file in memory.
pub(super) fn bytes(take: &Take<'_>) -> io::Result<Vec<u8>> {
    let (json, binary) = contents(take)?;
    let length = HEADERS + json.len() + binary.len();
    // What does not grow with the frames may still be too much.
    let length = u32::try_from(length).map_err(io::Error::other)?;
    let mut out = Vec::with_capacity(length as usize);
    out.extend(le_words(&[MAGIC, VERSION, length]));
    out.extend(le_words(&[json.len() as u32, JSON_CHUNK]));
    out.extend(json);
    out.extend(le_words(&[binary.len() as u32, BINARY_CHUNK]));
    out.extend(binary);
    Ok(out)
}

/// The text of the file, padded to a multiple of four bytes, and its binary part.
fn contents(take: &Take<'_>) -> io::Result<(Vec<u8>, Vec<u8>)> {
    let mut scene = Scene::default();
    if take.len() > 1 {
        let times: Vec<f32> = (0..take.len()).map(|k| take.time(k) as f32).collect();
        scene.times = scene.floats(1, None, times.iter().copied());
        scene.bound(scene.times, &[0.0], &times[take.len() - 1..]);
    }
    cloth(take, &mut scene)?;
    for body in take.obstacles() {
        obstacle(take, &body, &mut scene);
    }
    let mut materials = vec![material("cloth", COLOUR)];
    if scene.meshes.len() > 1 {
        materials.push(material("obstacle", GREY));
    }
    let mut document = json!({
        "asset": { "version": "2.0", "generator": take.trajectory.provenance().made_by },
        "scene": 0,
        "scenes": [{ "nodes": (0..scene.nodes.len()).collect::<Vec<_>>() }],
        "nodes": scene.nodes,
        "meshes": scene.meshes,
        "materials": materials,
        "accessors": scene.accessors,
        "bufferViews": scene.views,
        "buffers": [{ "byteLength": scene.binary.len() }],
    });
    if take.len() > 1 {
        let (samplers, channels) = (scene.samplers, scene.channels);
        document["animations"] =
            json!([{ "name": "cloth", "samplers": samplers, "channels": channels }]);
    }
    let mut text = document.to_string().into_bytes();
    text.resize(text.len().next_multiple_of(4), b' ');
    Ok((text, scene.binary))
}

/// The parts of a file under way: the binary part with a view and an accessor for each array, nodes
/// with their meshes, and the samplers and channels of the animation.
#[derive(Default)]
struct Scene {
    binary: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    nodes: Vec<Value>,
    meshes: Vec<Value>,
    samplers: Vec<Value>,
    channels: Vec<Value>,
    /// Accessor of the times of all keys.
    times: usize,
}

impl Scene {
    /// Adds an array of elements of `width` numbers of four bytes; returns its accessor.
    fn array(&mut self, width: usize, kind: u32, target: Option<u32>, bytes: &[u8]) -> usize {
        let form = ["SCALAR", "VEC2", "VEC3", "VEC4"][width - 1];
        let mut accessor = json!({
            "componentType": kind,
            "count": bytes.len() / 4 / width,
            "type": form,
        });
        // There are no empty views.
        if !bytes.is_empty() {
            accessor["bufferView"] = json!(self.views.len());
            let (start, length) = (self.binary.len(), bytes.len());
            let mut view = json!({ "buffer": 0, "byteOffset": start, "byteLength": length });
            if let Some(target) = target {
                view["target"] = json!(target);
            }
            self.views.push(view);
            self.binary.extend(bytes);
        }
        self.accessors.push(accessor);
        self.accessors.len() - 1
    }

    fn floats(
        &mut self,
        width: usize,
        target: Option<u32>,
        values: impl Iterator<Item = f32>,
    ) -> usize {
        self.array(width, FLOAT, target, &le_floats(values))
    }

    /// Adds vectors of vertices.
    fn vectors(&mut self, vectors: &[Vec3]) -> usize {
        self.array(3, FLOAT, Some(VERTICES), &le_points(vectors))
    }

    /// Adds positions of vertices, with their extent as the bounds of the accessor.
    fn points(&mut self, points: &[Vec3]) -> usize {
        let accessor = self.vectors(points);
        let [low, high] = extent(points).map(|corner| corner.to_array());
        self.bound(accessor, &low, &high);
        accessor
    }

    fn indices(&mut self, faces: &[[u32; 3]]) -> usize {
        let bytes = le_words(faces.as_flattened());
        self.array(1, UNSIGNED_INT, Some(INDICES), &bytes)
    }

    /// Says the bounds of an accessor.
    fn bound(&mut self, accessor: usize, low: &[f32], high: &[f32]) {
        self.accessors[accessor]["min"] = json!(low);
        self.accessors[accessor]["max"] = json!(high);
    }

    /// Adds a mesh of one primitive, which the last node has: the first shape are its attributes,
    /// the others its morph targets.
    fn mesh(&mut self, name: &str, mut shapes: Vec<Value>, indices: usize, material: usize) {
        let attributes = shapes.remove(0);
        let mut primitive =
            json!({ "attributes": attributes, "indices": indices, "material": material });
        let mut mesh = json!({ "name": name });
        if !shapes.is_empty() {
            mesh["weights"] = json!(vec![0; shapes.len()]);
            primitive["targets"] = json!(shapes);
        }
        mesh["primitives"] = json!([primitive]);
        if let Some(node) = self.nodes.last_mut() {
            node["mesh"] = json!(self.meshes.len());
        }
        self.meshes.push(mesh);
    }

    /// Moves what `path` names of a node by the values of an accessor.
    fn moves(&mut self, node: usize, path: &str, output: usize) {
        let times = self.times;
        self.samplers
            .push(json!({ "input": times, "output": output, "interpolation": "LINEAR" }));
        self.goes_with(self.samplers.len() - 1, node, path);
    }

    fn goes_with(&mut self, sampler: usize, node: usize, path: &str) {
        self.channels
            .push(json!({ "sampler": sampler, "target": { "node": node, "path": path } }));
    }
}

/// Adds the cloth with a morph target by the frame, and the handles.
fn cloth(take: &Take<'_>, scene: &mut Scene) -> io::Result<()> {
    let (cloth, sheet, frames) = (take.trajectory.cloth(), take.sheet(), take.len());
    let texture = cloth.texture_points();
    // The vertex of each point: glTF has one texture coordinate per vertex.
    let of_points = match texture {
        Some(texture) => texture.vertices(),
        None => (0..cloth.vertex_count() as u32).collect(),
    };
    let split = |values: &[Vec3]| -> Vec<Vec3> {
        let vertices = of_points.iter();
        vertices.map(|v| values[*v as usize]).collect()
    };
    let corners = texture.map(|texture| texture.corners());
    let indices = scene.indices(&corners.unwrap_or_else(|| sheet.faces()));
    let mut shapes = Vec::with_capacity(frames);
    let first = sheet.positions(0);
    let upright = take.normals.then(|| take.normals_at(&first));
    for number in 0..frames {
        let positions = sheet.positions(number);
        let moved = split(&change(number, &positions, &first));
        let mut shape = json!({ "POSITION": scene.points(&moved) });
        if let Some(upright) = &upright {
            let normals = change(number, &take.normals_at(&positions), upright);
            shape["NORMAL"] = json!(scene.vectors(&split(&normals)));
        }
        shapes.push(shape);
        (take.beat)()?;
    }
    let per_vertex = Some(VERTICES);
    if let Some(texture) = texture {
        let coordinates = texture.points().iter().flat_map(|c| [c.x, 1.0 - c.y]);
        shapes[0]["TEXCOORD_0"] = json!(scene.floats(2, per_vertex, coordinates));
    }
    let numbers = take.handle_numbers();
    let numbers = of_points.iter().map(|v| numbers[*v as usize] as f32);
    shapes[0]["_HANDLE"] = json!(scene.floats(1, per_vertex, numbers));
    if texture.is_some_and(|texture| texture.is_sewn()) {
        let vertices = of_points.iter().map(|v| *v as f32);
        shapes[0]["_VERTEX"] = json!(scene.floats(1, per_vertex, vertices));
    }
    scene.nodes.push(json!({ "name": "sheet" }));
    scene.mesh("sheet", shapes, indices, 0);
    if frames > 1 {
        let names: Vec<String> = (1..frames).map(|k| format!("frame {k}")).collect();
        scene.meshes[0]["extras"] = json!({ "targetNames": names });
        // For each key a weight for each target: those of frame 1, frame 2 and so on.
        let row = |key: usize| (1..frames).map(move |target| f32::from(u8::from(target == key)));
        let weights = scene.floats(1, None, (0..frames).flat_map(row));
        scene.moves(0, "weights", weights);
    }
    for (handle, position) in take.handle_positions(0).into_iter().enumerate() {
        let node = scene.nodes.len();
        let name = format!("handle_{handle}");
        scene
            .nodes
            .push(json!({ "name": name, "translation": position.to_array() }));
        if frames > 1 {
            let path = (0..frames).map(|number| take.handle_positions(number)[handle]);
            let path = scene.floats(3, None, path.flat_map(|place| place.to_array()));
            scene.moves(node, "translation", path);
        }
    }
    Ok(())
}

/// Adds an obstacle. A rigid one is moved by its node, another that moves by morph targets, which go
/// with the weights of the cloth.
fn obstacle(take: &Take<'_>, body: &Body<'_>, scene: &mut Scene) {
    let (number, keys) = (scene.nodes.len(), take.len());
    let rigid = body.track.and_then(|track| track.rigid());
    let pose = |number: usize| {
        let pose = rigid?.1[take.frame(number)];
        Some((pose.rotation.normalize(), pose.translation))
    };
    let indices = scene.indices(&body.faces());
    let at = |number| match rigid {
        Some((points, _)) => points.to_vec(),
        None => body.positions(number),
    };
    let first = at(0);
    let upright = take.normals.then(|| body.normals_at(&first));
    let upright = upright.filter(|normals| body.is_round(&first, normals));
    let shape = |number| {
        let positions = at(number);
        let place = change(number, &positions, &first);
        let mut shape = json!({ "POSITION": scene.points(&place) });
        if let Some(upright) = &upright {
            let normals = change(number, &body.normals_at(&positions), upright);
            shape["NORMAL"] = json!(scene.vectors(&normals));
        }
        shape
    };
    let count = rigid.map_or_else(|| body.frame_count(), |_| 1);
    let shapes = (0..count).map(shape).collect();
    let mut node = json!({ "name": body.name });
    if let Some((turn, place)) = pose(0) {
        node["rotation"] = json!(turn.to_array());
        node["translation"] = json!(place.to_array());
    }
    scene.nodes.push(node);
    scene.mesh(&body.name, shapes, indices, 1);
    if keys > 1 && rigid.is_some() {
        let poses = || (0..keys).filter_map(pose);
        let turns = scene.floats(4, None, poses().flat_map(|(turn, _)| turn.to_array()));
        scene.moves(number, "rotation", turns);
        let places = scene.floats(3, None, poses().flat_map(|(_, place)| place.to_array()));
        scene.moves(number, "translation", places);
    } else if keys > 1 && !body.is_still() {
        scene.goes_with(0, number, "weights");
    }
}

/// The values of frame 0, or what those of a further frame differ from the `first` by.
fn change(number: usize, values: &[Vec3], first: &[Vec3]) -> Vec<Vec3> {
    match number {
        0 => values.to_vec(),
        _ => values.iter().zip(first).map(|(v, f)| *v - *f).collect(),
    }
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
