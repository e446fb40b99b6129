//! Nodes and their animation from a .glb (glTF 2.0): translation, rotation and scale, or a matrix,
//! with samplers that go linearly, in steps or by cubic splines. Several animations are taken
//! together, as long as no two of them move the same thing.
//!
//! Read are floats and, for rotations, normalised integers, from the binary part of the file.
//! Packed accessors, and buffers in other files, are errors where they are needed. glTF
//! is in metres with y up, as we are.
//!
//! Format: Khronos Group, glTF 2.0 specification, sections 3.5 (nodes), 3.6 (accessors), 3.11
//! (animations).

mod body;

use std::collections::HashMap;
use std::fmt::Display;

use glam::{DMat4, DQuat, DVec2, DVec3};
use serde::Deserialize;

pub(super) use self::body::parse_bodies;
use super::error::RigError;
use super::node::{Change, Operation, Rig, RigNode};
use super::node_mesh::NodeMesh;
use super::track::{Joined, Track, Value};

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";
/// Extension of a node that has its mesh several times.
const INSTANCES: &str = "EXT_mesh_gpu_instancing";

#[derive(Deserialize)]
#[serde(rename_all = "camelCase", default)]
#[derive(Default)]
struct Document {
    nodes: Vec<Node>,
    animations: Vec<Animation>,
    meshes: Vec<Mesh>,
    skins: Vec<Skin>,
    materials: Vec<Material>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<View>,
    buffers: Vec<Buffer>,
    extensions_required: Vec<String>,
}

#[derive(Deserialize)]
struct Node {
    name: Option<String>,
    #[serde(default)]
    children: Vec<usize>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
    matrix: Option<[f64; 16]>,
    mesh: Option<usize>,
    skin: Option<usize>,
    weights: Option<Vec<f64>>,
    #[serde(default)]
    extensions: serde_json::Map<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct Mesh {
    primitives: Vec<Primitive>,
    #[serde(default)]
    weights: Vec<f64>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Skin {
    joints: Vec<usize>,
    inverse_bind_matrices: Option<usize>,
}

#[derive(Deserialize)]
struct Primitive {
    attributes: HashMap<String, usize>,
    indices: Option<usize>,
    material: Option<usize>,
    /// 4 is triangles.
    mode: Option<u32>,
    #[serde(default)]
    targets: Vec<HashMap<String, usize>>,
}

#[derive(Deserialize)]
struct Material {
    name: Option<String>,
}

#[derive(Deserialize)]
struct Animation {
    #[serde(default)]
    name: String,
    channels: Vec<Channel>,
    samplers: Vec<Sampler>,
}

#[derive(Deserialize)]
struct Channel {
    sampler: usize,
    target: Target,
}

#[derive(Deserialize)]
struct Target {
    node: Option<usize>,
    path: String,
}

#[derive(Deserialize)]
struct Sampler {
    input: usize,
    output: usize,
    #[serde(default)]
    interpolation: Interpolation,
}

#[derive(Clone, Copy, Default, PartialEq, Deserialize)]
#[serde(rename_all = "UPPERCASE")]
enum Interpolation {
    #[default]
    Linear,
    Step,
    CubicSpline,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: usize,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: usize,
    #[serde(rename = "type")]
    form: String,
    sparse: Option<Sparse>,
}

/// Elements of an accessor in place of those of its view, or of zeros where it has none.
#[derive(Deserialize)]
struct Sparse {
    count: usize,
    indices: SparsePart,
    values: SparsePart,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct SparsePart {
    buffer_view: usize,
    #[serde(default)]
    byte_offset: usize,
    /// Of the indices.
    #[serde(default)]
    component_type: u32,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct View {
    buffer: usize,
    #[serde(default)]
    byte_offset: usize,
    byte_length: usize,
    byte_stride: Option<usize>,
    #[serde(default)]
    extensions: serde_json::Map<String, serde_json::Value>,
}

#[derive(Deserialize)]
struct Buffer {
    uri: Option<String>,
}

impl Sampler {
    /// The values at these times; in a spline each is between its tangents.
    fn track<T: Value>(&self, times: Vec<f64>, values: Vec<T>) -> Result<Track<T>, &'static str> {
        let joined = match self.interpolation {
            Interpolation::Linear => Joined::Linearly,
            Interpolation::Step => Joined::InSteps,
            Interpolation::CubicSpline => {
                let triples = values.chunks_exact(3);
                let tangents = triples.clone().map(|t| [t[0], t[2]]).collect();
                let values = triples.map(|t| t[1]).collect();
                return Track::new(times, values, Joined::BySplines(tangents));
            }
        };
        Track::new(times, values, joined)
    }
}

/// A file under way.
struct File<'a> {
    document: Document,
    binary: &'a [u8],
}

/// The part of a transform that a channel moves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
enum Moved {
    Translation,
    Rotation,
    Scale,
}

/// The channels by node and by what they move, each with its animation.
type Channels<'a> = HashMap<(usize, Moved), (&'a Animation, &'a Sampler)>;

/// The rig in the bytes of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<Rig, RigError> {
    File::open(bytes)?.rig()
}

/// The rig in the bytes of a file, and the meshes of its nodes.
pub(super) fn parse_meshes(bytes: &[u8]) -> Result<(Rig, Vec<NodeMesh>), RigError> {
    let file = File::open(bytes)?;
    let meshes = file.of_nodes(|node, mesh| file.mesh(node, mesh))?;
    Ok((file.rig()?, meshes))
}

impl<'a> File<'a> {
    fn open(bytes: &'a [u8]) -> Result<Self, RigError> {
        let (json, binary) = chunks(bytes)?;
        let document = serde_json::from_slice(json);
        let wrong = |error| RigError::Content(format!("its JSON cannot be understood: {error}"));
        let document = document.map_err(wrong)?;
        Ok(Self { document, binary })
    }

