//! Sewing from flat: panels are placed in space, and pairs of their borders become one.
//!
//! The material coordinates are those of the flat pattern, taken before a panel is placed. The two
//! vertices of each pair meet half way; what that strains a fit relaxes.

use std::collections::{BTreeMap, BTreeSet};

use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};

use super::error::MeshFileError;
use super::flat::planar_coordinates;
use super::soup::Polygons;
use super::weld::merge;

/// Two borders that are sewn together, by the names of their objects or groups.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeamPair {
    /// One border.
    pub a: String,
    /// The other border, of as many vertices.
    pub b: String,
}

/// Placement of a panel, by the name of its object or group: turned about the origin, then moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanelPlace {
    /// Name of the panel.
    pub panel: String,
    /// Axis of the turn.
    #[serde(default = "up")]
    pub axis: DVec3,
    /// Right-handed angle `[degrees]`.
    #[serde(default)]
    pub angle_deg: f64,
    /// Move `[m]`, in the file's unit of length.
    #[serde(default)]
    pub translation: DVec3,
}

fn up() -> DVec3 {
    DVec3::Y
}

/// Seams that are sewn, and places of panels for it.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sewing {
    /// Placements of panels.
    pub panels: Vec<PanelPlace>,
    /// Seams, in the order in which they are sewn.
    pub seams: Vec<SeamPair>,
}

impl Sewing {
    /// Returns true when nothing is placed or sewn.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.panels.is_empty() && self.seams.is_empty()
    }
}

/// Places the panels and sews the seams.
pub(crate) fn sew(polygons: &mut Polygons, sewing: &Sewing) -> Result<(), MeshFileError> {
    if sewing.is_empty() {
        return Ok(());
    }
    keep_flat(polygons)?;
    for place in &sewing.panels {
        put(polygons, place)?;
    }
    let mut pairs = Vec::new();
    for seam in &sewing.seams {
        pairs.extend(pairs_of(polygons, seam)?);
    }
    // What is sewn twice, as where three seams meet, becomes one vertex.
    let mut owners: Vec<u32> = (0..polygons.positions.len() as u32).collect();
    for [a, b] in pairs {
        let (one, two) = (root(&owners, a), root(&owners, b));
        owners[one.max(two) as usize] = one.min(two);
    }
    let owners: Vec<u32> = (0..owners.len() as u32).map(|v| root(&owners, v)).collect();
    let mut sums: BTreeMap<u32, (DVec3, f64)> = BTreeMap::new();
    for (vertex, owner) in owners.iter().enumerate() {
        let sum = sums.entry(*owner).or_default();
        *sum = (sum.0 + polygons.positions[vertex], sum.1 + 1.0);
    }
    for (owner, (sum, count)) in sums {
        polygons.positions[owner as usize] = sum / count;
    }
    merge(polygons, &owners);
    Ok(())
}

fn root(owners: &[u32], mut vertex: u32) -> u32 {
    while owners[vertex as usize] != vertex {
        vertex = owners[vertex as usize];
    }
    vertex
}

/// Gives a flat pattern without texture coordinates those of its plane, before it is placed.
fn keep_flat(polygons: &mut Polygons) -> Result<(), MeshFileError> {
    let mut corners = polygons.polygons.iter().flat_map(|p| &p.corners);
    if corners.any(|corner| corner.texture.is_some()) {
        return Ok(());
    }
    let flat = planar_coordinates(polygons).ok_or(MeshFileError::NotFlat)?;
    polygons.texture = flat;
    for corner in polygons.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        corner.texture = Some(corner.vertex as usize);
    }
    Ok(())
}

fn vertices<'a>(
    polygons: &'a Polygons,
    name: &str,
    key: &'static str,
) -> Result<&'a BTreeSet<u32>, MeshFileError> {
    polygons.labels.get(name).ok_or_else(|| {
        let known: Vec<&str> = polygons.labels.keys().map(String::as_str).collect();
        MeshFileError::Content {
            problem: format!(
                "{key} names {name:?}, but the mesh has no object or group of that name; it has [{}]",
                known.join(", ")
            ),
        }
    })
}

fn put(polygons: &mut Polygons, place: &PanelPlace) -> Result<(), MeshFileError> {
    let axis = place.axis.try_normalize();
    let axis = axis.filter(|_| place.angle_deg.is_finite() && place.translation.is_finite());
    let axis = axis.ok_or_else(|| MeshFileError::Place {
        panel: place.panel.clone(),
    })?;
    let turn = DQuat::from_axis_angle(axis, place.angle_deg.to_radians());
    for vertex in vertices(polygons, &place.panel, "mesh.panels")?.clone() {
        let position = &mut polygons.positions[vertex as usize];
        *position = turn * *position + place.translation;
    }
    Ok(())
}

/// The pairs of a seam: its borders run along each other in the sense in which they are nearer.
fn pairs_of(polygons: &Polygons, seam: &SeamPair) -> Result<Vec<[u32; 2]>, MeshFileError> {
    let [a, b] = [&seam.a, &seam.b].map(|name| border(polygons, name));
    let (a, mut b) = (a?, b?);
    if a.len() != b.len() {
        let (one, other) = (a.len(), b.len());
        return Err(MeshFileError::Content {
            problem: format!(
                "seams: {:?} has {one} vertices and {:?} has {other}: give both borders as many",
                seam.a, seam.b
            ),
        });
    }
    let distance = |b: &[u32]| -> f64 {
        let places = a
            .iter()
            .zip(b)
            .map(|(&a, &b)| [a, b].map(|v| polygons.positions[v as usize]));
        places.map(|[p, q]| p.distance_squared(q)).sum()
    };
    let forward = distance(&b);
    b.reverse();
    if forward <= distance(&b) {
        b.reverse();
    }
    Ok(a.into_iter().zip(b).map(|(a, b)| [a, b]).collect())
}

/// The vertices of a label along the border of its panel, end to end.
fn border(polygons: &Polygons, name: &str) -> Result<Vec<u32>, MeshFileError> {
    let label = vertices(polygons, name, "seams")?;
    let mut counts: BTreeMap<[u32; 2], u32> = BTreeMap::new();
    for polygon in &polygons.polygons {
        for k in 0..polygon.corners.len() {
            let next = (k + 1) % polygon.corners.len();
            let [a, b] = [k, next].map(|k| polygon.corners[k].vertex);
            *counts.entry([a.min(b), a.max(b)]).or_default() += 1;
        }
    }
    let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for ([a, b], _) in counts.into_iter().filter(|(_, count)| *count == 1) {
        if label.contains(&a) && label.contains(&b) {
            next.entry(a).or_default().push(b);
            next.entry(b).or_default().push(a);
        }
    }
    let wrong = || MeshFileError::Border {
        name: name.to_owned(),
    };
    let end = next.iter().find(|(_, to)| to.len() == 1);
    let (&start, _) = end.ok_or_else(wrong)?;
    let mut line = vec![start];
    let mut before = None;
    let mut at = start;
    while let Some(&to) = next[&at].iter().find(|to| Some(**to) != before) {
        if line.len() > label.len() || next[&to].len() > 2 {
            return Err(wrong());
        }
        line.push(to);
        before = Some(at);
        at = to;
    }
    if line.len() == label.len() {
        Ok(line)
    } else {
        Err(wrong())
    }
}
