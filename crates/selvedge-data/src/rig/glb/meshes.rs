//! The meshes of a .glb, with their morph targets and skins where what moves them is wanted.

use std::collections::HashMap;

use glam::{DMat4, DVec2, DVec3};
use serde::Deserialize;

use super::super::mesh::{self, Face, RigMesh};
use super::super::node::{RigError, Wanted};
use super::super::track::Track;
use super::{File, Interpolation, part};

/// Extension of a node that has its mesh several times.
const INSTANCES: &str = "EXT_mesh_gpu_instancing";

/// Shares of a point's joints that count as none at all.
const NO_SHARE: f64 = 1e-6;

#[derive(Deserialize)]
pub(super) struct Mesh {
    primitives: Vec<Primitive>,
    #[serde(default)]
    weights: Vec<f64>,
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
#[serde(rename_all = "camelCase")]
pub(super) struct Skin {
    joints: Vec<usize>,
    inverse_bind_matrices: Option<usize>,
}

#[derive(Deserialize)]
pub(super) struct Material {
    name: Option<String>,
}

impl File<'_> {
    /// The meshes of all nodes.
    pub(super) fn meshes(&self, wanted: Wanted<'_>) -> Result<Vec<RigMesh>, RigError> {
        if matches!(wanted, Wanted::Nodes(_)) {
            return Ok(Vec::new());
        }
        let mut required = self.document.extensions_required.iter();
        if let Some(name) = required.find(|name| name.ends_with("_compression")) {
            let problem = format!(
                "are compressed ({name}), which cannot be read: save the file without compression"
            );
            return Err(part("its meshes", problem));
        }
        let mut nodes = self.document.nodes.iter();
        if let Some(node) = nodes.position(|node| node.extensions.contains_key(INSTANCES)) {
            let problem = "its instances (EXT_mesh_gpu_instancing) are not read: export without";
            return Err(part(format!("node {node}"), problem));
        }
        let mut made = Vec::new();
        for (node, of) in self.document.nodes.iter().enumerate() {
            let Some(number) = of.mesh else {
                continue;
            };
            let wrong = |problem: &str| part(format!("mesh {number}"), problem);
            let mesh = self.document.meshes.get(number);
            let mesh = mesh.ok_or_else(|| wrong("there is none of this number"))?;
            let mut own = self.points_and_faces(mesh, &wrong)?;
            own.node = node;
            if wanted != Wanted::Meshes {
                let points = own.positions.len();
                own.targets = self.targets(node, mesh, points, &wrong)?;
                let skin = of.skin.map(|skin| self.skin(skin, mesh, points));
                own.skin = skin.transpose()?;
            }
            made.push(own);
        }
        Ok(made)
    }

    /// All primitives of a mesh.
    fn points_and_faces(
        &self,
        mesh: &Mesh,
        wrong: &dyn Fn(&str) -> RigError,
    ) -> Result<RigMesh, RigError> {
        let mut made = RigMesh::default();
        let is_textured = |p: &Primitive| p.attributes.contains_key("TEXCOORD_0");
        let textured = mesh.primitives.iter().any(is_textured);
        for primitive in &mesh.primitives {
            if primitive.mode.is_some_and(|mode| mode != 4) {
                let problem = "it has lines, points, strips or fans: export triangles";
                return Err(wrong(problem));
            }
            if textured && !is_textured(primitive) {
                let problem = "some of its parts have texture coordinates, others have none";
                return Err(wrong(problem));
            }
            let positions = self.attribute(primitive, "POSITION", 3)?;
            let uv = self.attribute(primitive, "TEXCOORD_0", 2)?;
            let first = made.positions.len() as u32;
            let points = positions.chunks_exact(3).map(DVec3::from_slice);
            made.positions.extend(points);
            let indices: Vec<u32> = match primitive.indices {
                Some(accessor) => self.indices(accessor, 1)?,
                None => (0..positions.len() as u32 / 3).collect(),
            };
            // glTF counts v downwards.
            let place = |v: u32| {
                let place = uv.get(2 * v as usize..2 * v as usize + 2);
                place.map_or(DVec2::ZERO, |p| DVec2::new(p[0], 1.0 - p[1]))
            };
            let materials = &self.document.materials;
            let material = primitive.material.and_then(|m| materials.get(m));
            let fabric = material.and_then(|material| material.name.clone());
            made.faces.extend(indices.chunks_exact(3).map(|face| Face {
                corners: face.iter().map(|v| first + v).collect(),
                texture: if textured {
                    face.iter().map(|v| place(*v)).collect()
                } else {
                    Vec::new()
                },
                fabric: fabric.clone(),
            }));
        }
        Ok(made)
    }

    /// An attribute of the points of a primitive; no numbers where it has none of this name.
    fn attribute(&self, of: &Primitive, name: &str, width: usize) -> Result<Vec<f64>, RigError> {
        match of.attributes.get(name) {
            Some(&accessor) => self.numbers(accessor, width),
            None => Ok(Vec::new()),
        }
    }

