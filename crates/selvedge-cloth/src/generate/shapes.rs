//! The shapes that sheets are cut in: their outlines for size 1, and what their labels mean.
//!
//! An outline starts at the upper left and runs clockwise, seen with the material axes u to the
//! right and v up. Corners may lie within a straight side, where a handle is to be. Circles are
//! polygons with as many sides as the boundary has segments; their corners come from the Taylor
//! series of one small angle, so that they are the same on every machine.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use glam::DVec2;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::{Rng, SeedableRng};
use serde::{Deserialize, Serialize};

use super::boundary::{polygon_area, spacing};
use crate::geometry::unit;

/// The shape of a sheet. Lengths are in units of its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// 1 × 1.
    Square,
    /// As wide as it is said to be, and 1 high.
    Rectangle,
    /// A rectangle rolled about the vertical, its sides sewn together.
    Tube,
    /// 1 wide and 1.5 high.
    Long,
    /// 1.5 wide and 1 high; a vertex in the middle of the upper edge.
    Wide,
    /// An upper edge of 1 with 17 evenly spaced vertices for handles, the third corner 1 below
    /// its middle.
    Triangle,
    /// A square on its corner, both diagonals 1.
    Diamond,
    /// A disc of diameter 1.
    Disc,
    /// The disc of the drape test: of diameter 1, with a ring of vertices at 0.3 from its middle,
    /// where the clamp ends. Outside of it, up to 0.383, edges are 1/60 long, or half as long as elsewhere.
    DrapeDisc,
    /// 1 × 1 without its lower right quarter.
    LShape,
    /// 1 × 1 with a round hole of diameter 0.4 in its middle.
    Holed,
    /// A polygon of area 0.7 with five to eight corners, each at its own distance from the middle,
    /// which the seed decides.
    Random,
}

/// Handles along the upper edge of a triangle.
const TRIANGLE_HANDLES: usize = 17;
const HOLE_RADIUS: f64 = 0.2;
/// 90 mm of a sheet of 150 mm radius.
const CLAMP_RADIUS: f64 = 0.3;
/// Folds begin beside the clamp. In a band of 25 mm outside of it edges are 5 mm long, or half as long
/// as elsewhere (a target spacing is a twentieth less); beyond it and within the clamp they grow over
/// 15 mm.
const CLAMP_SPACING: f64 = 0.016;
const CLAMP_BAND: f64 = 1.0 / 12.0;
const CLAMP_SLOPE: f64 = 0.05;
const RANDOM_AREA: f64 = 0.7;
/// Directions between two corners of a random shape, from which a corner is at most
/// [`RANDOM_SWAY`] away.
const RANDOM_DIRECTIONS: usize = 16;
const RANDOM_SWAY: usize = 3;
/// Smallest distance of a corner from the middle, in parts of the largest.
const RANDOM_NEAREST: f64 = 0.65;

/// Vertices of the outer loop.
#[derive(Clone, Debug)]
pub(super) enum Label {
    /// Corners, by number.
    Corners(Vec<usize>),
    /// Everything on the way from one corner on to another, both included.
    Run(usize, usize),
    /// The ridge, and all vertices that it encloses.
    WithinRidge,
}

