//! Sewing from flat: panels are placed in space, and pairs of their borders become one.
//!
//! The material coordinates are those of the flat pattern, taken before a panel is placed. The two
//! vertices of each pair meet half way. The panels as they were placed are kept: a fit begins with
//! them and pulls the seams together.

use std::collections::BTreeMap;

use glam::DVec3;
use selvedge_cloth::geometry;
use serde::{Deserialize, Serialize};

use super::border::Border;
use super::shape::planar_coordinates;
use super::weld::{drop_unnamed, merge, root, unite};
use super::{MeshFileError, Polygons};

/// Two borders that are sewn together, by the names of their objects or groups.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SeamPair {
    /// One border.
    pub a: String,
    /// The other border.
    pub b: String,
    /// Of two borders with different numbers of vertices, the coarser one is cut as the finer one
    /// is; they are refused otherwise.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub resample: bool,
}

/// Ratio of a seam's two lengths from which it is warned of: garments are eased by a tenth.
const EASED: f64 = 1.1;

/// Placement of a panel, by the name of its object or group: turned about the origin, then moved.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PanelPlace {
    /// Name of the panel.
    pub panel: String,
    /// Axis of the turn.
    #[serde(default = "crate::formats::up_axis::up")]
    pub axis: DVec3,
    /// Right-handed angle `[degrees]`.
    #[serde(default)]
    pub angle_deg: f64,
    /// Move `[m]`, in the file's unit of length.
    #[serde(default)]
    pub translation: DVec3,
}

/// Objects that are taken, places of panels, and seams that are sewn.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Sewing {
    /// Names of the objects and groups whose faces are taken; all faces where none is named.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub objects: Vec<String>,
    /// Placements of panels.
    pub panels: Vec<PanelPlace>,
    /// Seams, in the order in which they are sewn.
    pub seams: Vec<SeamPair>,
}

impl Sewing {
    /// Returns true when all faces are taken as they stand, and nothing is sewn.
    pub fn is_empty(&self) -> bool {
        self.objects.is_empty() && self.panels.is_empty() && self.seams.is_empty()
    }
}

/// Takes the objects, places the panels and sews the seams.
pub(crate) fn sew(polygons: &mut Polygons, sewing: &Sewing) -> Result<(), MeshFileError> {
    take(polygons, &sewing.objects)?;
    if sewing.panels.is_empty() && sewing.seams.is_empty() {
        return Ok(());
    }
    keep_flat(polygons)?;
    for place in &sewing.panels {
        put(polygons, place)?;
    }
    let mut pairs = Vec::new();
    let mut known: BTreeMap<Vec<[u32; 2]>, &SeamPair> = BTreeMap::new();
    for seam in &sewing.seams {
        let of_seam = pairs_of(polygons, seam)?;
        if let Some(first) = known.insert(sorted(&of_seam), seam) {
            return Err(sewn_twice(first, seam));
        }
        pairs.extend(of_seam);
    }
    if pairs.is_empty() {
        return Ok(());
    }
    polygons.loose.clone_from(&polygons.positions);
    for corner in polygons.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        corner.loose = Some(corner.vertex);
    }
    // What is sewn twice, as where three seams meet, becomes one vertex.
    let mut owners: Vec<u32> = (0..polygons.positions.len() as u32).collect();
    for [a, b] in pairs {
        unite(&mut owners, a, b);
    }
    let each = 0..owners.len() as u32;
    let owners: Vec<u32> = each.map(|v| root(&mut owners, v)).collect();
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

/// The pairs of a seam, whichever border is called the first.
fn sorted(pairs: &[[u32; 2]]) -> Vec<[u32; 2]> {
    let pairs = pairs.iter().map(|[a, b]| [*a.min(b), *a.max(b)]);
    let mut pairs: Vec<[u32; 2]> = pairs.collect();
    pairs.sort_unstable();
    pairs
}

fn sewn_twice(first: &SeamPair, second: &SeamPair) -> MeshFileError {
    let name = |seam: &SeamPair| format!("{:?} to {:?}", seam.a, seam.b);
    MeshFileError::content(format!(
        "seams: {} and {} are the same seam, named twice: leave one of them out, or name the borders that were meant",
        name(first),
        name(second)
    ))
}

/// Keeps the faces of these objects and groups, and their vertices; all where none is named.
fn take(polygons: &mut Polygons, objects: &[String]) -> Result<(), MeshFileError> {
    if objects.is_empty() {
        return Ok(());
    }
    for name in objects {
        polygons.label(name, "mesh.objects")?;
    }
    let parts = &polygons.parts;
    let is_taken: Vec<bool> = parts
        .iter()
        .map(|names| names.iter().any(|name| objects.contains(name)))
        .collect();
    polygons
        .polygons
        .retain(|polygon| is_taken.get(polygon.part).copied().unwrap_or(false));
    drop_unnamed(polygons);
    Ok(())
}