    /// Refuses meshes that are compressed.
    fn check_compression(&self) -> Result<(), RigError> {
        let mut required = self.document.extensions_required.iter();
        match required.find(|name| name.ends_with("_compression")) {
            None => Ok(()),
            Some(name) => {
                let problem = format!(
                    "are compressed ({name}), which cannot be read: save the file without compression"
                );
                Err(part("its meshes", problem))
            }
        }
    }
}

/// The JSON and the binary part.
fn chunks(bytes: &[u8]) -> Result<(&[u8], &[u8]), RigError> {
    let rest = bytes.strip_prefix(MAGIC);
    let rest = rest.ok_or_else(|| incomplete("it does not begin with glTF"))?;
    let cut = || incomplete("it ends too early");
    let version = rest.get(..4).ok_or_else(cut)?;
    if version != 2_u32.to_le_bytes() {
        return Err(incomplete("it is not of version 2"));
    }
    let rest = rest.get(8..).ok_or_else(cut)?;
    let json = chunk(rest, JSON_CHUNK)?;
    let (json, rest) = json.ok_or_else(|| incomplete("it has no JSON"))?;
    let binary = chunk(rest, BINARY_CHUNK)?.map_or(&[][..], |(binary, _)| binary);
    Ok((json, binary))
}

/// A part of the file, and what follows it.
type Split<'a> = (&'a [u8], &'a [u8]);

/// The first chunk, if it is of this kind, and what follows it.
fn chunk<'a>(bytes: &'a [u8], kind: &[u8; 4]) -> Result<Option<Split<'a>>, RigError> {
    let Some((length, rest)) = bytes.split_first_chunk::<4>() else {
        return Ok(None);
    };
    let Some(rest) = rest.strip_prefix(kind) else {
        return Ok(None);
    };
    let length = u32::from_le_bytes(*length) as usize;
    let parts = rest.split_at_checked(length).map(Some);
    parts.ok_or_else(|| incomplete("it ends within a chunk"))
}

fn incomplete(problem: &str) -> RigError {
    RigError::Content(format!("is no complete .glb file: {problem}"))
}

fn part(what: impl Display, problem: impl Display) -> RigError {
    RigError::Content(format!("{what}: {problem}"))
}

