//! Mending of bodies: points that formats split along seams become one, where they stay together in
//! every frame; faces without area are left out.

use std::collections::BTreeSet;

use glam::DVec3;
use selvedge_cloth::bodies::Body;
use selvedge_cloth::geometry::is_without_area;

use crate::formats::extent::{COINCIDENT, extent};
use crate::formats::polygons::owners;

/// Welds points that coincide in the mesh and in every one of `frames`. Faces that lose a corner by
/// it are left out; so are points without a face.
pub(super) fn weld(body: &mut Body, frames: &mut [Vec<DVec3>]) {
    let tolerance = COINCIDENT * extent(&body.points);
    let mut owners = owners(&body.points, tolerance);
    for frame in frames.iter() {
        for point in 0..owners.len() {
            let owner = owners[point] as usize;
            // Ten times: a motion rounds once more.
            if frame[point].distance(frame[owner]) > 10.0 * tolerance {
                owners[point] = point as u32;
            }
        }
    }
    for corner in body.faces.as_flattened_mut() {
        *corner = owners[*corner as usize];
    }
    body.faces.retain(|[a, b, c]| a != b && b != c && c != a);
    let used: BTreeSet<u32> = body.faces.as_flattened().iter().copied().collect();
    let used: Vec<u32> = used.into_iter().collect();
    for corner in body.faces.as_flattened_mut() {
        *corner = used.partition_point(|&point| point < *corner) as u32;
    }
    for points in frames.iter_mut().chain([&mut body.points]) {
        *points = used.iter().map(|&point| points[point as usize]).collect();
    }
}

/// Leaves out the faces that have no area in the mesh or in the `first` frame: they bound nothing,
/// and the winding number of the body about no point changes. Where all have none they stay, for
/// the error that names them.
pub(super) fn drop_flat(body: &mut Body, first: Option<&[DVec3]>) {
    let has_area = |points: &[DVec3], face: [u32; 3]| {
        !is_without_area(face.map(|corner| points[corner as usize]))
    };
    let stays = |face: &[u32; 3]| {
        has_area(&body.points, *face) && first.is_none_or(|points| has_area(points, *face))
    };
    let kept: Vec<[u32; 3]> = body.faces.iter().copied().filter(stays).collect();
    if !kept.is_empty() {
        body.faces = kept;
    }
}
