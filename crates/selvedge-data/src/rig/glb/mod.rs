//! Nodes, their animation and their meshes from a .glb (glTF 2.0): translation, rotation and scale,
//! or a matrix, with samplers that go linearly, in steps or by cubic splines. Several animations
//! are taken together where none is chosen, as long as no two of them move the same thing.
//!
//! glTF is in metres with y up, as we are.
//!
//! Format: Khronos Group, glTF 2.0 specification, sections 3.5 (nodes), 3.6 (accessors), 3.7.2.2
//! (morph targets), 3.7.3 (skins), 3.11 (animations).

mod accessor;
mod meshes;

use std::collections::HashMap;
use std::fmt::Display;

use glam::{DMat4, DQuat, DVec3};
use serde::Deserialize;

use self::accessor::{Accessor, Buffer, View};
use self::meshes::{Material, Mesh, Skin};
use super::node::{Change, Operation, Rig, RigError, RigNode, Wanted};
use super::track::{Joined, Track, Value};

const MAGIC: &[u8; 4] = b"glTF";
const JSON_CHUNK: &[u8; 4] = b"JSON";
const BINARY_CHUNK: &[u8; 4] = b"BIN\0";

#[derive(Default, Deserialize)]
#[serde(rename_all = "camelCase", default)]
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

#[derive(Default, Deserialize)]
#[serde(default)]
struct Node {
    name: Option<String>,
    children: Vec<usize>,
    translation: Option<[f64; 3]>,
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
    matrix: Option<[f64; 16]>,
    mesh: Option<usize>,
    skin: Option<usize>,
    weights: Option<Vec<f64>>,
    extensions: serde_json::Map<String, serde_json::Value>,
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

/// What a channel moves: the translation, rotation, scale or weights of a node.
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

/// The channels by node and by what they move of it, each with its animation.
type Channels<'a> = HashMap<(usize, &'a str), (&'a Animation, &'a Sampler)>;

