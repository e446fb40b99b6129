//! A book of 1 kg that moves up and down on a folded towel sinks as deep as the curve of the fabric has it.
#![allow(clippy::print_stdout, reason = "the figures, for the docs")]

use glam::{DVec2, DVec3};
use selvedge_cloth::{Compression, Handles, Mesh, Obstacle, Scene, bodies};
use selvedge_sim::Simulator;

use crate::scenes::squares;
use crate::touching::{GRAVITY, ground, lying, mean, run};

/// Width of the towel's mesh, and of the book `[m]`: it covers nine by nine vertices of each layer, and the square of
/// each.
const SPACING: f64 = 0.02;
const BOOK: f64 = 9.0 * SPACING;
/// Squares along a layer and across it.
const SQUARES: usize = 12;
const LAYERS: usize = 4;
/// Distance of two layers at the start, and of the book from the uppermost `[m]`.
const LAID: f64 = 9.5e-4;
const MASS: f64 = 1.0;

/// A towel laid to and fro in four layers on a floor, and a book above it.
fn towel(substeps: u32) -> Scene {
    let columns = LAYERS * SQUARES;
    let points = (0..=SQUARES).flat_map(|row| (0..=columns).map(move |column| (row, column)));
    let place = |(row, column): (usize, usize)| {
        let (layer, along) = (column / SQUARES, column % SQUARES);
        let along = if layer % 2 == 0 { along } else { SQUARES - along };
        // The line of a fold lies halfway between its layers.
        let is_fold = column % SQUARES == 0 && column > 0 && column < columns;
        let height = (layer + 1).min(LAYERS) as f64 - if is_fold { 0.5 } else { 0.0 };
        let across = row as f64 - 0.5 * SQUARES as f64;
        let along = along as f64 - 0.5 * SQUARES as f64;
        DVec3::new(along * SPACING, height * LAID, across * SPACING)
    };
    let flat = |(row, column): (usize, usize)| DVec2::new(column as f64, row as f64) * SPACING;
    let places: Vec<_> = points.clone().map(place).collect();
    let coordinates = points.map(flat).collect();
    let mut scene = lying(4, |p| p);
    scene.handles = Handles::new(&[], places.len()).unwrap();
    scene.mesh = Mesh::new(&squares(columns, SQUARES), coordinates, places).unwrap();
    scene.physics.substeps = substeps;
    let body = bodies::cuboid(DVec3::new(BOOK, 0.03, BOOK));
    let bottom = DVec3::Y * (LAID * (LAYERS + 1) as f64 + 0.015);
    let points = body.points.iter().map(|p| *p + bottom).collect();
    scene.obstacles = vec![
        ground(0.0),
        Obstacle::new("book", points, body.faces).unwrap(),
    ];
    scene
}

/// Height of the book where this force `[N]` presses the layers together, by hand: each gap has the pressure of the
/// book and of the layers above it.
fn height(force: f64, density: f64) -> f64 {
    let pressure = |above: usize| force / (BOOK * BOOK) + above as f64 * density * GRAVITY;
    let gaps = (0..=LAYERS).map(|above| 1e-3 * Compression::default().gap(pressure(above)));
    gaps.sum()
}

/// What [`height`] has for a height, by bisection `[N]`.
fn force(at: f64, density: f64) -> f64 {
    let (mut low, mut high) = (0.0, 1e4);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if height(middle, density) > at {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// A book that falls: m a = f - m g, f being the force that the cloth gave it in the last frame, and what the curve has
/// more at the height where the frame ends. At rest the curve adds nothing.
struct Book {
    height: f64,
    speed: f64,
}

impl Book {
    /// Goes on by a frame. Gives its new height.
    fn goes(&mut self, given: f64, density: f64) -> f64 {
        let dt = 1.0 / 60.0;
        let own = force(self.height, density);
        let accelerates = |to: f64| {
            let force = (given + force(to, density) - own).max(0.0);
            (force / MASS - GRAVITY) * dt + self.speed - (to - self.height) / dt
        };
        let (mut low, mut high) = (self.height - 0.01, self.height + 0.01);
        for _ in 0..60 {
            let middle = 0.5 * (low + high);
            if accelerates(middle) > 0.0 {
                low = middle;
            } else {
                high = middle;
            }
        }
        let to = 0.5 * (low + high);
        self.speed = (to - self.height) / dt;
        self.height = to;
        to
    }
}

#[test]
fn a_book_on_a_folded_towel_sinks_by_the_curve_and_lies_still() {
    for substeps in [1, 2, 4] {
        let scene = towel(substeps);
        let density = scene.material.density;
        let mut simulator = Simulator::new(&scene).unwrap();
        let start = LAID * (LAYERS + 1) as f64;
        let (expected, mut given) = (height(MASS * GRAVITY, density), 0.0);
        let mut book = Book {
            height: start,
            speed: 0.0,
        };
        // The towel comes to rest, and then the book is let go.
        run(&mut simulator, 60);
        for _ in 0..120 {
            let to = book.goes(given, density);
            simulator.lead_obstacle(1, DVec3::Y * (to - start)).unwrap();
            run(&mut simulator, 1);
            given = 60.0 * simulator.obstacle_impulses()[1].y;
        }
        let speeds = simulator.velocities_f64().iter();
        let below = speeds.zip(simulator.positions_f64());
        let below = below.filter(|(_, p)| p.x.abs().max(p.z.abs()) < 0.5 * BOOK);
        let cloth = mean(below.map(|(v, _)| v.length()));
        println!(
            "{substeps} substeps: {:.3} mm of {:.3}, {:.2e} m/s, the cloth below {cloth:.2e} m/s, {given:.3} N of {:.3}",
            book.height * 1e3,
            expected * 1e3,
            book.speed,
            MASS * GRAVITY
        );
        assert!((book.height / expected - 1.0).abs() < 0.05, "{substeps}");
        assert!(book.speed.abs() < 1e-4 && cloth < 1e-3, "{substeps}");
        assert!((given / (MASS * GRAVITY) - 1.0).abs() < 0.01, "{substeps}");
    }
}
