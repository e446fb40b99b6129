//! A rig and its nodes: a tree of transforms that change over time.

use glam::{DMat4, DQuat, DVec3};
use selvedge_cloth::geometry::turn;
use thiserror::Error;

use super::mesh::RigMesh;
use super::track::{Track, ends};

/// Frames at most that something may move.
const MOST_FRAMES: usize = 100_000;

/// A key that is so near to a frame is taken to be at it [frames]: glTF has times in single
/// precision.
const SLACK: f64 = 1e-2;

/// A file that is no rig, or a node of it that cannot be followed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum RigError {
    #[error("{0}")]
    Content(String),
    #[error("has several animations: choose one by `animation`, of [{known}]")]
    Animations { known: String },
    #[error("has no mesh{}", .0.iter().map(|left| format!("; {left}")).collect::<String>())]
    NoMesh(Vec<String>),
}

impl RigError {
    pub(super) fn node(name: &str, problem: impl std::fmt::Display) -> Self {
        Self::Content(format!("node {name:?}: {problem}"))
    }

    /// There is no animation of this name, but the `known` ones.
    pub(super) fn no_animation(name: &str, known: &str) -> Self {
        Self::Content(format!(
            "has no animation called {name:?}; there are [{known}]"
        ))
    }
}

/// Parts of a file that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted<'a> {
    /// The nodes, moved by the animation of this name or by all.
    Nodes(Option<&'a str>),
    /// Their meshes too, without what moves points beside the nodes.
    Meshes,
    /// All that moves points, by the animation of this name or the only one.
    Motion(Option<&'a str>),
    /// All that has a say in where points are, without animations.
    Still,
}

/// Nodes that move, and their meshes.
#[derive(Debug)]
pub struct Rig {
    pub(super) nodes: Vec<RigNode>,
    /// Transform from the world of the file to ours.
    pub(super) world: DMat4,
    /// The time at which its motions begin `[s]`: that of the first key in the file, or where a
    /// stage begins, if that is earlier. What has its first key later rests until then.
    pub(super) start: f64,
    /// Warnings of what of its meshes is not read.
    pub(crate) warnings: Vec<String>,
    /// The meshes, where they are wanted.
    pub(super) meshes: Vec<RigMesh>,
}

impl Rig {
    /// As [`Self::read_motion`], of the nodes here.
    pub(super) fn motion(
        &self,
        names: &[String],
        frame_rate: f64,
    ) -> Result<Vec<Vec<DMat4>>, RigError> {
        let nodes = names.iter().map(|name| self.find(name));
        let nodes = nodes.collect::<Result<Vec<usize>, _>>()?;
        let spans = nodes.iter().filter_map(|&node| self.span(node));
        let Some(last) = spans.map(|span| span[1]).reduce(f64::max) else {
            let mut unique = names.to_vec();
            unique.dedup();
            return Err(RigError::Content(format!(
                "none of the nodes [{}] is animated",
                unique.join(", ")
            )));
        };
        let back = |(&node, name): (&usize, &String)| {
            let inverse = self.placement(node, self.start).inverse();
            if inverse.is_finite() {
                Ok(inverse)
            } else {
                Err(RigError::node(name, "is scaled to nothing at the start"))
            }
        };
        let back = nodes.iter().zip(names).map(back);
        let back = back.collect::<Result<Vec<DMat4>, _>>()?;
        let frame = |time: f64| {
            let nodes = nodes.iter().zip(&back);
            let moved = nodes.map(|(&node, back)| self.placement(node, time) * *back);
            moved.collect()
        };
        let times = frame_times(self.start, last, frame_rate)?;
        Ok(times.map(frame).collect())
    }

    /// All nodes.
    pub fn nodes(&self) -> &[RigNode] {
        &self.nodes
    }

    /// Times of the first and the last key in the chain from the root to `node` `[s]`.
    pub fn span(&self, node: usize) -> Option<[f64; 2]> {
        ends(self.keys(node))
    }

    /// The times of the keys in the chain from the root to `node` `[s]`.
    pub(super) fn keys(&self, node: usize) -> Vec<f64> {
        let chain = self.chain(node);
        let operations = chain.iter().flat_map(|&node| &self.nodes[node].operations);
        let keys = operations.flat_map(|operation| operation.change.keys());
        keys.copied().collect()
    }

    /// Transform from the space of `node` to the world at `time` `[s]`.
    pub(crate) fn placement(&self, node: usize, time: f64) -> DMat4 {
        let chain = self.chain(node);
        let operations = chain.iter().rev().flat_map(|&n| &self.nodes[n].operations);
        operations.fold(self.world, |matrix, operation| matrix * operation.at(time))
    }

    /// A node, its parent and so on to the root.
    fn chain(&self, node: usize) -> Vec<usize> {
        std::iter::successors(Some(node), |&node| self.nodes[node].parent)
            .take(self.nodes.len())
            .collect()
    }

    /// The only node of this name that can be placed.
    pub(crate) fn find(&self, name: &str) -> Result<usize, RigError> {
        let all = self.nodes.iter().enumerate();
        let named = all.filter(|(_, n)| n.name == name).map(|(k, _)| k);
        let named: Vec<usize> = named.collect();
        match named.as_slice() {
            &[only] => self.check_chain(only).map(|()| only),
            [] => Err(RigError::Content(format!(
                "there is no node called {name:?}; there are [{}]",
                self.names()
            ))),
            several => Err(RigError::Content(format!(
                "{} nodes are called {name:?}: give them different names",
                several.len()
            ))),
        }
    }

    pub(super) fn check_chain(&self, node: usize) -> Result<(), RigError> {
        let mut chain = self.chain(node).into_iter().map(|node| &self.nodes[node]);
        match chain.find_map(|node| Some((&node.name, node.obstacle.as_ref()?))) {
            None => Ok(()),
            Some((name, problem)) => Err(RigError::node(name, problem)),
        }
    }

    /// The first names, for messages.
    fn names(&self) -> String {
        const SHOWN: usize = 40;
        let names = self.nodes.iter().map(|n| n.name.as_str());
        let shown = names.take(SHOWN).collect::<Vec<_>>().join(", ");
        match self.nodes.len().saturating_sub(SHOWN) {
            0 => shown,
            more => format!("{shown} and {more} more"),
        }
    }
}

/// The times of the frames from `first` to `last` `[s]`, at least one.
pub(super) fn frame_times(
    first: f64,
    last: f64,
    frame_rate: f64,
) -> Result<impl Iterator<Item = f64>, RigError> {
    let frames = ((last - first).max(0.0) * frame_rate + SLACK).floor();
    if !(0.0..MOST_FRAMES as f64).contains(&frames) {
        let problem = format!("lasts {frames} frames of the scene, more than {MOST_FRAMES}");
        return Err(RigError::Content(problem));
    }
    Ok((0..=frames as usize).map(move |frame| first + frame as f64 / frame_rate))
}

/// A node of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RigNode {
    /// Name of the node in the file.
    pub name: String,
    pub(super) parent: Option<usize>,
    pub(super) operations: Vec<Operation>,
    /// Reason why its place cannot be said.
    pub(super) obstacle: Option<String>,
}