/// The rig in the bytes of a file.
pub(super) fn parse(bytes: &[u8], wanted: Wanted<'_>) -> Result<Rig, RigError> {
    let (json, binary) = chunks(bytes)?;
    let document = serde_json::from_slice(json);
    let wrong = |error| RigError::Content(format!("its JSON cannot be understood: {error}"));
    let document = document.map_err(wrong)?;
    let mut file = File { document, binary };
    match wanted {
        Wanted::Nodes(None) | Wanted::Meshes => {}
        Wanted::Nodes(animation) | Wanted::Motion(animation) => file.choose(animation)?,
        Wanted::Still => file.document.animations.clear(),
    }
    let meshes = file.meshes(wanted)?;
    let channels = file.channels()?;
    let parents = file.parents()?.into_iter().enumerate();
    let nodes = parents.map(|(number, parent)| file.node(number, parent, &channels));
    Ok(Rig {
        nodes: nodes.collect::<Result<_, _>>()?,
        world: DMat4::IDENTITY,
        start: file.start(),
        warnings: Vec::new(),
        meshes,
    })
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
    /// Leaves only the animation that is chosen.
    fn choose(&mut self, chosen: Option<&str>) -> Result<(), RigError> {
        let (names, known) = (self.names(), self.names().join(", "));
        let Some(name) = chosen else {
            return match names.len() {
                0 | 1 => Ok(()),
                _ => Err(RigError::Animations { known }),
            };
        };
        let only = names.iter().position(|own| *own == name);
        let only = only.ok_or_else(|| RigError::no_animation(name, &known))?;
        self.document.animations.swap(0, only);
        self.document.animations.truncate(1);
        Ok(())
    }

    fn names(&self) -> Vec<&str> {
        let animations = self.document.animations.iter();
        animations
            .map(|animation| animation.name.as_str())
            .collect()
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

    /// Parent of each node.
    fn parents(&self) -> Result<Vec<Option<usize>>, RigError> {
        let nodes = &self.document.nodes;
        let mut parents = vec![None; nodes.len()];
        for (number, node) in nodes.iter().enumerate() {
            for &child in &node.children {
                let wrong = |problem| part(format!("node {number}"), problem);
                let parent: &mut Option<usize> = parents
                    .get_mut(child)
                    .ok_or_else(|| wrong(format!("there is no child {child}")))?;
                if parent.replace(number).is_some() {
                    return Err(wrong(format!("its child {child} has two parents")));
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

    /// The channels that move nodes. Weights of morph targets, and what extensions move, are passed
    /// over.
    fn channels(&self) -> Result<Channels<'_>, RigError> {
        let mut channels = Channels::new();
        for animation in &self.document.animations {
            let wrong = |problem| part(format!("animation {:?}", animation.name), problem);
            for Channel { sampler, target } in &animation.channels {
                let path = target.path.as_str();
                let Some(node) = target
                    .node
                    .filter(|_| ["translation", "rotation", "scale"].contains(&path))
                else {
                    continue;
                };
                let missing = || wrong(format!("it has no sampler {sampler}"));
                let sampler = animation.samplers.get(*sampler).ok_or_else(missing)?;
                if let Some((first, _)) = channels.insert((node, path), (animation, sampler)) {
                    if !std::ptr::eq(first, animation) {
                        let known = self.names().join(", ");
                        return Err(RigError::Animations { known });
                    }
                    return Err(wrong(format!(
                        "it moves the {path} of node {node}, as {:?} does: keep one of them",
                        first.name
                    )));
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
        let channel = |path| channels.get(&(number, path));
        let points = |path, constant: Option<[f64; 3]>| match channel(path) {
            Some(channel) => self.track(channel, 3, DVec3::from_slice).map(Some),
            None => Ok(constant.map(|value| Track::constant(DVec3::from_array(value)))),
        };
        let rotation = match channel("rotation") {
            Some(channel) => Some(self.track(channel, 4, DQuat::from_slice)?),
            None => node.rotation.map(|q| Track::constant(DQuat::from_array(q))),
        };
        let matrix = node
            .matrix
            .map(|m| Track::constant(DMat4::from_cols_array(&m)));
        let changes = [
            matrix.map(Change::Matrix),
            points("translation", node.translation)?.map(Change::Translation),
            rotation.map(Change::Turn),
            points("scale", node.scale)?.map(Change::Scale),
        ];
        let operation = |change| Operation {
            change,
            is_inverse: false,
        };
        let name = node.name.clone();
        Ok(RigNode {
            name: name.unwrap_or_else(|| format!("node {number}")),
            parent,
            operations: changes.into_iter().flatten().map(operation).collect(),
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
}

#[cfg(test)]
pub(crate) mod tests {
    use serde_json::{Value, json};

    /// A .glb under way: every array is an accessor, by its number.
    #[derive(Default)]
    pub(crate) struct Glb {
        binary: Vec<u8>,
        views: Vec<Value>,
        pub(crate) accessors: Vec<Value>,
    }

    impl Glb {
        /// Adds an array of so many elements of this form and type of number.
        pub(crate) fn store(
            &mut self,
            form: &str,
            component: u32,
            count: usize,
            bytes: &[u8],
        ) -> usize {
            let start = self.binary.len();
            self.binary.extend(bytes);
            self.binary.resize(self.binary.len().next_multiple_of(4), 0);
            self.views
                .push(json!({ "buffer": 0, "byteOffset": start, "byteLength": bytes.len() }));
            self.accessors.push(json!({
                "bufferView": self.views.len() - 1,
                "byteOffset": 0,
                "componentType": component,
                "count": count,
                "type": form,
            }));
            self.accessors.len() - 1
        }

        /// Adds an array of elements of this form, `width` numbers each.
        pub(crate) fn floats(&mut self, form: &str, width: usize, values: &[f32]) -> usize {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            self.store(form, 5126, values.len() / width, &bytes)
        }

        /// The bytes of a file of this JSON and the arrays.
        pub(crate) fn finish(self, json: Value) -> Vec<u8> {
            self.finish_as(json, |_| {})
        }

        /// As [`Self::finish`], with the JSON changed by `edit` at last.
        pub(crate) fn finish_as(self, mut json: Value, edit: impl FnOnce(&mut Value)) -> Vec<u8> {
            json["asset"] = json!({ "version": "2.0" });
            json["buffers"] = json!([{ "byteLength": self.binary.len() }]);
            json["bufferViews"] = Value::Array(self.views);
            json["accessors"] = Value::Array(self.accessors);
            edit(&mut json);
            let mut text = json.to_string().into_bytes();
            text.resize(text.len().next_multiple_of(4), b' ');
            let mut bytes = b"glTF\x02\0\0\0".to_vec();
            bytes.extend((28 + text.len() as u32 + self.binary.len() as u32).to_le_bytes());
            for (kind, part) in [(b"JSON", text), (b"BIN\0", self.binary)] {
                bytes.extend((part.len() as u32).to_le_bytes());
                bytes.extend(kind);
                bytes.extend(part);
            }
            bytes
        }
    }
}
