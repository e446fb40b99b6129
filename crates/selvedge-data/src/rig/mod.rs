//! A rig: nodes that move, from the file of another program (.glb, .usda), for handles to follow.
//!
//! Nodes are placed in each other; a node's transform is the product of its operations, from the
//! outermost to the innermost, after that of its parent. Everything is brought into our world: metres,
//! y up, seconds. What else is in the file (meshes, materials, lights) is passed over.

mod drive;
mod glb;
mod track;
mod usda;

use std::path::{Path, PathBuf};

use glam::{DMat4, DQuat, DVec3};
use thiserror::Error;

use self::track::Track;

pub(crate) use self::drive::Followers;
/// Nodes that move.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    nodes: Vec<RigNode>,
    /// From the world of the file to ours.
    world: DMat4,
}

/// A node of a rig.
#[derive(Clone, Debug, PartialEq)]
pub struct RigNode {
    /// Its name in the file.
    pub name: String,
    parent: Option<usize>,
    operations: Vec<Operation>,
    /// Why it cannot be said where it is.
    obstacle: Option<String>,
}

/// A part of a node's transform.
#[derive(Clone, Debug, PartialEq)]
struct Operation {
    change: Change,
    /// Whether it is undone instead.
    direction: Direction,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Direction {
    Forward,
    Inverse,
}

#[derive(Clone, Debug, PartialEq)]
enum Change {
    Translation(Track<DVec3>),
    Scale(Track<DVec3>),
    Turn(Track<DQuat>),
    /// By these angles [degrees] about x, y and z, in the order of these axes (0 is x).
    Angles(Track<DVec3>, &'static [usize]),
    Matrix(Track<DMat4>),
}

/// Why a file is no rig, or a node of it cannot be followed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum RigError {
    #[error("{}: {source}", path.display())]
    File {
        path: PathBuf,
        #[source]
        source: Box<RigError>,
    },
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("the name must end in .glb or .usda")]
    Extension,
    #[error("is no complete .glb file: {0}")]
    Container(&'static str),
    #[error("its JSON cannot be understood: {0}")]
    Json(#[source] serde_json::Error),
    #[error("{what}: {problem}")]
    Part { what: String, problem: String },
    #[error("is a binary USD file: save it as text, .usda (usdcat in.usd --out out.usda)")]
    BinaryUsd,
    #[error("line {line}: {problem}")]
    Line { line: usize, problem: String },
    #[error("there is no node called {name:?}; there are [{known}]")]
    NoNode { name: String, known: String },
    #[error("{count} nodes are called {name:?}: give them different names")]
    Ambiguous { name: String, count: usize },
    #[error("node {name:?}: {problem}")]
    Node { name: String, problem: String },
    #[error("none of the nodes [{names}] is animated")]
    Still { names: String },
    #[error("lasts {frames} frames of the scene, more than {most}")]
    Long { frames: f64, most: usize },
    #[error("{nodes} nodes are named for {handles} handles")]
    Count { nodes: usize, handles: usize },
}

impl Rig {
    /// Reads a .glb or .usda file.
    ///
    /// # Errors
    /// [`RigError`] names the file, and what in it cannot be understood.
    pub fn read(path: &Path) -> Result<Self, RigError> {
        let extension = path.extension().and_then(|e| e.to_str());
        let rig = match extension {
            Some("glb" | "usda") => std::fs::read(path).map_err(RigError::Read),
            _ => Err(RigError::Extension),
        };
        let rig = rig.and_then(|bytes| match extension {
            Some("glb") => glb::parse(&bytes),
            _ => usda::parse(&bytes),
        });
        rig.map_err(|source| RigError::File {
            path: path.to_owned(),
            source: Box::new(source),
        })
    }

    /// All nodes.
    #[must_use]
    pub fn nodes(&self) -> &[RigNode] {
        &self.nodes
    }

    /// From when to when something in the chain from the root to `node` moves `[s]`.
    #[must_use]
    pub fn span(&self, node: usize) -> Option<[f64; 2]> {
        let chain = self.chain(node);
        let operations = chain.iter().flat_map(|&node| &self.nodes[node].operations);
        operations
            .filter_map(|operation| operation.change.span())
            .reduce(|a, b| [a[0].min(b[0]), a[1].max(b[1])])
    }

    /// From the space of `node` to the world at `time` `[s]`.
    fn placement(&self, node: usize, time: f64) -> DMat4 {
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
    fn find(&self, name: &str) -> Result<usize, RigError> {
        let all = self.nodes.iter().enumerate();
        let named: Vec<usize> = all
            .filter(|(_, n)| n.name == name)
            .map(|(k, _)| k)
            .collect();
        match named.as_slice() {
            &[only] => self.check_chain(only),
            [] => Err(RigError::NoNode {
                name: name.to_owned(),
                known: self.names(),
            }),
            several => Err(RigError::Ambiguous {
                name: name.to_owned(),
                count: several.len(),
            }),
        }
    }

    fn check_chain(&self, node: usize) -> Result<usize, RigError> {
        let chain = self.chain(node).into_iter();
        let mut obstacles =
            chain.filter_map(|n| Some((&self.nodes[n], self.nodes[n].obstacle.as_ref()?)));
        match obstacles.next() {
            None => Ok(node),
            Some((node, problem)) => Err(RigError::Node {
                name: node.name.clone(),
                problem: problem.clone(),
            }),
        }
    }

    /// The first names, for messages.
    fn names(&self) -> String {
        const SHOWN: usize = 40;
        let mut names: Vec<&str> = self.nodes.iter().map(|n| n.name.as_str()).collect();
        let more = names.len().saturating_sub(SHOWN);
        names.truncate(SHOWN);
        let mut text = names.join(", ");
        if more > 0 {
            text.push_str(&format!(" and {more} more"));
        }
        text
    }
}

impl Operation {
    fn new(change: Change) -> Self {
        Self {
            change,
            direction: Direction::Forward,
        }
    }

    fn at(&self, time: f64) -> DMat4 {
        let matrix = self.change.at(time);
        match self.direction {
            Direction::Forward => matrix,
            Direction::Inverse => matrix.inverse(),
        }
    }
}

impl Change {
    fn span(&self) -> Option<[f64; 2]> {
        match self {
            Self::Translation(track) | Self::Scale(track) | Self::Angles(track, _) => track.span(),
            Self::Turn(track) => track.span(),
            Self::Matrix(track) => track.span(),
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
                    let turn = DQuat::from_axis_angle(DVec3::AXES[axis], angles[axis].to_radians());
                    DMat4::from_quat(turn) * matrix
                })
            }
            Self::Matrix(track) => track.at(time),
        }
    }
}

#[cfg(test)]
mod tests;
