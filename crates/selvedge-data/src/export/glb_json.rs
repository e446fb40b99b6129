//! The text of a .glb: which bytes of its binary part are what ([`Layout`]), and the nodes, the
//! mesh, the material and the animation that are made of them.

use glam::Vec3;
use serde_json::{Value, json};

use super::glb_bodies::Bodies;
use super::take::Take;

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
/// Targets of the views of the binary part.
const VERTICES: u32 = 34962;
const INDICES: u32 = 34963;

/// The front of our pictures, in linear light.
const COLOUR: [f32; 4] = [0.08, 0.13, 0.4, 1.0];

/// Obstacles.
const GREY: [f32; 4] = [0.3, 0.3, 0.3, 1.0];

/// Layout of the binary part `[bytes]`: views one after another.
pub(super) struct Layout {
    views: Vec<View>,
}

/// Content of a view of the binary part.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    Indices,
    Positions,
    Normals,
    Texture,
    HandleNumbers,
    /// Vertex of each point, where the cloth is sewn.
    Vertices,
    Times,
    Weights,
    HandlePaths,
    /// Of the obstacle of this number: corners of faces, points, rotations and translations.
    BodyIndices(usize),
    BodyPoints(usize),
    BodyTurns(usize),
    BodyPlaces(usize),
}

struct View {
    part: Part,
    start: u64,
    length: u64,
}

impl Layout {
    /// Lays out everything of `take`.
    pub(super) fn new(take: &Take<'_>) -> Self {
        let cloth = take.trajectory().cloth();
        let [frames, vertices, faces, handles] = [
            take.len(),
            cloth.material_coordinates().len(),
            cloth.face_area().len(),
            cloth.handles().vertices().len(),
        ]
        .map(|count| count as u64);
        let normals = if take.has_normals() { frames } else { 0 };
        let is_sewn = cloth.pattern().is_sewn();
        let mut views = Vec::new();
        let mut start = 0;
        let obstacles = take.obstacles();
        let obstacles = obstacles.iter().enumerate().flat_map(|(k, obstacle)| {
            let points = 12 * obstacle.point_count() as u64;
            let is_rigid = obstacle.rigid_points().is_some();
            let moving = if is_rigid {
                1
            } else {
                obstacle.frame_count(take)
            };
            let poses = if is_rigid { frames } else { 0 };
            [
                (Part::BodyIndices(k), 12 * obstacle.faces().len() as u64),
                (Part::BodyPoints(k), points * moving as u64),
                (Part::BodyTurns(k), 16 * poses),
                (Part::BodyPlaces(k), 12 * poses),
            ]
        });
        let own = [
            (Part::Indices, 12 * faces),
            (Part::Positions, 12 * vertices * frames),
            (Part::Normals, 12 * vertices * normals),
            (Part::Texture, 8 * vertices),
            (Part::HandleNumbers, 4 * vertices),
            (Part::Vertices, if is_sewn { 4 * vertices } else { 0 }),
            (Part::Times, 4 * frames),
            (Part::Weights, 4 * frames * (frames - 1)),
            (Part::HandlePaths, 12 * frames * handles),
        ];
        for (part, length) in own.into_iter().chain(obstacles) {
            if length > 0 {
                views.push(View {
                    part,
                    start,
                    length,
                });
                start += length;
            }
        }
        Self { views }
    }

    /// Bytes of the whole binary part.
    pub(super) fn bytes(&self) -> u64 {
        self.views.iter().map(|view| view.length).sum()
    }

    fn number(&self, part: Part) -> Option<usize> {
        self.views.iter().position(|view| view.part == part)
    }

    fn to_json(&self) -> Vec<Value> {
        let of = |view: &View| {
            let mut json = json!({
                "buffer": 0,
                "byteOffset": view.start,
                "byteLength": view.length,
            });
            let (stride, target) = match view.part {
                Part::Indices | Part::BodyIndices(_) => (None, Some(INDICES)),
                Part::Positions | Part::Normals | Part::BodyPoints(_) => (Some(12), Some(VERTICES)),
                Part::Texture => (Some(8), Some(VERTICES)),
                Part::HandleNumbers | Part::Vertices => (Some(4), Some(VERTICES)),
                Part::Times
                | Part::Weights
                | Part::HandlePaths
                | Part::BodyTurns(_)
                | Part::BodyPlaces(_) => (None, None),
            };
            if let Some(stride) = stride {
                json["byteStride"] = json!(stride);
            }
            if let Some(target) = target {
                json["target"] = json!(target);
            }
            json
        };
        self.views.iter().map(of).collect()
    }
}

/// Accessors as they are asked for.
pub(super) struct Accessors<'a> {
    layout: &'a Layout,
    all: Vec<Value>,
}

