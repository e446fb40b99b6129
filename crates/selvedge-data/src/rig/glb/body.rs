//! Bodies of a .glb that move: every mesh with its morph targets and its skin.
//!
//! Format: glTF 2.0 specification, sections 3.7.2.2 (morph targets) and 3.7.3 (skins).

use glam::{DMat4, DVec3};

use super::super::error::RigError;
use super::super::moving_mesh::{MovingMesh, Skin, Target};
use super::super::node::Rig;
use super::super::track::Track;
use super::{File, Interpolation, Mesh, part};

/// Shares of a point's joints that count as none at all.
const NO_SHARE: f64 = 1e-6;

/// The rig in the bytes of a file, with the animation that is asked for or else its only one, or
/// with none where `is_still`; and its moving meshes.
pub(in super::super) fn parse_bodies(
    bytes: &[u8],
    animation: Option<&str>,
    is_still: bool,
) -> Result<(Rig, Vec<MovingMesh>), RigError> {
    let mut file = File::open(bytes)?;
    match is_still {
        true => file.document.animations.clear(),
        false => file.choose(animation)?,
    }
    let rig = file.rig()?;
    let meshes = file.of_nodes(|node, mesh| file.moving(node, mesh))?;
    Ok((rig, meshes))
}

impl File<'_> {
    /// Leaves only the animation that is chosen.
    fn choose(&mut self, chosen: Option<&str>) -> Result<(), RigError> {
        let animations = &mut self.document.animations;
        let known = || {
            let names: Vec<&str> = animations.iter().map(|a| a.name.as_str()).collect();
            names.join(", ")
        };
        match chosen {
            None if animations.len() > 1 => {
                return Err(RigError::Animations { known: known() });
            }
            None => {}
            Some(name) => {
                let Some(only) = animations.iter().position(|a| a.name == name) else {
                    return Err(RigError::no_animation(name, &known()));
                };
                animations.swap(0, only);
                animations.truncate(1);
            }
        }
        Ok(())
    }

    fn moving(&self, node: usize, number: usize) -> Result<MovingMesh, RigError> {
        let made = self.mesh(node, number)?;
        let points = made.positions.len();
        let mesh = &self.document.meshes[number];
        let targets = self.targets(node, number, points)?;
        let skin = match self.document.nodes[node].skin {
            None => None,
            Some(skin) => Some(self.skin(skin, mesh, points)?),
        };
        Ok(MovingMesh::new(made, targets, skin))
    }

    /// The morph targets of all primitives, and their weights.
    fn targets(&self, node: usize, number: usize, points: usize) -> Result<Vec<Target>, RigError> {
        let wrong = |problem: String| part(format!("mesh {number}"), problem);
        let mesh = &self.document.meshes[number];
        let count = mesh.primitives.first().map_or(0, |p| p.targets.len());
        if mesh.primitives.iter().any(|p| p.targets.len() != count) {
            let problem = "its parts have different numbers of morph targets";
            return Err(wrong(problem.to_owned()));
        }
        let own = self.document.nodes[node].weights.as_deref();
        let still = own.unwrap_or(&mesh.weights);
        let weights = self.weights(node, count, still, &wrong)?;
        let mut targets = Vec::with_capacity(count);
        for (number, weight) in weights.into_iter().enumerate() {
            let mut offsets = Vec::with_capacity(points);
            for primitive in &mesh.primitives {
                let vertices = match primitive.attributes.get("POSITION") {
                    Some(&accessor) => self.numbers(accessor, 3)?.len() / 3,
                    None => 0,
                };
                let before = offsets.len();
                if let Some(&accessor) = primitive.targets[number].get("POSITION") {
                    let numbers = self.numbers(accessor, 3)?;
                    offsets.extend(numbers.chunks_exact(3).map(DVec3::from_slice));
                } else {
                    offsets.resize(before + vertices, DVec3::ZERO);
                }
                if offsets.len() != before + vertices {
                    let problem = format!(
                        "morph target {number} moves {} points of {vertices}",
                        offsets.len() - before
                    );
                    return Err(wrong(problem));
                }
            }
            targets.push(Target { offsets, weight });
        }
        Ok(targets)
    }

    /// Weights of `count` targets over time: those of the animation, or `still` ones.
    fn weights(
        &self,
        node: usize,
        count: usize,
        still: &[f64],
        wrong: &dyn Fn(String) -> RigError,
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
        let wrong = |problem: &str| wrong(format!("the animation of its weights {problem}"));
        let sampler = animation.samplers.get(channel.sampler);
        let sampler = sampler.ok_or_else(|| wrong("has no sampler"))?;
        let times = self.numbers(sampler.input, 1)?;
        let output = self.numbers(sampler.output, 1)?;
        let parts = match sampler.interpolation {
            Interpolation::CubicSpline => 3,
            Interpolation::Linear | Interpolation::Step => 1,
        };
        if output.len() != times.len() * count * parts {
            return Err(wrong(
                "has another number of values than keys and targets need",
            ));
        }
        // By key: tangents in of all targets, values of all, tangents out of all.
        let track = |target: usize| {
            let own = output.iter().skip(target).step_by(count).copied();
            sampler.track(times.clone(), own.collect()).map_err(wrong)
        };
        (0..count).map(track).collect()
    }

    fn skin(&self, number: usize, mesh: &Mesh, points: usize) -> Result<Skin, RigError> {
        let what = || format!("skin {number}");
        let wrong = |problem: String| part(what(), problem);
        let skin = self.document.skins.get(number);
        let skin = skin.ok_or_else(|| wrong("there is none of this number".to_owned()))?;
        let count = skin.joints.len();
        let nodes = self.document.nodes.len();
        if let Some(joint) = skin.joints.iter().find(|&&joint| joint >= nodes) {
            return Err(wrong(format!("its joint is node {joint}, of {nodes}")));
        }
        let binds = match skin.inverse_bind_matrices {
            None => vec![DMat4::IDENTITY; count],
            Some(accessor) => self
                .numbers(accessor, 16)?
                .chunks_exact(16)
                .map(DMat4::from_cols_slice)
                .collect(),
        };
        if binds.len() != count {
            let problem = format!("has {} matrices for {count} joints", binds.len());
            return Err(wrong(problem));
        }
        let mut shares = Vec::with_capacity(points);
        for primitive in &mesh.primitives {
            let mut of_part: Vec<Vec<(usize, f64)>> = Vec::new();
            for set in 0.. {
                let names = [format!("JOINTS_{set}"), format!("WEIGHTS_{set}")];
                let [Some(&joints), Some(&weights)] =
                    names.each_ref().map(|name| primitive.attributes.get(name))
                else {
                    break;
                };
                let joints = self.read(joints, 4, super::index)?;
                let weights = self.numbers(weights, 4)?;
                of_part.resize(joints.len().min(weights.len()) / 4, Vec::new());
                let pairs = joints.chunks_exact(4).zip(weights.chunks_exact(4));
                for (own, (joints, weights)) in of_part.iter_mut().zip(pairs) {
                    let pairs = joints.iter().zip(weights);
                    own.extend(pairs.map(|(&joint, &weight)| (joint as usize, weight)));
                }
            }
            shares.extend(of_part);
        }
        if shares.len() != points {
            let problem = format!(
                "has joints and weights for {} points of {points}",
                shares.len()
            );
            return Err(wrong(problem));
        }
        let joints: Vec<(usize, DMat4)> = skin.joints.iter().copied().zip(binds).collect();
        for (point, own) in shares.iter_mut().enumerate() {
            checked_shares(own, count)
                .map_err(|problem| wrong(format!("point {point} {problem}")))?;
        }
        Ok(Skin { joints, shares })
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