/// Gives a flat pattern without texture coordinates those of its plane, before it is placed.
fn keep_flat(polygons: &mut Polygons) -> Result<(), MeshFileError> {
    let mut corners = polygons.polygons.iter().flat_map(|p| &p.corners);
    if corners.any(|corner| corner.texture.is_some()) {
        return Ok(());
    }
    let problem = "seams need a pattern: texture coordinates, or panels that lie flat in one plane";
    let flat = planar_coordinates(polygons);
    polygons.texture = flat.ok_or_else(|| MeshFileError::content(problem))?;
    for corner in polygons.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        corner.texture = Some(corner.vertex as usize);
    }
    Ok(())
}

fn put(polygons: &mut Polygons, place: &PanelPlace) -> Result<(), MeshFileError> {
    let axis = place.axis.try_normalize();
    let axis = axis.filter(|_| place.angle_deg.is_finite() && place.translation.is_finite());
    let axis = axis.ok_or_else(|| {
        MeshFileError::content(format!(
            "mesh.panels: the place of {:?} needs an axis that is a direction, and finite numbers",
            place.panel
        ))
    })?;
    let turn = geometry::turn(axis, place.angle_deg.to_radians());
    for vertex in polygons.label(&place.panel, "mesh.panels")?.clone() {
        let position = &mut polygons.positions[vertex as usize];
        *position = turn * *position + place.translation;
    }
    Ok(())
}

/// The pairs of a seam: its borders run along each other in the sense in which they are nearer.
fn pairs_of(polygons: &mut Polygons, seam: &SeamPair) -> Result<Vec<[u32; 2]>, MeshFileError> {
    let (a, b) = (&seam.a, &seam.b);
    let content = |problem| Err(MeshFileError::Content(problem));
    if a == b {
        let problem = format!("seams: {a:?} is to be sewn to itself: name two borders");
        return content(problem);
    }
    let one = Border::named(polygons, a)?;
    let mut two = Border::named(polygons, b)?;
    if distance(polygons, &one, &two, true) < distance(polygons, &one, &two, false) {
        two.reverse();
    }
    warn_of_length(polygons, seam, [one.length, two.length]);
    let (first, second) = (one.line.len(), two.line.len());
    if first == second {
        return Ok(pairs(&one.line, &two.line));
    }
    if !seam.resample {
        return content(format!(
            "seams: {a:?} has {first} vertices and {b:?} has {second}: give both borders as many, or let the coarser one be cut as the finer one is with resample = true beside a and b"
        ));
    }
    let refined = if first < second {
        one.refined(&two, polygons)
            .map(|one| pairs(&one, &two.line))
    } else {
        two.refined(&one, polygons)
            .map(|two| pairs(&one.line, &two))
    };
    refined.ok_or_else(|| {
        MeshFileError::content(format!(
            "seams: {a:?} has {first} vertices and {b:?} has {second}: one is too much finer than the other to be resampled; mesh the panels alike"
        ))
    })
}

fn pairs(one: &[u32], two: &[u32]) -> Vec<[u32; 2]> {
    let pairs = one.iter().zip(two);
    pairs.map(|(&a, &b)| [a, b]).collect()
}

/// Sum of the squared distances between points of two borders, of the second the other way round
/// where `is_reversed` `[m²]`.
fn distance(polygons: &Polygons, one: &Border, two: &Border, is_reversed: bool) -> f64 {
    let samples = one.line.len().max(two.line.len());
    let at = |border: &Border, k: usize| {
        let last = border.line.len() - 1;
        let vertex = border.line[(k * last + (samples - 1) / 2) / (samples - 1)];
        polygons.positions[vertex as usize]
    };
    let pair = |k: usize| {
        let other = if is_reversed { samples - 1 - k } else { k };
        at(one, k).distance_squared(at(two, other))
    };
    (0..samples).map(pair).sum()
}

/// Warns of a seam whose two sides are so unlike in length that the cloth puckers or strains.
fn warn_of_length(polygons: &mut Polygons, seam: &SeamPair, lengths: [f64; 2]) {
    let [a, b] = lengths;
    let longer = a.max(b) / a.min(b);
    if longer > EASED {
        polygons.warnings.push(format!(
            "seams: {:?} is {a:.3} m long in the pattern and {:?} {b:.3} m: the longer one is gathered",
            seam.a, seam.b
        ));
    }
}
