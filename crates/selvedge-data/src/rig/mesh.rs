//! A mesh of a node as it moves: by morph targets, by samples of its points, by a skin, or with its
//! node.
//!
//! A point is its position plus every target times its weight. In a mesh with a skin it then goes
//! with its joints: Σ w M(t) B p, M from the joint's space to the world and B its inverse bind
//! matrix; the node's own transform does not count. `[eq:skin]` Without a skin it goes with its
//! node.

use glam::{DMat4, DVec2, DVec3};

use super::node::Rig;
use super::track::{Joined, Track};

/// A mesh of a node, and what moves its points.
#[derive(Debug, Default)]
pub(super) struct RigMesh {
    pub(super) node: usize,
    /// Positions in the space of the node or, with a skin, of the bind.
    pub(super) positions: Vec<DVec3>,
    pub(super) faces: Vec<Face>,
    /// Morph targets of every point.
    pub(super) targets: Vec<Target>,
    /// Samples of the points, in place of the positions.
    pub(super) samples: Option<Samples>,
    pub(super) skin: Option<Skin>,
}

#[derive(Clone, Debug, Default)]
pub(super) struct Face {
    /// Points.
    pub(super) corners: Vec<u32>,
    /// Texture coordinates of the corners, v upwards; none where the mesh has none.
    pub(super) texture: Vec<DVec2>,
    /// Name of the material.
    pub(super) fabric: Option<String>,
}

/// A morph target.
#[derive(Debug)]
pub(super) struct Target {
    /// Displacements of every point.
    pub(super) offsets: Vec<DVec3>,
    /// Share of them over time.
    pub(super) weight: Track<f64>,
}

/// Points over time.
#[derive(Debug)]
pub(super) struct Samples {
    /// The place in `frames`, in frames.
    place: Track<f64>,
    frames: Vec<Vec<DVec3>>,
}

/// Joints and what follows them.
#[derive(Debug)]
pub(super) struct Skin {
    /// Nodes, and the matrices from the bind to their spaces.
    pub(super) joints: Vec<(usize, DMat4)>,
    /// Joints of every point with their shares, which sum to 1.
    pub(super) shares: Vec<Vec<(usize, f64)>>,
}

impl RigMesh {
    /// Makes `frames` at `times` `[s]` its points, linear in between; there is at least one.
    pub(super) fn sample(
        &mut self,
        times: Vec<f64>,
        frames: Vec<Vec<DVec3>>,
    ) -> Result<(), &'static str> {
        let places = (0..frames.len()).map(|frame| frame as f64).collect();
        let place = Track::new(times, places, Joined::Linearly)?;
        self.samples = Some(Samples { place, frames });
        Ok(())
    }

    /// Positions at `time` `[s]` in our world `[m]`, `[points]`. `[eq:skin]`
    pub(super) fn positions(&self, rig: &Rig, time: f64) -> Vec<DVec3> {
        let mut points = match &self.samples {
            Some(samples) => points_at(&samples.frames, samples.place.at(time)),
            None => self.positions.clone(),
        };
        for target in &self.targets {
            let weight = target.weight.at(time);
            for (point, offset) in points.iter_mut().zip(&target.offsets) {
                *point += weight * *offset;
            }
        }
        let Some(skin) = &self.skin else {
            let placement = rig.placement(self.node, time);
            let placed = points.iter().map(|p| placement.transform_point3(*p));
            return placed.collect();
        };
        let joints = skin.joints.iter();
        let joints = joints.map(|&(node, bind)| rig.placement(node, time) * bind);
        let joints: Vec<DMat4> = joints.collect();
        let place = |(point, shares): (&DVec3, &Vec<(usize, f64)>)| {
            let moved = shares
                .iter()
                .map(|&(joint, share)| share * joints[joint].transform_point3(*point));
            moved.sum()
        };
        points.iter().zip(&skin.shares).map(place).collect()
    }

    /// Times of the keys of its nodes `[s]`.
    pub(super) fn keys_of_nodes(&self, rig: &Rig) -> impl Iterator<Item = f64> {
        self.nodes().into_iter().flat_map(|node| rig.keys(node))
    }

    /// Times of its samples and morph targets `[s]`.
    pub(super) fn own_keys(&self) -> impl Iterator<Item = f64> {
        let of_targets = self.targets.iter().flat_map(|t| t.weight.keys());
        let of_samples = self.samples.iter().flat_map(|s| s.place.keys());
        of_targets.chain(of_samples).copied()
    }

    /// The times `[s]` at which its points are known, and not only between others: those of its
    /// samples and morph targets, or of its nodes where it has neither; ascending. None if nothing
    /// moves it.
    pub(super) fn keys(&self, rig: &Rig) -> Vec<f64> {
        let mut keys: Vec<f64> = self.own_keys().collect();
        if keys.is_empty() {
            keys = self.keys_of_nodes(rig).collect();
        }
        keys.sort_by(f64::total_cmp);
        keys.dedup();
        keys
    }

    /// The nodes whose places must be known.
    pub(super) fn nodes(&self) -> Vec<usize> {
        match &self.skin {
            Some(skin) => skin.joints.iter().map(|joint| joint.0).collect(),
            None => vec![self.node],
        }
    }
}

/// The points at a place in `frames`, in frames: linear between two of them.
fn points_at(frames: &[Vec<DVec3>], place: f64) -> Vec<DVec3> {
    let from = (place.floor() as usize).min(frames.len() - 1);
    let to = (from + 1).min(frames.len() - 1);
    let part = place - from as f64;
    let pairs = frames[from].iter().zip(&frames[to]);
    pairs.map(|(a, b)| a.lerp(*b, part)).collect()
}
