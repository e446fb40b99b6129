//! A mesh file, and what its pattern is: panels, seams, fabrics, and the edges that start farthest
//! from their lengths.

use std::path::Path;

use selvedge_cloth::geometry::signed_area_2d;
use selvedge_cloth::{Handles, Mesh, VertexId};
use selvedge_data::{ReadMesh, size_warning, strain_warnings, worst_edges};
use selvedge_lab::physics;
use serde_json::{Value, json};

use super::picture::Picture;
use super::{Seen, box_of, corners, exported, shortest_mean_longest, sides};
use crate::output::{Facts, folded};

/// Worst edges that are named.
const NAMED: usize = 5;
/// Stretch of an edge from which it is named.
const WORTH_NAMING: f64 = 1.001;

/// Says what the mesh in a file is, and which nodes there are beside it if it `has_nodes`.
pub(super) fn inspect(read: ReadMesh, path: &Path, has_nodes: bool) -> anyhow::Result<Seen> {
    let mesh = &read.sheet.mesh;
    let mut warnings = read.warnings.clone();
    warnings.extend(size_warning(mesh.positions()));
    warnings.extend(strain_warnings(mesh));
    for warning in &warnings {
        tracing::warn!("{}: {warning}", path.display());
    }
    let topology = mesh.topology();
    let labels: Vec<&String> = read.sheet.labels.keys().collect();
    let boundary = topology.edges().iter().filter(|e| e.is_boundary()).count();
    let mut facts = Facts::new();
    facts.tell("kind", "mesh");
    facts.tell_path("file", path);
    facts.tell("vertices", topology.vertex_count());
    facts.tell("faces", topology.faces().len());
    facts.add(
        "edges",
        format!("{}, {boundary} on the boundary", topology.edges().len()),
    );
    size(&mut facts, mesh);
    facts.tell_as("labels", folded(&labels), &labels);
    if read.is_own_shape {
        facts.add("pattern", "none: each face rests as it stands");
    }
    if read.velocities.is_some() {
        facts.add("velocities", "of the vertices, for start = \"mesh\"");
    }
    self::facts(&mut facts, mesh, !read.is_own_shape);
    let (meshes, nodes) = if has_nodes {
        (
            exported::meshes(&mut facts, path),
            exported::nodes(&mut facts, path)?,
        )
    } else {
        (Value::Null, Value::Null)
    };
    let report = json!({
        "edges": topology.edges().len(),
        "boundary_edges": boundary,
        "own_shape": read.is_own_shape,
        "meshes": meshes,
        "nodes": nodes,
        "warnings": warnings,
    });
    let picture = Picture::Still(Box::new(read.sheet.mesh), Vec::new(), Vec::new());
    Ok((facts.answer(report), picture))
}

/// Adds how large `mesh` is in space, and its area in the pattern.
pub(super) fn size(facts: &mut Facts, mesh: &Mesh) {
    let (low, high) = box_of(&physics::rounded(mesh.positions()));
    let ends = mesh.topology().edges().iter().map(|edge| edge.vertices);
    let place = |v: VertexId| mesh.positions()[v.index()];
    let lengths = ends.map(|[a, b]| place(a).distance(place(b)));
    let area: f64 = mesh.rest_shape(1.0).face_area.iter().sum();
    facts.add("size", sides(low, high));
    corners(facts, (low, high));
    facts.tell_as("area", format!("{area:.4} m² in the pattern"), area);
    facts.add("edge lengths", shortest_mean_longest(lengths));
}

/// Adds what the pattern of `mesh` is, in words if it `has_pattern`.
pub(super) fn facts(facts: &mut Facts, mesh: &Mesh, has_pattern: bool) {
    let (topology, pattern) = (mesh.topology(), mesh.pattern());
    let sheets = topology.sheets().iter().max().map_or(0, |last| last + 1);
    let panels = pattern.panels();
    let count = panels.iter().max().map_or(0, |last| last + 1);
    let is_seam = |edge: &&selvedge_cloth::Edge| pattern.is_seam(edge);
    let seams = topology.edges().iter().filter(is_seam).count();
    let mut mirrored = vec![0.0; count as usize];
    for (shape, panel) in pattern.faces().zip(&panels) {
        let [a, b, c] = shape;
        mirrored[*panel as usize] += signed_area_2d(a, b, c);
    }
    let mirrored = mirrored.iter().filter(|area| **area < 0.0).count();
    let mut worst = worst_edges(mesh, &Handles::default(), mesh.positions(), NAMED);
    worst.retain(|edge| edge.stretch > WORTH_NAMING);
    facts.add("sheets", sheets);
    if seams > 0 && has_pattern {
        let mirrored = match mirrored {
            0 => String::new(),
            some => format!(", {some} of them mirrored"),
        };
        facts.add("panels", format!("{count}{mirrored}"));
        facts.add("seams", format!("{seams} edges"));
    }
    let fabrics = &mesh.fabrics().names;
    if !fabrics.is_empty() {
        facts.add("fabrics", folded(fabrics));
    }
    facts.add_all("longest edge", &worst);
    let report = json!({
        "sheets": sheets,
        "panels": count,
        "mirrored_panels": mirrored,
        "seam_edges": seams,
        "fabrics": fabrics,
        "worst_edges": worst,
    });
    facts.note("pattern", report);
}
