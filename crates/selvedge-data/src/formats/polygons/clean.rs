//! Mending what has no say in the shape: corners that repeat after welding, and vertices without a
//! face.

use std::collections::BTreeMap;

use super::error::MeshFileError;
use super::soup::{Polygon, Polygons};

/// Checks that no face names a vertex twice: it would have no area, whatever else is wrong.
pub(super) fn check_corners(polygons: &Polygons) -> Result<(), MeshFileError> {
    for polygon in &polygons.polygons {
        let mut vertices: Vec<u32> = polygon.corners.iter().map(|c| c.vertex).collect();
        vertices.sort_unstable();
        if let Some(pair) = vertices.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(MeshFileError::RepeatedVertex {
                place: polygon.place,
                vertex: polygons.number(pair[0]),
            });
        }
    }
    Ok(())
}

/// Leaves out corners that welding made equal to the one before, and faces of which fewer than
/// three remain.
pub(super) fn drop_collapsed(polygons: &mut Polygons) {
    let mut places = Vec::new();
    polygons.polygons.retain_mut(|polygon| {
        let Polygon { place, corners, .. } = polygon;
        corners.dedup_by_key(|corner| corner.vertex);
        while corners.len() > 1 && corners[0].vertex == corners[corners.len() - 1].vertex {
            corners.pop();
        }
        let remains = corners.len() >= 3;
        if !remains {
            places.push(*place);
        }
        remains
    });
    if let Some(first) = places.first() {
        polygons.warnings.push(format!(
            "{} faces collapse where vertices are welded and are left out, the first at {first}",
            places.len()
        ));
    }
}

/// Leaves out vertices without a face; those after them move up.
pub(super) fn drop_unused(polygons: &mut Polygons) {
    let is_used = used(polygons);
    let Some(first) = is_used.iter().position(|used| !used) else {
        return;
    };
    let unused = is_used.iter().filter(|used| !**used).count();
    polygons.warnings.push(format!(
        "{unused} vertices belong to no face and are left out, the first is {}: handles chosen by number count the vertices that remain",
        polygons.number(first as u32)
    ));
    keep(polygons, &is_used);
}

/// Leaves out vertices without a face, and names without a vertex: those of objects that were not
/// chosen, which nobody misses.
pub(super) fn drop_unnamed(polygons: &mut Polygons) {
    let is_used = used(polygons);
    keep(polygons, &is_used);
    polygons.labels.retain(|_, vertices| !vertices.is_empty());
}

/// True for every vertex that a face has.
fn used(polygons: &Polygons) -> Vec<bool> {
    let mut is_used = vec![false; polygons.positions.len()];
    for corner in polygons.polygons.iter().flat_map(|p| &p.corners) {
        is_used[corner.vertex as usize] = true;
    }
    is_used
}

/// Leaves out the other vertices; those after them move up.
fn keep(polygons: &mut Polygons, is_used: &[bool]) {
    let count = polygons.positions.len();
    let mut next = 0;
    let renumbered: Vec<u32> = is_used
        .iter()
        .map(|&used| {
            let number = next;
            next += u32::from(used);
            number
        })
        .collect();
    let kept = |vertex: &u32| is_used[*vertex as usize].then(|| renumbered[*vertex as usize]);
    for corner in polygons.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        corner.vertex = renumbered[corner.vertex as usize];
    }
    for label in polygons.labels.values_mut() {
        *label = label.iter().filter_map(kept).collect();
    }
    polygons.numbers = (0..count as u32)
        .filter(|v| is_used[*v as usize])
        .map(|v| polygons.number(v))
        .collect();
    let velocities = std::mem::take(&mut polygons.velocities);
    let velocities = velocities
        .into_iter()
        .filter_map(|(v, velocity)| Some((kept(&v)?, velocity)));
    polygons.velocities = velocities.collect::<BTreeMap<_, _>>();
    let angles = std::mem::take(&mut polygons.angles).into_iter();
    let angles = angles.filter_map(|([a, b], angle)| Some(([kept(&a)?, kept(&b)?], angle)));
    polygons.angles = angles.collect();
    let mut vertex = 0;
    polygons.positions.retain(|_| {
        vertex += 1;
        is_used[vertex - 1]
    });
}
