//! The held vertices of a cache: as they are numbered, or by the nodes that they go with.
//!
//! Frames are compared as the file has them: between two frames, where points go straight, what
//! turns is not rigid.

use glam::DVec3;

use super::super::options::HandleSource;
use crate::rig::{Rig, RigFormat, read_body};

/// Roundings of the largest coordinate by which a vertex may stray from a node that it goes with:
/// nodes turn by numbers in single precision, too.
const ROUNDINGS: f64 = 16.0;

/// The handles that `source` says, of the vertices of `span` in a file.
pub(super) fn held(
    source: &HandleSource,
    bytes: &[u8],
    format: Option<RigFormat>,
    span: [usize; 2],
) -> Result<Vec<u32>, String> {
    match (source, format) {
        (HandleSource::Vertices(numbers), _) => Ok(numbers.clone()),
        (HandleSource::Nodes(names), Some(format)) => with_nodes(names, bytes, format, span),
        (HandleSource::Nodes(_), None) => Err(
            "is a cache of points, without nodes to name: number the held vertices (`handles` 0,30)"
                .to_owned(),
        ),
    }
}

/// The vertices that go with nodes of these names: node by node, each time the nearest first.
fn with_nodes(
    names: &[String],
    bytes: &[u8],
    format: RigFormat,
    span: [usize; 2],
) -> Result<Vec<u32>, String> {
    let rig = Rig::parse(bytes, format).map_err(|error| error.to_string())?;
    let body = read_body(bytes, format, None, false).map_err(|error| error.to_string())?;
    let keys = body.keys_at(span[0]);
    let own = |time: &f64| body.positions(*time)[span[0]..span[1]].to_vec();
    let frames: Vec<Vec<DVec3>> = keys.iter().map(own).collect();
    let (Some(first), Some(&start)) = (frames.first(), keys.first()) else {
        return Err("has a cloth that does not move".to_owned());
    };
    let coordinates = frames.iter().flatten().map(|p| p.abs().max_element());
    let largest = coordinates.fold(0.0, f64::max);
    let tolerance = ROUNDINGS * f64::from(f32::EPSILON) * largest;
    let mut handles: Vec<u32> = Vec::new();
    for name in names {
        let node = rig.find(name).map_err(|error| error.to_string())?;
        let placements: Vec<_> = keys.iter().map(|&time| rig.placement(node, time)).collect();
        let to_node = rig.placement(node, start).inverse();
        // How far a vertex is from where the node would take it, at most.
        let strays = |vertex: usize| {
            let place = to_node.transform_point3(first[vertex]);
            let pairs = placements.iter().zip(&frames);
            let apart = pairs
                .map(|(to_world, frame)| to_world.transform_point3(place).distance(frame[vertex]));
            apart.fold(0.0, f64::max)
        };
        let origin = rig.placement(node, start).transform_point3(DVec3::ZERO);
        let strays: Vec<f64> = (0..first.len()).map(strays).collect();
        let mut with: Vec<usize> = (0..first.len())
            .filter(|&vertex| strays[vertex] <= tolerance)
            .collect();
        if with.is_empty() {
            let nearest = (0..first.len()).min_by(|&a, &b| strays[a].total_cmp(&strays[b]));
            let nearest = nearest.unwrap_or_default();
            return Err(format!(
                "has no vertex that goes with the node {name:?} to {tolerance:.1e} m: vertex {nearest} comes nearest, and strays by {:.1e} m",
                strays.get(nearest).copied().unwrap_or(f64::NAN)
            ));
        }
        with.sort_by(|&a, &b| {
            let [a, b] = [a, b].map(|vertex| first[vertex].distance(origin));
            a.total_cmp(&b)
        });
        for vertex in with {
            if !handles.contains(&(vertex as u32)) {
                handles.push(vertex as u32);
            }
        }
    }
    Ok(handles)
}
