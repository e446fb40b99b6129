//! A sheet from its outline: polygons of one outer loop and any holes in it.
//!
//! The target spacing h of a mesh of n vertices over area A and perimeter P is the root of
//! n = 1.07 A/h² + P/(2h): a triangular lattice has 2/√3 A/h² vertices of spacing h, a relaxed
//! irregular mesh about 7 % fewer, and half a row more along the boundary. Each side of the outline
//! gets as many equal segments as fit best; the rest of the vertices lie inside.

use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

use super::relax::{relaxed, triangulate};
use super::scatter::scatter;
use super::{GenerateError, MOST_VERTICES};
use crate::geometry::signed_area_2d;

/// Vertices per A/h² of an irregular mesh with mean edge length near h, away from the boundary.
const DENSITY: f64 = 1.07;
/// Least area of a region, as a share of the rectangle around it: random points fall into it as
/// often.
const LEAST_SHARE: f64 = 1e-4;

/// A flat triangulation.
#[derive(Debug)]
pub(super) struct FlatSheet {
    /// The boundary, loop by loop and in the order of the outline, then the inside, row by row,
    /// `[vertices]`.
    pub(super) points: Vec<DVec2>,
    /// Counter-clockwise, `[faces, 3]`.
    pub(super) faces: Vec<[u32; 3]>,
    /// The vertex at each corner of each loop, `[loops][corners]`.
    pub(super) corners: Vec<Vec<u32>>,
    /// How many of the vertices are on the boundary; they come first.
    pub(super) boundary_count: usize,
}

/// The sampled outline.
#[derive(Debug)]
pub(super) struct Boundary {
    /// Evenly spaced points, loop by loop.
    pub(super) points: Vec<DVec2>,
    /// The segments between neighbours.
    pub(super) segments: Vec<[usize; 2]>,
    corners: Vec<Vec<u32>>,
}

/// Covers the region within `loops` (the first outermost, the others holes in it; either
/// direction) with exactly `count` vertices.
///
/// # Errors
/// [`GenerateError::TooFewVertices`] when the corners alone are more than `count`, or
/// [`GenerateError::TooManyVertices`]; [`GenerateError::Area`] when the region is (nearly) a line;
/// [`GenerateError::Triangulation`] when the outline crosses itself.
pub(super) fn sheet_from_outline(
    loops: &[Vec<DVec2>],
    count: usize,
    seed: u64,
) -> Result<FlatSheet, GenerateError> {
    let needed = loops.iter().map(Vec::len).sum();
    if count > MOST_VERTICES {
        return Err(GenerateError::TooManyVertices { found: count });
    }
    if count < needed {
        return Err(GenerateError::TooFewVertices {
            found: count,
            needed,
        });
    }
    check_area(loops)?;
    let spacing = fitting_spacing(loops, count);
    let boundary = sample_boundary(loops, spacing);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let inside = scatter(
        loops,
        &boundary,
        count - boundary.points.len(),
        spacing,
        &mut rng,
    );
    let mut points = relaxed(loops, &boundary, inside, &mut rng)?;
    let boundary_count = boundary.points.len();
    // Rows from top to bottom: neighbours in space are near in memory.
    points[boundary_count..].sort_by(|a, b| {
        let row = |p: &DVec2| (p.y / spacing).floor();
        row(b).total_cmp(&row(a)).then(a.x.total_cmp(&b.x))
    });
    let faces = triangulate(&points, &boundary.segments)?;
    Ok(FlatSheet {
        points,
        faces,
        corners: boundary.corners,
        boundary_count,
    })
}

/// That points thrown into the rectangle around the region hit it; false for NaN too.
fn check_area(loops: &[Vec<DVec2>]) -> Result<(), GenerateError> {
    let corners = || loops.iter().flatten().copied();
    let low = corners().fold(DVec2::INFINITY, DVec2::min);
    let high = corners().fold(DVec2::NEG_INFINITY, DVec2::max);
    let around = (high - low).element_product();
    let area = region_area(loops);
    if area.is_finite() && area > LEAST_SHARE * around {
        return Ok(());
    }
    Err(GenerateError::Area { area, around })
}

/// Area within the first loop and without the others.
fn region_area(loops: &[Vec<DVec2>]) -> f64 {
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
fn fitting_spacing(loops: &[Vec<DVec2>], count: usize) -> f64 {
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

fn polygon_area(polygon: &[DVec2]) -> f64 {
    let fan = sides(polygon).map(|(a, b)| signed_area_2d(DVec2::ZERO, a, b));
    fan.sum()
}

fn sample_boundary(loops: &[Vec<DVec2>], spacing: f64) -> Boundary {
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

/// Whether `point` is within the loops: a ray crosses them an odd number of times.
pub(super) fn is_within(loops: &[Vec<DVec2>], point: DVec2) -> bool {
    let crossings = loops.iter().flat_map(|l| sides(l)).filter(|(a, b)| {
        let spans = (a.y > point.y) != (b.y > point.y);
        spans && point.x < a.x + (point.y - a.y) / (b.y - a.y) * (b.x - a.x)
    });
    crossings.count() % 2 == 1
}
