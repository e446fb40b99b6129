//! A rig: nodes that move, from the file of another program (.glb, USD), for handles to follow.
//!
//! Nodes are placed in each other; a node's transform is the product of its operations, from the
//! outermost to the innermost, after that of its parent. Everything is brought into our world:
//! metres, y up, seconds. What else is in the file (materials, lights) is passed over; [`mesh`]
//! reads its meshes, where a scene asks for one.

mod bodies;
mod drive;
mod error;
pub(crate) mod glb;
pub(crate) mod mesh;
mod mesh_motion;
mod moving_mesh;
mod node;
mod node_mesh;
mod track;
mod usda;

use std::path::Path;

use crate::formats::file_error::FileError;
use crate::formats::input::read_file;
use glam::DMat4;

pub(crate) use self::bodies::read_body;
pub use self::error::RigError;
pub use self::mesh_motion::MeshMotion;
pub use self::node::{Rig, RigNode};

/// A format of files with nodes and meshes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum RigFormat {
    Glb,
    Usd,
}

impl RigFormat {
    /// The format of a file whose name ends so, in lower case.
    pub(crate) fn of(extension: &str) -> Option<Self> {
        match extension {
            "glb" => Some(Self::Glb),
            "usda" | "usdc" | "usdz" | "usd" => Some(Self::Usd),
            _ => None,
        }
    }
}

impl Rig {
    /// Reads a .glb or USD (.usda, .usdc, .usdz) file.
    ///
    /// # Errors
    /// [`FileError`] names the file, and what in it cannot be understood.
    pub fn read(path: &Path) -> Result<Self, FileError<RigError>> {
        Self::of_file(path, Self::parse)
    }

    /// The rig in the bytes of a file; `format` says which kind it is of.
    pub(crate) fn parse(bytes: &[u8], format: RigFormat) -> Result<Self, RigError> {
        match format {
            RigFormat::Glb => glb::parse(bytes),
            RigFormat::Usd => usda::parse(bytes),
        }
    }

    /// Reads a file by its bytes, with the file named in errors.
    fn of_file<T>(
        path: &Path,
        read: impl Fn(&[u8], RigFormat) -> Result<T, RigError>,
    ) -> Result<T, FileError<RigError>> {
        let extension = path.extension().and_then(|e| e.to_str());
        let format = extension.and_then(RigFormat::of).ok_or_else(|| {
            let known = "the name must end in .glb, .usda, .usdc, .usdz or .usd";
            RigError::Content(known.to_owned())
        });
        let made = format.and_then(|format| {
            let bytes = read_file(path);
            let unread = |error| RigError::Content(format!("could not be read: {error}"));
            read(&bytes.map_err(unread)?, format)
        });
        made.map_err(FileError::at(path))
    }

    /// All nodes.
    #[must_use]
    pub fn nodes(&self) -> &[RigNode] {
        &self.nodes
    }

    /// Times of the first and the last key in the chain from the root to `node` `[s]`.
    #[must_use]
    pub fn span(&self, node: usize) -> Option<[f64; 2]> {
        track::ends(self.keys(node))
    }

    /// The times of the keys in the chain from the root to `node` `[s]`.
    fn keys(&self, node: usize) -> Vec<f64> {
        let chain = self.chain(node);
        let operations = chain.iter().flat_map(|&node| &self.nodes[node].operations);
        operations
            .flat_map(|operation| operation.change.keys())
            .copied()
            .collect()
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
        let named: Vec<usize> = all
            .filter(|(_, n)| n.name == name)
            .map(|(k, _)| k)
            .collect();
        match named.as_slice() {
            &[only] => self.check_chain(only),
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

    fn check_chain(&self, node: usize) -> Result<usize, RigError> {
        let chain = self.chain(node).into_iter();
        let mut obstacles =
            chain.filter_map(|n| Some((&self.nodes[n], self.nodes[n].obstacle.as_ref()?)));
        match obstacles.next() {
            None => Ok(node),
            Some((node, problem)) => Err(RigError::node(&node.name, problem)),
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

#[cfg(test)]
mod caches_tests;
#[cfg(test)]
mod tests;
