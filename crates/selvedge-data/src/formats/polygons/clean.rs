//! Mending what has no say in the shape: corners that repeat after welding, and vertices without a
//! face.

use super::error::MeshFileError;
use super::soup::{Polygon, Polygons};

/// Checks that no face names a vertex twice: it would have no area, whatever else is wrong.
pub(super) fn check_corners(polygons: &Polygons) -> Result<(), MeshFileError> {
    for polygon in &polygons.polygons {
        let mut vertices: Vec<u32> = polygon.corners.iter().map(|c| c.vertex).collect();
        vertices.sort_unstable();
        if let Some(pair) = vertices.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(MeshFileError::Faces(format!(
                "{}: this face names vertex {} twice: remove it, or mend its corners",
                polygon.place,
                polygons.number(pair[0])
            )));
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
    let used = used(polygons);
    let Some(first) = used.iter().position(Option::is_none) else {
        return;
    };
    let unused = used.iter().filter(|used| used.is_none()).count();
    polygons.warnings.push(format!(
        "{unused} vertices belong to no face and are left out, the first is {}: handles chosen by number count the vertices that remain",
        polygons.number(first as u32)
    ));
    renumber(polygons, &used);
}

/// Leaves out vertices without a face, and names without a vertex: those of objects that were not
/// chosen, which nobody misses.
pub(super) fn drop_unnamed(polygons: &mut Polygons) {
    renumber(polygons, &used(polygons));
    polygons.labels.retain(|_, vertices| !vertices.is_empty());
}

/// The vertices that faces have, each its own owner.
fn used(polygons: &Polygons) -> Vec<Option<u32>> {
    let mut used = vec![None; polygons.positions.len()];
    for corner in polygons.polygons.iter().flat_map(|p| &p.corners) {
        used[corner.vertex as usize] = Some(corner.vertex);
    }
    used
}

/// Lets every vertex be the one that `owners` names for it, `[vertices]`. Those that are not their
/// own are left out; those after them move up.
pub(super) fn renumber(polygons: &mut Polygons, owners: &[Option<u32>]) {
    let (kept, _): (Vec<u32>, Vec<u32>) =
        (0..owners.len() as u32).partition(|&v| owners[v as usize] == Some(v));
    let number = |v: u32| {
        let owner = owners[v as usize]?;
        kept.binary_search(&owner).ok().map(|place| place as u32)
    };
    for corner in polygons.polygons.iter_mut().flat_map(|p| &mut p.corners) {
        corner.vertex = number(corner.vertex).unwrap_or_default();
    }
    for label in polygons.labels.values_mut() {
        *label = label.iter().filter_map(|&v| number(v)).collect();
    }
    let angles = std::mem::take(&mut polygons.angles).into_iter();
    let angles = angles.filter_map(|([a, b], angle)| {
        let [a, b] = [number(a)?, number(b)?];
        Some(([a.min(b), a.max(b)], angle))
    });
    polygons.angles = angles.collect();
    let velocities = std::mem::take(&mut polygons.velocities).into_iter();
    let velocities = velocities.filter_map(|(v, velocity)| {
        let place = kept.binary_search(&v).ok()?;
        Some((place as u32, velocity))
    });
    polygons.velocities = velocities.collect();
    polygons.numbers = kept.iter().map(|&v| polygons.number(v)).collect();
    let positions = kept.iter().map(|&v| polygons.positions[v as usize]);
    polygons.positions = positions.collect();
}
