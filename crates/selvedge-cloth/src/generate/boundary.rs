//! The boundary of a sheet: loops of straight sides, sampled at the spacing that gives a mesh a
//! number of vertices.

use glam::DVec2;

use crate::geometry::signed_area_2d;

/// Vertices per A/h² of an irregular mesh with mean edge length near h, away from the boundary.
const DENSITY: f64 = 1.07;

/// The sampled outline.
#[derive(Debug)]
pub(super) struct Boundary {
    /// Evenly spaced points, loop by loop.
    pub(super) points: Vec<DVec2>,
    /// The segments between neighbours.
    pub(super) segments: Vec<[usize; 2]>,
    /// The vertex at each corner of each loop, `[loops][corners]`.
    pub(super) corners: Vec<Vec<u32>>,
}

/// Area within the first loop and without the others.
pub(super) fn region_area(loops: &[Vec<DVec2>]) -> f64 {
    let areas = loops.iter().map(|l| polygon_area(l).abs());
    areas.reduce(|outer, hole| outer - hole).unwrap_or(0.0)
}

/// The target spacing of `count` vertices, at least one.
pub(super) fn spacing(area: f64, half_perimeter: f64, count: usize) -> f64 {
    let n = count as f64;
    let root = (half_perimeter * half_perimeter + 4.0 * DENSITY * area * n).sqrt();
    (half_perimeter + root) / (2.0 * n)
}

/// The target spacing, enlarged until the boundary needs no more than `count` vertices.
pub(super) fn fitting_spacing(loops: &[Vec<DVec2>], count: usize) -> f64 {
    let area = region_area(loops);
    let half_perimeter: f64 = loops
        .iter()
        .flat_map(|l| sides(l))
        .map(|s| s.0.distance(s.1))
        .sum::<f64>()
        / 2.0;
    let mut spacing = spacing(area, half_perimeter, count);
    while boundary_size(loops, spacing) > count {
        spacing *= 1.05;
    }
    spacing
}

fn boundary_size(loops: &[Vec<DVec2>], spacing: f64) -> usize {
    let all = loops.iter().flat_map(|l| sides(l));
    all.map(|(a, b)| segment_count(a, b, spacing)).sum()
}

fn segment_count(from: DVec2, to: DVec2, spacing: f64) -> usize {
    ((from.distance(to) / spacing).round() as usize).max(1)
}

fn sides(polygon: &[DVec2]) -> impl Iterator<Item = (DVec2, DVec2)> {
    let next = polygon.iter().cycle().skip(1);
    polygon.iter().copied().zip(next.copied())
}

pub(super) fn polygon_area(polygon: &[DVec2]) -> f64 {
    let fan = sides(polygon).map(|(a, b)| signed_area_2d(DVec2::ZERO, a, b));
    fan.sum()
}

pub(super) fn sample_boundary(loops: &[Vec<DVec2>], spacing: f64) -> Boundary {
    let mut boundary = Boundary {
        points: Vec::new(),
        segments: Vec::new(),
        corners: Vec::new(),
    };
    for polygon in loops {
        let first = boundary.points.len();
        let mut corners = Vec::with_capacity(polygon.len());
        for (from, to) in sides(polygon) {
            corners.push(boundary.points.len() as u32);
            let count = segment_count(from, to, spacing);
            for k in 0..count {
                // Exact on sides along an axis, where `lerp` would round.
                let along = (to - from) * (k as f64 / count as f64);
                boundary.points.push(from + along);
            }
        }
        let last = boundary.points.len() - 1;
        boundary.segments.extend((first..last).map(|k| [k, k + 1]));
        boundary.segments.push([last, first]);
        boundary.corners.push(corners);
    }
    boundary
}

/// Returns true when `point` is within the loops: a ray crosses them an odd number of times.
pub(super) fn is_within(loops: &[Vec<DVec2>], point: DVec2) -> bool {
    let crossings = loops.iter().flat_map(|l| sides(l)).filter(|(a, b)| {
        let spans = (a.y > point.y) != (b.y > point.y);
        spans && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossings.count() % 2 == 1
}
