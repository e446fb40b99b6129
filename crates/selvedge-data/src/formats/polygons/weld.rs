//! Welding by position: vertices that are nearer to each other than a tolerance become one, with
//! their texture coordinates apart, as the two sides of a seam are. And mending what has no say in
//! the shape: corners that repeat after welding, and vertices without a face.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;
use selvedge_cloth::geometry::is_without_area;

use super::{MeshFileError, Polygon, Polygons};

/// Welds vertices up to `tolerance` apart. The first of them stays; the order of the others does
/// not change.
pub(super) fn weld(polygons: &mut Polygons, tolerance: f64) -> Result<(), MeshFileError> {
    if !(tolerance.is_finite() && tolerance >= 0.0) {
        let problem = "mesh.weld must be finite and not negative, found";
        return Err(MeshFileError::content(format!("{problem} {tolerance}")));
    }
    let owners = owners(&polygons.positions, tolerance);
    if owners.iter().zip(0..).all(|(owner, v)| *owner == v) {
        return Ok(());
    }
    let before: Vec<Vec<u32>> = polygons.polygons.iter().map(vertices_of).collect();
    drop_alike(polygons, &owners, &before);
    merge(polygons, &owners);
    Ok(())
}

/// The vertices of a polygon, in ascending order.
fn vertices_of(polygon: &Polygon) -> Vec<u32> {
    let mut vertices: Vec<u32> = polygon.vertices().collect();
    vertices.sort_unstable();
    vertices
}

/// Leaves out polygons that the weld makes one with an earlier one, which they are not `before` it,
/// and triangles that lose their area by it.
fn drop_alike(polygons: &mut Polygons, owners: &[u32], before: &[Vec<u32>]) {
    let mut known: HashMap<Vec<u32>, usize> = HashMap::new();
    let is_flat = |corners: &[u32]| match *corners {
        [a, b, c] => is_without_area([a, b, c].map(|v| polygons.positions[v as usize])),
        _ => false,
    };
    let mut dropped = Vec::new();
    for (number, own) in before.iter().enumerate() {
        let mut after: Vec<u32> = own.iter().map(|&v| owners[v as usize]).collect();
        after.sort_unstable();
        let is_whole = after.windows(2).all(|pair| pair[0] != pair[1]);
        let is_flat = is_whole && is_flat(&after) && !is_flat(own);
        let first = *known.entry(after).or_insert(number);
        if is_flat || is_whole && before[first] != *own {
            dropped.push(number);
        }
    }
    let Some(&first) = dropped.first() else {
        return;
    };
    polygons.warnings.push(format!(
        "{} faces become one with another, or lose their area, where vertices are welded and are left out, the first at {}",
        dropped.len(),
        polygons.polygons[first].place
    ));
    let mut number = 0;
    polygons.polygons.retain(|_| {
        number += 1;
        dropped.binary_search(&(number - 1)).is_err()
    });
}

/// Makes every vertex one with its owner, the first of those that are one.
pub(super) fn merge(polygons: &mut Polygons, owners: &[u32]) {
    let owners: Vec<Option<u32>> = owners.iter().copied().map(Some).collect();
    renumber(polygons, &owners);
    drop_collapsed(polygons);
}

/// The first of the set of `one`, by the members' owners, which get nearer to it.
pub(super) fn root(owners: &mut [u32], mut one: u32) -> u32 {
    while owners[one as usize] != one {
        owners[one as usize] = owners[owners[one as usize] as usize];
        one = owners[one as usize];
    }
    one
}

/// Makes the sets of two one.
pub(super) fn unite(owners: &mut [u32], one: u32, two: u32) {
    let (one, two) = (root(owners, one), root(owners, two));
    owners[one.max(two) as usize] = one.min(two);
}

/// The first vertex within `tolerance` of each one, by cells of a grid.
pub(crate) fn owners(positions: &[DVec3], tolerance: f64) -> Vec<u32> {
    let size = if tolerance > 0.0 { tolerance } else { 1e-12 };
    let cell = |p: DVec3| (p / size).floor().to_array().map(|x| x as i64);
    let mut cells: BTreeMap<[i64; 3], Vec<u32>> = BTreeMap::new();
    let mut owners = Vec::with_capacity(positions.len());
    for (vertex, &position) in (0_u32..).zip(positions) {
        let [x, y, z] = cell(position);
        let around =
            (-1..=1).flat_map(|i| (-1..=1).flat_map(move |j| (-1..=1).map(move |k| [i, j, k])));
        let near = around
            .filter_map(|[i, j, k]| {
                // Positions far out are all in the outermost cells.
                let neighbour = [
                    x.saturating_add(i),
                    y.saturating_add(j),
                    z.saturating_add(k),
                ];
                cells.get(&neighbour)
            })
            .flatten()
            .copied()
            .filter(|&other| positions[other as usize].distance(position) <= tolerance)
            .min();
        owners.push(near.unwrap_or(vertex));
        if near.is_none() {
            cells.entry([x, y, z]).or_default().push(vertex);
        }
    }
    owners
}

/// Checks that no face names a vertex twice: it would have no area, whatever else is wrong.
pub(super) fn check_corners(polygons: &Polygons) -> Result<(), MeshFileError> {
    for polygon in &polygons.polygons {
        let vertices = vertices_of(polygon);
        if let Some(pair) = vertices.windows(2).find(|pair| pair[0] == pair[1]) {
            return Err(polygons.no_sheet(format!(
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_far_out_are_in_the_outermost_cells() {
        let far = [1e300, -1e300, 1e300, 0.0].map(DVec3::splat);
        assert_eq!(owners(&far, 1e-6), [0, 1, 0, 3]);
    }
}
