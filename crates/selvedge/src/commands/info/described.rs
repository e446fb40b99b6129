//! Meshes, obstacles and files of other programs as reports.

use std::path::Path;

use glam::DVec3;
use selvedge_cloth::geometry::{bounds, signed_area_2d};
use selvedge_cloth::{Handles, Mesh, Obstacle, ObstaclePath};
use selvedge_data::{
    MeshFileError, MeshOptions, Rig, read_mesh, size_warning, strain_warnings, worst_edges,
};
use serde_json::{Value, json};

use super::picture::Picture;
use super::{Seen, joined, undrawn};

/// Worst edges that are named.
const NAMED: usize = 5;
/// Stretch of an edge from which it is named.
const WORTH_NAMING: f64 = 1.001;

/// A mesh file, and the nodes beside the mesh; or only these.
pub(super) fn mesh_file(path: &Path, is_rig: bool) -> anyhow::Result<Seen> {
    let nodes = if is_rig { rig(path)? } else { json!({}) };
    let read = match read_mesh(path, MeshOptions::default()) {
        Err(error) if is_rig && !matches!(error.source, MeshFileError::Read(_)) => {
            // What has no mesh to read has nodes, for handles to follow.
            if !matches!(error.source, MeshFileError::NoMesh) {
                tracing::warn!("no mesh can be read: {error}");
            }
            return Ok(undrawn(nodes));
        }
        read => read?,
    };
    let mesh = read.sheet.mesh;
    let mut warnings = read.warnings;
    warnings.extend(size_warning(mesh.positions()));
    warnings.extend(strain_warnings(&mesh));
    for warning in &warnings {
        tracing::warn!("{}: {warning}", path.display());
    }
    let own = json!({
        "kind": "mesh",
        "labels": read.sheet.labels.keys().collect::<Vec<_>>(),
        "has_velocities": read.velocities.is_some(),
        "warnings": warnings,
    });
    let report = joined([nodes, of_mesh(&mesh, read.is_own_shape), own]);
    Ok((
        report,
        Picture::Still(Box::new(mesh), Vec::new(), Vec::new()),
    ))
}

/// The nodes and the meshes of a file, and when they move.
fn rig(path: &Path) -> anyhow::Result<Value> {
    let rig = Rig::read(path)?;
    let nodes = rig.nodes().iter().enumerate();
    let nodes = nodes.map(|(number, node)| json!({ "name": node.name, "moves": rig.span(number) }));
    // Where meshes cannot be read, that is told when one is.
    let meshes = Rig::read_meshes(path).unwrap_or_default();
    let meshes = meshes.iter().map(|mesh| {
        json!({
            "name": mesh.name,
            "points": mesh.points,
            "faces": mesh.faces,
            "frames": mesh.times.len(),
            "frame_rate": mesh.frame_rate(),
            "from": mesh.times.first(),
            "to": mesh.times.last(),
        })
    });
    let (nodes, meshes): (Vec<_>, Vec<_>) = (nodes.collect(), meshes.collect());
    Ok(json!({ "kind": "rig", "nodes": nodes, "meshes": meshes }))
}

/// What a mesh is, and its pattern.
pub(super) fn of_mesh(mesh: &Mesh, is_own_shape: bool) -> Value {
    let (topology, pattern) = (mesh.topology(), mesh.pattern());
    let boundary = topology.edges().iter().filter(|e| e.is_boundary()).count();
    let sheets = topology.sheets().iter().max().map_or(0, |last| last + 1);
    let panels = pattern.panels();
    let count = panels.iter().max().map_or(0, |last| last + 1);
    let is_seam = |edge: &&selvedge_cloth::Edge| pattern.is_seam(edge);
    let mut areas = vec![0.0; count as usize];
    for ([a, b, c], panel) in pattern.faces().zip(&panels) {
        areas[*panel as usize] += signed_area_2d(a, b, c);
    }
    let mut worst = worst_edges(mesh, &Handles::default(), mesh.positions(), NAMED);
    worst.retain(|edge| edge.stretch > WORTH_NAMING);
    let ends = topology.edges().iter().map(|edge| edge.vertices);
    let ends = ends.map(|ends| ends.map(|v| v.index()));
    let own = json!({
        "vertices": topology.vertex_count(),
        "faces": topology.faces().len(),
        "edges": topology.edges().len(),
        "boundary_edges": boundary,
        "own_shape": is_own_shape,
        "area": mesh.rest_shape(1.0).face_area.iter().sum::<f64>(),
        "pattern": {
            "sheets": sheets,
            "panels": count,
            "mirrored_panels": areas.iter().filter(|area| **area < 0.0).count(),
            "seam_edges": topology.edges().iter().filter(is_seam).count(),
            "fabrics": mesh.fabrics().names,
            "worst_edges": worst,
        },
    });
    joined([own, size(mesh.positions(), ends)])
}

/// A body of a scene.
pub(super) fn of_obstacle(obstacle: &Obstacle) -> Value {
    let (motion, seconds) = match obstacle.path() {
        _ if obstacle.is_still() => ("still", None),
        ObstaclePath::Still => ("still", None),
        ObstaclePath::Rigid(keys) => ("rigidly", keys.last().map(|key| key.time)),
        ObstaclePath::Points { frame_rate, frames } => (
            "by its points",
            Some((frames.len() - 1) as f64 / frame_rate),
        ),
    };
    let friction = Some(obstacle.friction()).filter(|friction| friction.is_finite());
    let faces = obstacle.faces();
    let own = json!({
        "name": obstacle.name(),
        "points": obstacle.point_count(),
        "faces": faces.len(),
        "motion": motion,
        "seconds": seconds,
        "friction": friction,
    });
    let ends = faces.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
    let ends = ends.map(|ends| ends.map(|point| point as usize));
    let places: Vec<DVec3> = obstacle.positions_at(0.0).collect();
    joined([own, size(&places, ends)])
}

/// The box around `points`, and the least, the mean and the largest length between `ends` `[m]`.
pub(super) fn size(points: &[DVec3], ends: impl Iterator<Item = [usize; 2]>) -> Value {
    let [low, high] = bounds(points);
    let lengths: Vec<f64> = ends.map(|[a, b]| points[a].distance(points[b])).collect();
    let mean = lengths.iter().sum::<f64>() / lengths.len().max(1) as f64;
    let least = lengths.iter().copied().reduce(f64::min).unwrap_or_default();
    let largest = lengths.iter().copied().reduce(f64::max).unwrap_or_default();
    let corners = [low, high].map(|corner| corner.as_vec3().to_array());
    json!({
        "size": (high - low).as_vec3().to_array(),
        "lowest_corner": corners[0],
        "highest_corner": corners[1],
        "edge_lengths": [least, mean, largest],
    })
}
