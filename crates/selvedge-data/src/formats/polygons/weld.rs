//! Welding by position: vertices that are nearer to each other than a tolerance become one, with
//! their texture coordinates apart, as the two sides of a seam are.

use std::collections::{BTreeMap, HashMap};

use glam::DVec3;
use selvedge_cloth::geometry::is_without_area;

use super::clean::{drop_collapsed, renumber};
use super::error::MeshFileError;
use super::soup::{Polygon, Polygons};

/// Welds vertices up to `tolerance` apart. The first of them stays; the order of the others does
/// not change.
pub(super) fn weld(polygons: &mut Polygons, tolerance: f64) -> Result<(), MeshFileError> {
    if !(tolerance.is_finite() && tolerance >= 0.0) {
        let problem = "mesh.weld must be finite and not negative, found";
        return Err(MeshFileError::content(format!("{problem} {tolerance}")));
    }
    let owners = owners(&polygons.positions, tolerance);
    let welded = (0_u32..)
        .zip(&owners)
        .filter(|(v, owner)| v != *owner)
        .count();
    if welded == 0 {
        return Ok(());
    }
    let before: Vec<Vec<u32>> = polygons.polygons.iter().map(vertices_of).collect();
    drop_alike(polygons, &owners, &before);
    merge(polygons, &owners);
    Ok(())
}

/// The vertices of a polygon, in ascending order.
fn vertices_of(polygon: &Polygon) -> Vec<u32> {
    let mut vertices: Vec<u32> = polygon.corners.iter().map(|c| c.vertex).collect();
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn positions_far_out_are_in_the_outermost_cells() {
        let far = [1e300, -1e300, 1e300, 0.0].map(DVec3::splat);
        assert_eq!(owners(&far, 1e-6), [0, 1, 0, 3]);
    }
}
