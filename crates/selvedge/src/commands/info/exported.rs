//! Files for and of other programs: archives of arrays (.npz), and nodes that move (.glb, USD).

use std::path::Path;

use anyhow::Context;
use selvedge_data::{MeshMotion, Rig, Trajectory};
use serde_json::{Value, json};

use super::{Seen, bare};
use crate::output::Facts;

/// Reads an exported archive.
pub(super) fn read_npz(path: &Path) -> anyhow::Result<Trajectory> {
    let bytes = selvedge_data::read_file(path).with_context(|| path.display().to_string())?;
    Trajectory::from_npz(&bytes).with_context(|| path.display().to_string())
}

/// Says which nodes a file has, and when they move.
pub(super) fn inspect_rig(path: &Path) -> anyhow::Result<Seen> {
    let mut facts = Facts::new();
    facts.add("kind", "nodes of another program");
    facts.tell_path("file", path);
    let meshes = meshes(&mut facts, path);
    let nodes = nodes(&mut facts, path)?;
    let answer = facts.answer(json!({ "kind": "rig", "meshes": meshes, "nodes": nodes }));
    let why = "there is nothing to draw of such a file";
    Ok(bare(answer, format!("{}: {why}", path.display())))
}

/// Adds the nodes of a file, and gives them for the report.
pub(super) fn nodes(facts: &mut Facts, path: &Path) -> anyhow::Result<Value> {
    let rig = Rig::read(path)?;
    let nodes: Vec<(&str, Option<[f64; 2]>)> = rig
        .nodes()
        .iter()
        .enumerate()
        .map(|(number, node)| (node.name.as_str(), rig.span(number)))
        .collect();
    let moving = nodes.iter().filter(|node| node.1.is_some()).count();
    facts.add("nodes", format!("{}, {moving} of them moving", nodes.len()));
    for (name, span) in &nodes {
        let when = match span {
            Some([from, to]) => format!("{name}: moves from {from:.3} to {to:.3} s"),
            None => format!("{name}: stands"),
        };
        facts.add("node", when);
    }
    let nodes = nodes
        .iter()
        .map(|(name, span)| json!({ "name": name, "moves": span }));
    Ok(nodes.collect())
}

/// Adds the meshes of a file and their frames, and gives them for the report: nothing where they
/// cannot be read, of which other words are said.
pub(super) fn meshes(facts: &mut Facts, path: &Path) -> Value {
    let meshes = Rig::read_meshes(path).unwrap_or_default();
    for mesh in &meshes {
        let frames = match (mesh.times.as_slice(), mesh.frame_rate()) {
            ([first, .., last], Some(rate)) => format!(
                "{} frames at {:.3} per second, from {first:.3} to {last:.3} s",
                mesh.times.len(),
                rate
            ),
            ([first, .., last], None) => format!(
                "{} frames, unevenly from {first:.3} to {last:.3} s",
                mesh.times.len()
            ),
            _ => "stands".to_owned(),
        };
        let MeshMotion {
            name,
            points,
            faces,
            ..
        } = mesh;
        facts.add(
            "mesh",
            format!("{name}: {points} points, {faces} faces, {frames}"),
        );
    }
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
    meshes.collect()
}
