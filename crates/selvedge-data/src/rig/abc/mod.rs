//! Nodes, meshes and their motion from an Alembic archive (.abc): the objects whose schema is
//! `Xform`, `PolyMesh` or `SubD`, and their place in the tree.
//!
//! Alembic is taken to be in metres with y up: it does not say. A node's operations are one matrix
//! per sample. Samples are joined linearly. Faces go clockwise in the file and are turned round.
//! Not read: face sets, cameras, curves, points, visibility, and attributes.
//!
//! Bounds: at most 10000 objects, 200 deep; 100000 samples of a property; all samples together have
//! no more numbers than the file has bytes.
//!
//! Format: the sources of Alembic, `AbcCoreOgawa` and `AbcGeom`.

mod archive;
mod budget;
mod geometry;
mod placement;

use glam::DMat4;

use self::archive::{AbcFile, AbcObject};
use self::budget::Budget;
use super::error::RigError;
use super::moving_mesh::MovingMesh;
use super::node::{Rig, RigNode};
use super::node_mesh::NodeMesh;

/// The rig in the bytes of a file.
pub(super) fn parse(bytes: &[u8]) -> Result<Rig, RigError> {
    let file = AbcFile::open(bytes).map_err(RigError::Archive)?;
    rig(&file, &Budget::of(bytes))
}

/// The rig in the bytes of a file, and its meshes as they move.
pub(super) fn parse_bodies(bytes: &[u8]) -> Result<(Rig, Vec<MovingMesh>), RigError> {
    read_meshes(bytes, geometry::moving)
}

/// The rig in the bytes of a file, and its meshes as they stand in their first sample.
pub(super) fn parse_meshes(bytes: &[u8]) -> Result<(Rig, Vec<NodeMesh>), RigError> {
    read_meshes(bytes, geometry::still)
}

/// A reader of the mesh of an object, whose node has a number.
type MeshReader<T> = fn(&AbcFile<'_>, &AbcObject<'_>, usize, &Budget) -> Result<T, String>;

fn read_meshes<T>(bytes: &[u8], read: MeshReader<T>) -> Result<(Rig, Vec<T>), RigError> {
    let file = AbcFile::open(bytes).map_err(RigError::Archive)?;
    let budget = Budget::of(bytes);
    let mut meshes = Vec::new();
    for (node, object) in file.objects.iter().enumerate() {
        if object.is_mesh() {
            let mesh = read(&file, object, node, &budget);
            meshes.push(mesh.map_err(|problem| RigError::Node {
                name: object.name.clone(),
                problem,
            })?);
        }
    }
    Ok((rig(&file, &budget)?, meshes))
}

fn rig(file: &AbcFile<'_>, budget: &Budget) -> Result<Rig, RigError> {
    let nodes = file.objects.iter().map(|object| {
        let mut node = RigNode {
            name: object.name.clone(),
            parent: object.parent,
            operations: Vec::new(),
            obstacle: None,
        };
        if object.is_node() {
            match placement::of(file, object, budget) {
                Ok(found) => {
                    node.operations.extend(found.operation);
                    node.parent = node.parent.filter(|_| found.inherits);
                }
                Err(problem) => node.obstacle = Some(problem),
            }
        }
        node
    });
    Ok(Rig {
        nodes: nodes.collect(),
        world: DMat4::IDENTITY,
    })
}
