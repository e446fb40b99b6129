//! A sheet from its outline: polygons of one outer loop and any holes in it.
//!
//! The target spacing h of a mesh of n vertices over area A and perimeter P is the root of
//! n = 1.07 A/h² + P/(2h): a triangular lattice has 2/√3 A/h² vertices of spacing h, a relaxed
//! irregular mesh about 7 % fewer, and half a row more along the boundary. Each side of the outline
//! gets as many equal segments as fit best; the rest of the vertices lie inside.

use super::boundary::{fitting_spacing, region_area, sample_boundary};
use super::relax::{relaxed, triangulate};
use super::scatter::scatter;
use super::shapes::Cut;
use crate::error::SceneError;
use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;

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
    /// Number of vertices on the boundary; they come first.
    pub(super) boundary_count: usize,
}

/// Covers the region within the loops of a cut (the first outermost, the others holes in it; either
/// direction) with exactly `count` vertices, some of which are the points of the ridge within it.
///
/// # Errors
/// More corners than `count`, a region that is (nearly) a line, an outline that
/// crosses itself.
pub(super) fn sheet_from_outline(
    cut: &Cut,
    count: usize,
    seed: u64,
) -> Result<FlatSheet, SceneError> {
    let needed = cut.loops.iter().map(Vec::len).sum::<usize>() + cut.ridge.len();
    if count < needed {
        return Err(too_few(count, needed));
    }
    check_area(&cut.loops)?;
    let spacing = fitting_spacing(&cut.loops, count);
    let mut boundary = sample_boundary(&cut.loops, spacing * cut.spacing[1]);
    let boundary_count = boundary.points.len();
    boundary.points.extend(&cut.ridge);
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let count = count - boundary.points.len();
    let inside = scatter(cut, &boundary, count, spacing, &mut rng);
    let mut points = relaxed(cut, &boundary, inside, &mut rng)?;
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

/// Checks that random points in the rectangle around the region hit it; NaN fails too.
fn check_area(loops: &[Vec<DVec2>]) -> Result<(), SceneError> {
    let corners = || loops.iter().flatten().copied();
    let low = corners().fold(DVec2::INFINITY, DVec2::min);
    let high = corners().fold(DVec2::NEG_INFINITY, DVec2::max);
    let around = (high - low).element_product();
    let area = region_area(loops);
    if area.is_finite() && area > LEAST_SHARE * around {
        return Ok(());
    }
    Err(SceneError(format!(
        "the outline encloses {area} m² of the {around} m² around it, too little to place vertices in: give it width, and sides that do not cross"
    )))
}

pub(super) fn too_few(found: usize, needed: usize) -> SceneError {
    SceneError(format!(
        "a sheet of this shape needs at least {needed} vertices, found {found}"
    ))
}
