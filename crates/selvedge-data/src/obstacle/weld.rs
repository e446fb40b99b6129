//! Mending of bodies: points that formats split along seams become one, where they stay together in
//! every frame; faces without area are left out.

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
    let mut is_used = vec![false; body.points.len()];
    for &corner in body.faces.as_flattened() {
        is_used[corner as usize] = true;
    }
    let mut numbers = Vec::with_capacity(is_used.len());
    let mut next = 0;
    for &used in &is_used {
        numbers.push(next);
        next += u32::from(used);
    }
    for corner in body.faces.as_flattened_mut() {
        *corner = numbers[*corner as usize];
    }
    keep(&mut body.points, &is_used);
    for frame in frames {
        keep(frame, &is_used);
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

fn keep(points: &mut Vec<DVec3>, is_used: &[bool]) {
    let mut used = is_used.iter();
    points.retain(|_| used.next().copied().unwrap_or_default());
}