type Labels = Vec<(&'static str, Label)>;

/// An outline for size 1, within 0..`extent`.
#[derive(Clone, Debug)]
pub(super) struct Cut {
    /// The outer loop, then holes.
    pub(super) loops: Vec<Vec<DVec2>>,
    /// Vertices that lie where they are, within the outline: a convex loop, or none.
    pub(super) ridge: Vec<DVec2>,
    /// Spacing of vertices beside the clamp of the drape disc and elsewhere, over that of an even mesh.
    pub(super) spacing: [f64; 2],
    pub(super) labels: Labels,
    pub(super) extent: DVec2,
}

impl Shape {
    /// Area of a sheet of size 1, and of width 1 where that is said.
    pub fn unit_area(self) -> f64 {
        match self {
            Self::Square | Self::Rectangle | Self::Tube => 1.0,
            Self::Long | Self::Wide => 1.5,
            Self::Triangle | Self::Diamond => 0.5,
            Self::Disc | Self::DrapeDisc => PI / 4.0,
            Self::LShape => 0.75,
            Self::Holed => 1.0 - PI * HOLE_RADIUS * HOLE_RADIUS,
            Self::Random => RANDOM_AREA,
        }
    }

    /// The outline, for a mesh of `count` vertices; `width` is that of a rectangle, and `seed`
    /// decides a random shape.
    pub(super) fn cut(self, width: f64, count: usize, seed: u64) -> Cut {
        match self {
            Self::Square => rectangle(1.0, 1.0),
            Self::Rectangle | Self::Tube => rectangle(width, 1.0),
            Self::Long => rectangle(1.0, 1.5),
            Self::Wide => wide(),
            Self::Triangle => triangle(),
            Self::Diamond => diamond(),
            Self::Disc => disc(count, 1.0),
            Self::DrapeDisc => drape_disc(count),
            Self::LShape => l_shape(),
            Self::Holed => holed(count),
            Self::Random => random(seed),
        }
    }
}

fn rectangle(width: f64, height: f64) -> Cut {
    let corners = [(0.0, height), (width, height), (width, 0.0), (0.0, 0.0)];
    let labels = vec![
        ("upper-corners", Label::Corners(vec![0, 1])),
        ("lower-corners", Label::Corners(vec![3, 2])),
        ("upper-edge", Label::Run(0, 1)),
    ];
    Cut::of(polygon(&corners), DVec2::new(width, height), labels)
}

fn wide() -> Cut {
    let corners = [(0.0, 1.0), (0.75, 1.0), (1.5, 1.0), (1.5, 0.0), (0.0, 0.0)];
    let labels = vec![
        ("upper-corners", Label::Corners(vec![0, 2])),
        ("upper-three", Label::Corners(vec![0, 1, 2])),
        ("lower-corners", Label::Corners(vec![4, 3])),
        ("upper-edge", Label::Run(0, 2)),
    ];
    Cut::of(polygon(&corners), DVec2::new(1.5, 1.0), labels)
}

fn triangle() -> Cut {
    let last = TRIANGLE_HANDLES - 1;
    // Sixteenths are exact.
    let mut corners: Vec<(f64, f64)> = (0..=last).map(|k| (k as f64 / last as f64, 1.0)).collect();
    corners.push((0.5, 0.0));
    let labels = vec![
        ("upper-corners", Label::Corners(vec![0, last])),
        ("upper-row", Label::Corners((0..=last).collect())),
        ("upper-edge", Label::Run(0, last)),
    ];
    Cut::of(polygon(&corners), DVec2::ONE, labels)
}

fn diamond() -> Cut {
    let corners = [(0.0, 0.5), (0.5, 1.0), (1.0, 0.5), (0.5, 0.0)];
    let labels = vec![
        ("upper-corners", Label::Corners(vec![0, 2])),
        ("upper-three", Label::Corners(vec![0, 1, 2])),
    ];
    Cut::of(polygon(&corners), DVec2::ONE, labels)
}

fn l_shape() -> Cut {
    let corners = [
        (0.0, 1.0),
        (1.0, 1.0),
        (1.0, 0.5),
        (0.5, 0.5),
        (0.5, 0.0),
        (0.0, 0.0),
    ];
    let mut cut = rectangle(1.0, 1.0);
    cut.loops = vec![polygon(&corners)];
    cut.labels.retain(|(name, _)| *name != "lower-corners");
    cut
}

fn disc(count: usize, far: f64) -> Cut {
    let radius = 0.5;
    let sides = circle_sides(radius / far, Shape::Disc.unit_area(), PI * radius, count);
    // The circle starts at its upper left, an eighth of a turn before its top.
    let labels = vec![
        ("upper-corners", Label::Corners(vec![0, sides / 4])),
        ("upper-three", Label::Corners(vec![0, sides / 8, sides / 4])),
    ];
    let outline = circle(DVec2::splat(0.5), radius, sides);
    Cut::of(outline, DVec2::ONE, labels)
}

fn drape_disc(count: usize) -> Cut {
    let area = Shape::Disc.unit_area();
    let near = (CLAMP_SPACING / spacing(area, PI / 2.0, count.max(1))).clamp(0.7, 1.0);
    // As many vertices as of an even disc, as if 0.32 of this one were beside the clamp.
    let far = near * (0.68 / (near * near - 0.32)).sqrt();
    let mut cut = disc(count, far);
    cut.spacing = [near, far];
    let sides = circle_sides(CLAMP_RADIUS / near, area, PI / 2.0, count);
    cut.ridge = circle(DVec2::splat(0.5), CLAMP_RADIUS, sides);
    cut.labels.push(("clamped", Label::WithinRidge));
    cut
}

fn holed(count: usize) -> Cut {
    let mut cut = rectangle(1.0, 1.0);
    let half_perimeter = 2.0 + PI * HOLE_RADIUS;
    let area = Shape::Holed.unit_area();
    let sides = circle_sides(HOLE_RADIUS, area, half_perimeter, count);
    let hole = circle(DVec2::splat(0.5), HOLE_RADIUS, sides);
    cut.loops.push(hole);
    cut
}

/// A polygon that its middle sees all of; the first corner at its upper left.
fn random(seed: u64) -> Cut {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    // Stream 0 of the seed places the inner vertices.
    rng.set_stream(1);
    let corners = 5 + (rng.next_u32() % 4) as usize;
    let directions = circle(DVec2::ZERO, 1.0, RANDOM_DIRECTIONS * corners);
    let all = directions.len();
    let points: Vec<DVec2> = (0..corners)
        .map(|corner| {
            let sway = rng.next_u32() as usize % (2 * RANDOM_SWAY + 1);
            let direction = (all + RANDOM_DIRECTIONS * corner + sway - RANDOM_SWAY) % all;
            let distance = RANDOM_NEAREST + (1.0 - RANDOM_NEAREST) * unit(&mut rng);
            distance * directions[direction]
        })
        .collect();
    // Clockwise loops have a negative area.
    let scale = (RANDOM_AREA / -polygon_area(&points)).sqrt();
    let low = points.iter().copied().fold(DVec2::INFINITY, DVec2::min);
    let points: Vec<DVec2> = points.iter().map(|p| scale * (*p - low)).collect();
    let extent = points.iter().copied().fold(DVec2::ZERO, DVec2::max);
    // A quarter of a turn on.
    let right = (corners + 2) / 4;
    let labels = vec![("upper-corners", Label::Corners(vec![0, right]))];
    Cut::of(points, extent, labels)
}

impl Cut {
    /// Spacing of vertices at a place, over that of an even mesh.
    pub(super) fn part(&self, place: DVec2) -> f64 {
        let beyond = place.distance(DVec2::splat(0.5)) - CLAMP_RADIUS;
        let part = (beyond - CLAMP_BAND).max(-beyond) / CLAMP_SLOPE;
        let [near, far] = self.spacing;
        near + (far - near) * part.clamp(0.0, 1.0)
    }

    /// An outline without holes and without a ridge.
    pub(super) fn of(outline: Vec<DVec2>, extent: DVec2, labels: Labels) -> Self {
        Self {
            loops: vec![outline],
            ridge: Vec::new(),
            spacing: [1.0; 2],
            labels,
            extent,
        }
    }
}

fn polygon(corners: &[(f64, f64)]) -> Vec<DVec2> {
    corners.iter().map(|&(x, y)| DVec2::new(x, y)).collect()
}

/// Sides of a circle in the boundary of a mesh of `count` vertices that covers `area`: as many as
/// its segments, and a multiple of 8, so that an eighth of a turn is a corner.
fn circle_sides(radius: f64, area: f64, half_perimeter: f64, count: usize) -> usize {
    let segments = 2.0 * PI * radius / spacing(area, half_perimeter, count.max(1));
    8 * ((segments / 8.0).round() as usize).max(1)
}

/// A regular polygon from its upper left (135°) clockwise; at least 8 `sides`.
fn circle(center: DVec2, radius: f64, sides: usize) -> Vec<DVec2> {
    let (sin, cos) = small_sin_cos(2.0 * PI / sides as f64);
    let mut direction = DVec2::new(-FRAC_1_SQRT_2, FRAC_1_SQRT_2);
    let mut points = Vec::with_capacity(sides);
    for _ in 0..sides {
        points.push(center + radius * direction);
        direction = DVec2::new(
            direction.x * cos + direction.y * sin,
            direction.y * cos - direction.x * sin,
        );
    }
    points
}

/// Sine and cosine of an angle in 0..1 by their series, whose terms beyond these are below 1e-19.
fn small_sin_cos(angle: f64) -> (f64, f64) {
    let (mut sin, mut cos, mut term) = (0.0, 0.0, 1.0);
    for order in 0..20 {
        match order % 4 {
            0 => cos += term,
            1 => sin += term,
            2 => cos -= term,
            _ => sin -= term,
        }
        term *= angle / f64::from(order + 1);
    }
    (sin, cos)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_series_is_the_sine_and_the_cosine() {
        for k in 0..=100 {
            let angle = f64::from(k) * 0.0079;
            let (sin, cos) = small_sin_cos(angle);
            // One rounding of a sum of order 1, and those of its first terms.
            assert!((sin - angle.sin()).abs() < 5e-16, "{angle}");
            assert!((cos - angle.cos()).abs() < 5e-16, "{angle}");
        }
    }

    #[test]
    fn a_graded_disc_has_as_many_vertices_as_an_even_one() {
        for count in [289, 1720, 2100, 3000, 9000] {
            let cut = drape_disc(count);
            let place = |r: f64| DVec2::new(0.5 + r, 0.5);
            let rings = (0..10_000).map(|k| (f64::from(k) + 0.5) / 20_000.0);
            let mean: f64 = rings.map(|r| 4e-4 * r / cut.part(place(r)).powi(2)).sum();
            assert!((mean - 1.0).abs() < 0.02, "{count}: {mean}");
            let apart = 0.3 * cut.part(place(0.35)) * spacing(PI / 4.0, PI / 2.0, count);
            assert!(
                !(1700..=3300).contains(&count) || (apart - 4.8e-3).abs() < 1e-6,
                "{count}: {apart} m"
            );
        }
    }

    #[test]
    fn a_circle_closes_and_its_eighths_are_corners() {
        for sides in [8, 64, 96, 1000] {
            let points = circle(DVec2::ZERO, 1.0, sides);
            let corner = DVec2::splat(FRAC_1_SQRT_2);
            // Each rotation rounds by 1e-16.
            let allowed = 2e-16 * sides as f64;
            assert!(points[sides / 8].distance(DVec2::Y) < allowed);
            assert!(points[sides / 4].distance(corner) < allowed);
            assert!(points[sides / 2].distance(-points[0]) < allowed);
        }
    }
}