    /// The morph targets of all primitives, and their weights.
    fn targets(
        &self,
        node: usize,
        mesh: &Mesh,
        points: usize,
        wrong: &dyn Fn(&str) -> RigError,
    ) -> Result<Vec<mesh::Target>, RigError> {
        let count = mesh.primitives.first().map_or(0, |p| p.targets.len());
        if mesh.primitives.iter().any(|p| p.targets.len() != count) {
            return Err(wrong("its parts have different numbers of morph targets"));
        }
        let own = self.document.nodes[node].weights.as_deref();
        let still = own.unwrap_or(&mesh.weights);
        let weights = self.weights(node, count, still, wrong)?;
        let mut targets = Vec::with_capacity(count);
        for (number, weight) in weights.into_iter().enumerate() {
            let mut offsets = Vec::with_capacity(points);
            for primitive in &mesh.primitives {
                let vertices = self.attribute(primitive, "POSITION", 3)?.len() / 3;
                let moved = match primitive.targets[number].get("POSITION") {
                    Some(&accessor) => self.numbers(accessor, 3)?,
                    None => vec![0.0; 3 * vertices],
                };
                if moved.len() != 3 * vertices {
                    return Err(wrong(&format!(
                        "morph target {number} moves {} points of {vertices}",
                        moved.len() / 3
                    )));
                }
                offsets.extend(moved.chunks_exact(3).map(DVec3::from_slice));
            }
            targets.push(mesh::Target { offsets, weight });
        }
        Ok(targets)
    }

    /// Weights of `count` targets over time: those of the animation, or `still` ones.
    fn weights(
        &self,
        node: usize,
        count: usize,
        still: &[f64],
        wrong: &dyn Fn(&str) -> RigError,
    ) -> Result<Vec<Track<f64>>, RigError> {
        let constant = |k| Track::constant(still.get(k).copied().unwrap_or(0.0));
        let mut channels = self.document.animations.iter().flat_map(|animation| {
            let channels = animation.channels.iter();
            channels.map(move |channel| (animation, channel))
        });
        let moves = channels.find(|(_, channel)| {
            channel.target.path == "weights" && channel.target.node == Some(node)
        });
        let Some((animation, channel)) = moves else {
            return Ok((0..count).map(constant).collect());
        };
        let wrong = |problem: &str| wrong(&format!("the animation of its weights {problem}"));
        let sampler = animation.samplers.get(channel.sampler);
        let sampler = sampler.ok_or_else(|| wrong("has no sampler"))?;
        let times = self.numbers(sampler.input, 1)?;
        let output = self.numbers(sampler.output, 1)?;
        let parts = match sampler.interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Linear | Interpolation::Step => 1,
        };
        if output.len() != times.len() * count * parts {
            let problem = "has another number of values than keys and targets need";
            return Err(wrong(problem));
        }
        // By key: tangents in of all targets, values of all, tangents out of all.
        let track = |target: usize| {
            let own = output.iter().skip(target).step_by(count).copied();
            sampler.track(times.clone(), own.collect()).map_err(wrong)
        };
        (0..count).map(track).collect()
    }

    fn skin(&self, number: usize, mesh: &Mesh, points: usize) -> Result<mesh::Skin, RigError> {
        let wrong = |problem: String| part(format!("skin {number}"), problem);
        let skin = self.document.skins.get(number);
        let skin = skin.ok_or_else(|| wrong("there is none of this number".to_owned()))?;
        let count = skin.joints.len();
        let nodes = self.document.nodes.len();
        if let Some(joint) = skin.joints.iter().find(|&&joint| joint >= nodes) {
            return Err(wrong(format!("its joint is node {joint}, of {nodes}")));
        }
        let binds: Vec<DMat4> = match skin.inverse_bind_matrices {
            None => vec![DMat4::IDENTITY; count],
            Some(accessor) => {
                let numbers = self.numbers(accessor, 16)?;
                let matrices = numbers.chunks_exact(16).map(DMat4::from_cols_slice);
                matrices.collect()
            }
        };
        if binds.len() != count {
            let problem = format!("has {} matrices for {count} joints", binds.len());
            return Err(wrong(problem));
        }
        let mut shares = Vec::with_capacity(points);
        for primitive in &mesh.primitives {
            shares.extend(self.shares(primitive)?);
        }
        if shares.len() != points {
            return Err(wrong(format!(
                "has joints and weights for {} points of {points}",
                shares.len()
            )));
        }
        for (point, own) in shares.iter_mut().enumerate() {
            checked_shares(own, count)
                .map_err(|problem| wrong(format!("point {point} {problem}")))?;
        }
        let joints = skin.joints.iter().copied().zip(binds).collect();
        Ok(mesh::Skin { joints, shares })
    }

    /// Joints of every point of a primitive with their shares.
    fn shares(&self, primitive: &Primitive) -> Result<Vec<Vec<(usize, f64)>>, RigError> {
        let mut shares: Vec<Vec<(usize, f64)>> = Vec::new();
        for set in 0.. {
            let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
            let [Some(&joints), Some(&weights)] =
                names.each_ref().map(|name| primitive.attributes.get(name))
            else {
                break;
            };
            let joints = self.indices(joints, 4)?;
            let weights = self.numbers(weights, 4)?;
            shares.resize(joints.len().min(weights.len()) / 4, Vec::new());
            let pairs = joints.chunks_exact(4).zip(weights.chunks_exact(4));
            for (own, (joints, weights)) in shares.iter_mut().zip(pairs) {
                let pairs = joints.iter().zip(weights);
                own.extend(pairs.map(|(&joint, &weight)| (joint as usize, weight)));
            }
        }
        Ok(shares)
    }
}

/// Leaves the shares that count, with the sum 1.
fn checked_shares(own: &mut Vec<(usize, f64)>, joints: usize) -> Result<(), String> {
    own.retain(|(_, share)| *share != 0.0);
    if let Some((joint, _)) = own.iter().find(|(joint, _)| *joint >= joints) {
        return Err(format!("goes with joint {joint} of {joints}"));
    }
    let sum: f64 = own.iter().map(|(_, share)| share).sum();
    if !(sum.is_finite() && sum > NO_SHARE) || own.iter().any(|(_, share)| *share < 0.0) {
        return Err("has weights of joints that do not sum to 1".to_owned());
    }
    for (_, share) in own {
        *share /= sum;
    }
    Ok(())
}
