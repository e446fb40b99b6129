//! Random points that keep apart ("blue noise"), by throwing darts: a dart nearer than r to a point
//! is thrown away, and r shrinks when darts no longer stick, until there are as many as asked for.

use glam::DVec2;
use rand_chacha::ChaCha8Rng;

use super::boundary::{Boundary, is_within};
use super::shapes::Cut;
use crate::geometry::unit;

/// First distance between points, in spacings. Darts jam at 0.81: this needs few throws.
const FIRST_DISTANCE: f64 = 0.75;
/// Darts in a row that may fail, per point wanted (and at least a hundred), before r shrinks.
const PATIENCE: usize = 2;
/// Width of a cell, in spacings: at least the first distance where a graded mesh is coarsest.
const CELL: f64 = 1.1;

/// `count` points within a cut, apart from each other and from the boundary.
pub(super) fn scatter(
    cut: &Cut,
    boundary: &Boundary,
    count: usize,
    spacing: f64,
    rng: &mut ChaCha8Rng,
) -> Vec<DVec2> {
    let mut cells = Cells::new(&boundary.points, CELL * spacing);
    let mut points = Vec::with_capacity(count);
    let patience = (PATIENCE * count).max(100);
    let (mut distance, mut failures) = (FIRST_DISTANCE * spacing, 0);
    while points.len() < count {
        let dart = cells.low + DVec2::new(unit(rng), unit(rng)) * cells.extent;
        if is_within(&cut.loops, dart) && cells.is_free(dart, distance * cut.part(dart)) {
            cells.insert(dart);
            points.push(dart);
            failures = 0;
        } else {
            failures += 1;
        }
        if failures > patience {
            distance *= 0.95;
            failures = 0;
        }
    }
    points
}

/// Points in square cells.
struct Cells {
    low: DVec2,
    extent: DVec2,
    width: f64,
    columns: usize,
    rows: usize,
    cells: Vec<Vec<DVec2>>,
}

impl Cells {
    fn new(points: &[DVec2], width: f64) -> Self {
        let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
        let high = points.iter().copied().fold(DVec2::NEG_INFINITY, DVec2::max);
        let size = |extent: f64| (extent / width) as usize + 1;
        let (columns, rows) = (size(high.x - low.x), size(high.y - low.y));
        let mut cells = Self {
            low,
            extent: high - low,
            width,
            columns,
            rows,
            cells: vec![Vec::new(); columns * rows],
        };
        for &point in points {
            cells.insert(point);
        }
        cells
    }

    fn place(&self, point: DVec2) -> (usize, usize) {
        let at = (point - self.low) / self.width;
        let column = (at.x as usize).min(self.columns - 1);
        (column, (at.y as usize).min(self.rows - 1))
    }

    fn insert(&mut self, point: DVec2) {
        let (column, row) = self.place(point);
        self.cells[row * self.columns + column].push(point);
    }

    /// Returns true when no point is nearer than `distance`, which is at most the width of a
    /// cell.
    fn is_free(&self, point: DVec2, distance: f64) -> bool {
        let (column, row) = self.place(point);
        let rows = row.saturating_sub(1)..(row + 2).min(self.rows);
        let columns = column.saturating_sub(1)..(column + 2).min(self.columns);
        let near = rows.flat_map(|r| columns.clone().map(move |c| r * self.columns + c));
        near.flat_map(|cell| &self.cells[cell])
            .all(|other| other.distance_squared(point) >= distance * distance)
    }
}