/// A part of a node's transform.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Operation {
    pub(super) change: Change,
    /// True where it is undone.
    pub(super) is_inverse: bool,
}

#[derive(Clone, Debug, PartialEq)]
pub(super) enum Change {
    Translation(Track<DVec3>),
    Scale(Track<DVec3>),
    Turn(Track<DQuat>),
    /// Turns by these angles [degrees] about x, y and z, in the order of these axes (0 is x).
    Angles(Track<DVec3>, Vec<usize>),
    Matrix(Track<DMat4>),
}

impl Operation {
    fn at(&self, time: f64) -> DMat4 {
        let matrix = self.change.at(time);
        if self.is_inverse { matrix.inverse() } else { matrix }
    }
}

impl Change {
    /// The times of its keys `[s]`; none where nothing changes.
    fn keys(&self) -> &[f64] {
        match self {
            Self::Translation(track) | Self::Scale(track) | Self::Angles(track, _) => track.keys(),
            Self::Turn(track) => track.keys(),
            Self::Matrix(track) => track.keys(),
        }
    }

    fn at(&self, time: f64) -> DMat4 {
        match self {
            Self::Translation(track) => DMat4::from_translation(track.at(time)),
            Self::Scale(track) => DMat4::from_scale(track.at(time)),
            Self::Turn(track) => DMat4::from_quat(track.at(time).normalize()),
            Self::Angles(track, order) => {
                let angles = track.at(time);
                // The first axis turns first, and so stands innermost.
                order.iter().fold(DMat4::IDENTITY, |matrix, &axis| {
                    let turn = turn(DVec3::AXES[axis], angles[axis].to_radians());
                    DMat4::from_quat(turn) * matrix
                })
            }
            Self::Matrix(track) => track.at(time),
        }
    }
}