impl Accessors<'_> {
    /// One over `count` elements of `part` from its byte `offset`; its number.
    pub(super) fn add(&mut self, part: Part, offset: usize, count: usize) -> usize {
        let (component, form) = match part {
            Part::Indices | Part::BodyIndices(_) => (UNSIGNED_INT, "SCALAR"),
            Part::Positions
            | Part::Normals
            | Part::HandlePaths
            | Part::BodyPoints(_)
            | Part::BodyPlaces(_) => (FLOAT, "VEC3"),
            Part::BodyTurns(_) => (FLOAT, "VEC4"),
            Part::Texture => (FLOAT, "VEC2"),
            Part::HandleNumbers | Part::Vertices | Part::Times | Part::Weights => (FLOAT, "SCALAR"),
        };
        self.all.push(json!({
            "bufferView": self.layout.number(part),
            "byteOffset": offset,
            "componentType": component,
            "count": count,
            "type": form,
        }));
        self.all.len() - 1
    }

    pub(super) fn bound(&mut self, accessor: usize, low: &[f32], high: &[f32]) {
        self.all[accessor]["min"] = json!(low);
        self.all[accessor]["max"] = json!(high);
    }
}

/// The whole text; `extents` are of the first frame and of what the further ones differ by.
pub(super) fn document(
    take: &Take<'_>,
    layout: &Layout,
    extents: impl Iterator<Item = [Vec3; 2]>,
) -> String {
    let mut accessors = Accessors {
        layout,
        all: Vec::new(),
    };
    let primitive = primitive(take, &mut accessors, extents);
    let handles = take.handle_positions(0);
    let mut animation = (take.len() > 1).then(|| animation(take, &mut accessors));
    // The nodes before those of obstacles are the sheet and the handles.
    let bodies = Bodies::of(take, 1 + handles.len(), &mut accessors, animation.as_mut());
    let names: Vec<String> = (1..take.len()).map(|k| format!("frame {k}")).collect();
    let mut mesh = json!({ "name": "sheet", "primitives": [primitive] });
    if !names.is_empty() {
        mesh["weights"] = json!(vec![0; names.len()]);
        mesh["extras"] = json!({ "targetNames": names });
    }
    let mut nodes = vec![json!({ "name": "sheet", "mesh": 0 })];
    nodes.extend(handles.iter().enumerate().map(|(number, position)| {
        json!({ "name": format!("handle_{number}"), "translation": position.to_array() })
    }));
    let mut materials = vec![material("cloth", COLOUR)];
    if !bodies.meshes.is_empty() {
        materials.push(material("obstacle", GREY));
    }
    nodes.extend(bodies.nodes);
    let mut meshes = vec![mesh];
    meshes.extend(bodies.meshes);
    let mut document = json!({
        "asset": { "version": "2.0", "generator": take.trajectory().provenance().made_by },
        "scene": 0,
        "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "meshes": meshes,
        "materials": materials,
        "accessors": accessors.all,
        "bufferViews": layout.to_json(),
        "buffers": [{ "byteLength": layout.bytes() }],
    });
    if let Some(animation) = animation {
        document["animations"] = json!([animation]);
    }
    document.to_string()
}

fn primitive(
    take: &Take<'_>,
    accessors: &mut Accessors<'_>,
    extents: impl Iterator<Item = [Vec3; 2]>,
) -> Value {
    let pattern = take.trajectory().cloth().pattern();
    let vertices = pattern.points().len();
    let corners = 3 * take.trajectory().cloth().face_area().len();
    let indices = accessors.add(Part::Indices, 0, corners);
    let mut shapes = Vec::with_capacity(take.len());
    for (number, [low, high]) in extents.enumerate() {
        let offset = 12 * vertices * number;
        let position = accessors.add(Part::Positions, offset, vertices);
        accessors.bound(position, &low.to_array(), &high.to_array());
        let mut shape = json!({ "POSITION": position });
        if take.has_normals() {
            shape["NORMAL"] = json!(accessors.add(Part::Normals, offset, vertices));
        }
        shapes.push(shape);
    }
    let mut attributes = shapes.remove(0);
    attributes["TEXCOORD_0"] = json!(accessors.add(Part::Texture, 0, vertices));
    attributes["_HANDLE"] = json!(accessors.add(Part::HandleNumbers, 0, vertices));
    if pattern.is_sewn() {
        attributes["_VERTEX"] = json!(accessors.add(Part::Vertices, 0, vertices));
    }
    let mut primitive = json!({ "attributes": attributes, "indices": indices, "material": 0 });
    if !shapes.is_empty() {
        primitive["targets"] = json!(shapes);
    }
    primitive
}

fn animation(take: &Take<'_>, accessors: &mut Accessors<'_>) -> Value {
    let keys = take.len();
    let times = accessors.add(Part::Times, 0, keys);
    let end = take.time(keys - 1) as f32;
    accessors.bound(times, &[0.0], &[end]);
    let weights = accessors.add(Part::Weights, 0, keys * (keys - 1));
    let mut samplers = vec![sampler(times, weights)];
    let mut channels = vec![channel(0, 0, "weights")];
    for handle in 0..take.trajectory().handles().vertices().len() {
        let path = accessors.add(Part::HandlePaths, 12 * keys * handle, keys);
        channels.push(channel(samplers.len(), 1 + handle, "translation"));
        samplers.push(sampler(times, path));
    }
    json!({ "name": "cloth", "samplers": samplers, "channels": channels })
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

fn sampler(input: usize, output: usize) -> Value {
    json!({ "input": input, "output": output, "interpolation": "LINEAR" })
}

pub(super) fn channel(sampler: usize, node: usize, path: &str) -> Value {
    json!({ "sampler": sampler, "target": { "node": node, "path": path } })
}