impl File<'_> {
    fn rig(&self) -> Result<Rig, RigError> {
        let channels = self.channels()?;
        let parents = self.parents()?.into_iter().enumerate();
        let nodes = parents.map(|(number, parent)| self.node(number, parent, &channels));
        Ok(Rig {
            nodes: nodes.collect::<Result<_, _>>()?,
            world: DMat4::IDENTITY,
            start: self.start(),
            warnings: Vec::new(),
        })
    }

    /// Time of the first key of all that is animated `[s]`.
    fn start(&self) -> f64 {
        let animations = self.document.animations.iter();
        let samplers = animations.flat_map(|animation| {
            let channels = animation.channels.iter();
            channels.filter_map(|channel| animation.samplers.get(channel.sampler))
        });
        let firsts = samplers.filter_map(|sampler| {
            let times = self.numbers(sampler.input, 1).ok()?;
            times.first().copied()
        });
        firsts.reduce(f64::min).unwrap_or_default()
    }

    /// What `read` makes of every node that has a mesh, and of its mesh.
    fn of_nodes<T>(
        &self,
        read: impl Fn(usize, usize) -> Result<T, RigError>,
    ) -> Result<Vec<T>, RigError> {
        self.check_compression()?;
        let mut nodes = self.document.nodes.iter();
        if let Some(node) = nodes.position(|node| node.extensions.contains_key(INSTANCES)) {
            let problem = "its instances (EXT_mesh_gpu_instancing) are not read: export without";
            return Err(part(format!("node {node}"), problem));
        }
        let nodes = self.document.nodes.iter().enumerate();
        let meshes = nodes.filter_map(|(node, of)| Some((node, of.mesh?)));
        meshes.map(|(node, mesh)| read(node, mesh)).collect()
    }

    /// The mesh of a node: all its primitives.
    fn mesh(&self, node: usize, mesh: usize) -> Result<NodeMesh, RigError> {
        let what = || format!("mesh {mesh}");
        let found = self.document.meshes.get(mesh);
        let found = found.ok_or_else(|| part(what(), "there is none of this number"))?;
        let mut made = NodeMesh {
            node,
            ..NodeMesh::default()
        };
        let is_textured = |p: &Primitive| p.attributes.contains_key("TEXCOORD_0");
        let textured = found.primitives.iter().any(is_textured);
        made.texture = textured.then(Vec::new);
        for primitive in &found.primitives {
            if primitive.mode.is_some_and(|mode| mode != 4) {
                return Err(part(
                    what(),
                    "it has lines, points, strips or fans: export triangles",
                ));
            }
            if textured && !is_textured(primitive) {
                let problem = "some of its parts have texture coordinates, others have none";
                return Err(part(what(), problem));
            }
            self.add_primitive(&mut made, primitive)?;
        }
        Ok(made)
    }

    fn add_primitive(&self, made: &mut NodeMesh, primitive: &Primitive) -> Result<(), RigError> {
        let attribute = |name: &str, width: usize| match primitive.attributes.get(name) {
            Some(&accessor) => self.numbers(accessor, width),
            None => Ok(Vec::new()),
        };
        let positions = attribute("POSITION", 3)?;
        let uv = attribute("TEXCOORD_0", 2)?;
        let first = made.positions.len() as u32;
        made.positions
            .extend(positions.chunks_exact(3).map(DVec3::from_slice));
        let count = positions.len() / 3;
        let indices: Vec<u32> = match primitive.indices {
            Some(accessor) => {
                let numbers = self.read(accessor, 1, index)?;
                numbers.into_iter().map(|number| number as u32).collect()
            }
            None => (0..count as u32).collect(),
        };
        let material = primitive
            .material
            .and_then(|m| self.document.materials.get(m));
        let fabric = material.and_then(|material| material.name.clone());
        for face in indices.chunks_exact(3) {
            if let Some(texture) = &mut made.texture {
                // glTF counts v downwards.
                let at = |&v: &u32| {
                    let place = uv.get(2 * v as usize..2 * v as usize + 2);
                    place
                        .map(|p| DVec2::new(p[0], 1.0 - p[1]))
                        .unwrap_or_default()
                };
                texture.push(face.iter().map(at).collect());
            }
            made.faces.push(face.iter().map(|v| first + v).collect());
            made.fabrics.push(fabric.clone());
        }
        Ok(())
    }

    /// Parent of each node.
    fn parents(&self) -> Result<Vec<Option<usize>>, RigError> {
        let nodes = &self.document.nodes;
        let mut parents = vec![None; nodes.len()];
        for (number, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                let what = || format!("node {number}");
                let parent: &mut Option<usize> = parents
                    .get_mut(child)
                    .ok_or_else(|| part(what(), format!("there is no child {child}")))?;
                if parent.replace(number).is_some() {
                    return Err(part(what(), format!("its child {child} has two parents")));
                }
            }
        }
        for start in 0..nodes.len() {
            let up = std::iter::successors(Some(start), |&node| parents[node]);
            if up.take(nodes.len() + 1).count() > nodes.len() {
                return Err(part(format!("node {start}"), "it is within itself"));
            }
        }
        Ok(parents)
    }

    fn channels(&self) -> Result<Channels<'_>, RigError> {
        let mut channels = Channels::new();
        for animation in &self.document.animations {
            for channel in &animation.channels {
                let what = || format!("animation {:?}", animation.name);
                let moved = match channel.target.path.as_str() {
                    "translation" => Moved::Translation,
                    "rotation" => Moved::Rotation,
                    "scale" => Moved::Scale,
                    // Weights of morph targets, and what extensions move.
                    _ => continue,
                };
                let Some(node) = channel.target.node else {
                    continue;
                };
                let sampler = animation.samplers.get(channel.sampler);
                let sampler = sampler.ok_or_else(|| {
                    part(what(), format!("it has no sampler {}", channel.sampler))
                })?;
                let before = channels.insert((node, moved), (animation, sampler));
                if let Some((first, _)) = before {
                    let problem = format!(
                        "it moves the {moved:?} of node {node}, as {:?} does: keep one of them",
                        first.name
                    );
                    return Err(part(what(), problem.to_lowercase()));
                }
            }
        }
        Ok(channels)
    }

    fn node(
        &self,
        number: usize,
        parent: Option<usize>,
        channels: &Channels<'_>,
    ) -> Result<RigNode, RigError> {
        let node = &self.document.nodes[number];
        let name = node
            .name
            .clone()
            .unwrap_or_else(|| format!("node {number}"));
        let track = |moved| channels.get(&(number, moved));
        let points = |moved, constant: Option<[f64; 3]>| match track(moved) {
            Some(channel) => self.track(channel, 3, DVec3::from_slice).map(Some),
            None => Ok(constant.map(|value| Track::constant(DVec3::from_array(value)))),
        };
        let rotation = match track(Moved::Rotation) {
            Some(channel) => Some(self.track(channel, 4, DQuat::from_slice)?),
            None => node.rotation.map(|q| Track::constant(DQuat::from_array(q))),
        };
        let matrix = node
            .matrix
            .map(|m| Track::constant(DMat4::from_cols_array(&m)));
        let changes = [
            matrix.map(Change::Matrix),
            points(Moved::Translation, node.translation)?.map(Change::Translation),
            rotation.map(Change::Turn),
            points(Moved::Scale, node.scale)?.map(Change::Scale),
        ];
        Ok(RigNode {
            name,
            parent,
            operations: changes.into_iter().flatten().map(Operation::new).collect(),
            obstacle: None,
        })
    }

    fn track<T: Value>(
        &self,
        &(animation, sampler): &(&Animation, &Sampler),
        width: usize,
        value: impl Fn(&[f64]) -> T,
    ) -> Result<Track<T>, RigError> {
        let times = self.numbers(sampler.input, 1)?;
        let output = self.numbers(sampler.output, width)?;
        let values = output.chunks_exact(width).map(value).collect();
        sampler.track(times, values).map_err(|problem| {
            let what = format!("animation {:?}", animation.name);
            part(what, format!("a sampler {problem}"))
        })
    }

    fn numbers(&self, accessor: usize, width: usize) -> Result<Vec<f64>, RigError> {
        self.read(accessor, width, component)
    }

    fn read(
        &self,
        accessor: usize,
        width: usize,
        component: impl Fn(u32, bool) -> Option<Component>,
    ) -> Result<Vec<f64>, RigError> {
        let what = || format!("accessor {accessor}");
        let wrong = |problem: &str| part(what(), problem);
        let document = &self.document;
        let found = document.accessors.get(accessor);
        let found = found.ok_or_else(|| wrong("there is none of this number"))?;
        let expected = match width {
            1 => "SCALAR",
            2 => "VEC2",
            3 => "VEC3",
            4 => "VEC4",
            _ => "MAT4",
        };
        if found.form != expected {
            return Err(wrong(&format!("expected {expected}, found {}", found.form)));
        }
        let of_type = |component: Option<Component>| {
            component.ok_or_else(|| {
                wrong("it has numbers of a type that is not understood here: export without quantisation")
            })
        };
        let own = of_type(component(found.component_type, found.normalized))?;
        let elements = |view, first, count, width, of| {
            let read = self.elements(view, first, count, width, of);
            read.map_err(|problem| wrong(&problem))
        };
        let mut numbers = match found.buffer_view {
            Some(view) => elements(view, found.byte_offset, found.count, width, own)?,
            // No file has a byte less than its elements.
            None if found.count > self.binary.len() => return Err(wrong(CUT)),
            None => vec![0.0; found.count * width],
        };
        if let Some(sparse) = &found.sparse {
            let Sparse {
                indices, values, ..
            } = sparse;
            let of = of_type(index(indices.component_type, false))?;
            let places = elements(
                indices.buffer_view,
                indices.byte_offset,
                sparse.count,
                1,
                of,
            )?;
            let values = elements(
                values.buffer_view,
                values.byte_offset,
                sparse.count,
                width,
                own,
            )?;
            for (place, value) in places.into_iter().zip(values.chunks_exact(width)) {
                let element = numbers.chunks_exact_mut(width).nth(place as usize);
                let element = element.ok_or_else(|| {
                    wrong(&format!(
                        "it is sparse, with an element {place} of {}",
                        found.count
                    ))
                })?;
                element.copy_from_slice(value);
            }
        }
        Ok(numbers)
    }

    /// `count` elements of `width` numbers each, from byte `first` of a view on.
    fn elements(
        &self,
        view: usize,
        first: usize,
        count: usize,
        width: usize,
        (size, read): Component,
    ) -> Result<Vec<f64>, String> {
        let (view, bytes) = self.view(view)?;
        let stride = view.byte_stride.unwrap_or(size * width);
        if count > bytes.len() {
            return Err(CUT.to_owned());
        }
        let mut numbers = Vec::with_capacity(count * width);
        for element in 0..count {
            let start = element
                .checked_mul(stride)
                .and_then(|at| at.checked_add(first));
            let element = start
                .and_then(|start| bytes.get(start..start.checked_add(size * width)?))
                .ok_or(CUT)?;
            numbers.extend(element.chunks_exact(size).map(read));
        }
        Ok(numbers)
    }

    /// The view of this number, and its bytes.
    fn view(&self, number: usize) -> Result<(&View, &[u8]), String> {
        let document = &self.document;
        let view = document.buffer_views.get(number);
        let view = view.ok_or("it has no view of the binary part")?;
        let buffer = document.buffers.get(view.buffer);
        if view.buffer != 0 || buffer.is_none_or(|buffer| buffer.uri.is_some()) {
            return Err("its buffer is in another file: export as one .glb".to_owned());
        }
        if let Some(name) = view.extensions.keys().next() {
            return Err(format!(
                "it is packed by {name}, which is not understood here: export without"
            ));
        }
        let end = view.byte_offset.checked_add(view.byte_length).ok_or(CUT)?;
        let bytes = self.binary.get(view.byte_offset..end).ok_or(CUT)?;
        Ok((view, bytes))
    }
}

