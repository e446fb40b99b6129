//! Meshes in the files of rigs (USD, .glb), as polygons in our world: every node's mesh,
//! placed as the node stands at the start.
//!
//! glTF, and some writers of USD, split vertices along seams; [`polygons`] leaves them so, and the
//! caller welds them. Names of nodes become labels, names of materials (in USD of `GeomSubset`s)
//! become fabrics.

use glam::DMat4;

use super::error::RigError;
use super::node::Rig;
use super::node_mesh::NodeMesh;
use super::{RigFormat, glb, usda};
use crate::formats::polygons::{Corner, Place, Polygon, Polygons};

/// The polygons of all meshes in the bytes of a file; `format` says which kind it is of.
pub(crate) fn polygons(bytes: &[u8], format: RigFormat) -> Result<Polygons, RigError> {
    let (mut rig, meshes) = match format {
        RigFormat::Glb => glb::parse_meshes(bytes)?,
        RigFormat::Usd => usda::parse_meshes(bytes)?,
    };
    if meshes.is_empty() {
        return Err(RigError::NoMesh(rig.warnings));
    }
    let mut polygons = Polygons {
        warnings: std::mem::take(&mut rig.warnings),
        ..Polygons::default()
    };
    for mesh in meshes {
        add(&mut polygons, &rig, mesh)?;
    }
    polygons.numbers = (0..polygons.positions.len()).collect();
    Ok(polygons)
}

fn add(polygons: &mut Polygons, rig: &Rig, mesh: NodeMesh) -> Result<(), RigError> {
    let node = rig.check_chain(mesh.node)?;
    let name = &rig.nodes[node].name;
    let placement: DMat4 = rig.placement(node, 0.0);
    let first = polygons.positions.len() as u32;
    let count = mesh.positions.len() as u32;
    let placed = mesh
        .positions
        .iter()
        .map(|p| placement.transform_point3(*p));
    polygons.positions.extend(placed);
    let label = polygons.labels.entry(name.clone()).or_default();
    label.extend(first..first + count);
    for (number, face) in mesh.faces.iter().enumerate() {
        if let Some(&beyond) = face.iter().find(|&&v| v >= count) {
            let problem = format!("face {number} of its mesh names vertex {beyond} of {count}");
            return Err(RigError::node(name, problem));
        }
        let uv = mesh.texture.as_ref().map(|texture| &texture[number]);
        let corners = face.iter().enumerate().map(|(k, &vertex)| Corner {
            vertex: first + vertex,
            texture: uv.map(|uv| {
                polygons.texture.push(uv[k]);
                polygons.texture.len() - 1
            }),
            loose: None,
        });
        let corners = corners.collect();
        let fabric = mesh.fabrics.get(number).and_then(Option::as_deref);
        let fabric = fabric.map(|name| polygons.fabric_of(name));
        polygons.polygons.push(Polygon {
            place: Place::Face(polygons.polygons.len()),
            corners,
            fabric,
            part: polygons.parts.len(),
        });
    }
    polygons.parts.push(vec![name.clone()]);
    Ok(())
}
