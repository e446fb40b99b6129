//! A mesh as a node of a rig has it.

use glam::{DVec2, DVec3};

/// A mesh as a node has it.
#[derive(Debug, Default)]
pub(super) struct NodeMesh {
    /// The node.
    pub(super) node: usize,
    /// Positions in the space of the node.
    pub(super) positions: Vec<DVec3>,
    /// Faces by their vertices.
    pub(super) faces: Vec<Vec<u32>>,
    /// Texture coordinates of the faces' corners, v upwards; none where there are none.
    pub(super) texture: Option<Vec<Vec<DVec2>>>,
    /// Name of each face's material.
    pub(super) fabrics: Vec<Option<String>>,
}