const CUT: &str = "it reaches beyond the end of the file";

/// Bytes of a number, and the function that reads it.
type Component = (usize, fn(&[u8]) -> f64);

/// The indices of an accessor.
fn index(component_type: u32, _: bool) -> Option<Component> {
    match component_type {
        5121 => Some((1, |b| f64::from(b[0]))),
        5123 => Some((2, |b| f64::from(u16::from_le_bytes([b[0], b[1]])))),
        5125 => Some((4, |b| {
            f64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        })),
        _ => None,
    }
}

/// The numbers of an accessor, where animations may have such.
fn component(component_type: u32, normalized: bool) -> Option<Component> {
    match (component_type, normalized) {
        (5126, false) => Some((4, |b| {
            f64::from(f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
        })),
        (5120, true) => Some((1, |b| (f64::from(b[0] as i8) / 127.0).max(-1.0))),
        (5121, true) => Some((1, |b| f64::from(b[0]) / 255.0)),
        (5122, true) => Some((2, |b| {
            (f64::from(i16::from_le_bytes([b[0], b[1]])) / 32767.0).max(-1.0)
        })),
        (5123, true) => Some((2, |b| f64::from(u16::from_le_bytes([b[0], b[1]])) / 65535.0)),
        _ => None,
    }
}

#[cfg(test)]
pub(crate) mod tests {
    /// The bytes of a file of this JSON and binary part, whose length is a multiple of four.
    pub(crate) fn file(json: &serde_json::Value, binary: &[u8]) -> Vec<u8> {
        let mut text = json.to_string().into_bytes();
        text.resize(text.len().next_multiple_of(4), b' ');
        let mut bytes = b"glTF\x02\0\0\0".to_vec();
        bytes.extend((28 + text.len() as u32 + binary.len() as u32).to_le_bytes());
        for (kind, part) in [(b"JSON", &text[..]), (b"BIN\0", binary)] {
            bytes.extend((part.len() as u32).to_le_bytes());
            bytes.extend(kind);
            bytes.extend(part);
        }
        bytes
    }
}
