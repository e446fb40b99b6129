//! How soon sheets of a random mesh come to rest, over a minute: for the notebook.
#![allow(clippy::print_stdout, reason = "the figures, for the notebook")]

use glam::{DQuat, DVec3};
use selvedge_cloth::generate::square;
use selvedge_cloth::{Handles, Obstacle, Stepper, bodies};
use selvedge_sim::Simulator;

use crate::scenes::numbers;
use crate::touching::{copies, ground, lying, mean, none, sphere};

/// Frames at which the speed is told.
const TOLD: [usize; 7] = [60, 240, 480, 900, 1800, 2700, 3600];

/// What a sheet falls onto, by 2 mm.
#[derive(Clone, Copy, Debug)]
enum Onto {
    /// A ball of 0.15 m.
    Ball,
    /// A box of 0.3 m.
    Box,
    /// The ground, five of them, each turned by 0.3 rad against the one below and 3 mm above it.
    Ground,
}

fn cube() -> Obstacle {
    let body = bodies::cuboid(DVec3::splat(0.3));
    let points = body.points.iter().map(|p| *p - DVec3::Y * 0.15);
    Obstacle::new("box", points.collect(), body.faces).unwrap()
}

/// Mean speed `[mm/s]` of a sheet of 0.5 m whose mesh is of this seed, and when it rests.
fn follow(onto: Onto, vertices: usize, seed: u64) {
    let sheet = square(vertices, 0.5, seed).unwrap().mesh;
    let middle = sheet.positions().iter().sum::<DVec3>() / vertices as f64;
    let flat = sheet.positions().iter().map(|p| *p - middle);
    let flat = flat.map(|p| DVec3::new(p.y, 2e-3, p.z)).collect();
    let sheet = sheet.with_positions(flat).unwrap();
    let mut scene = lying(4, |p| p);
    scene.environment.air_density = 1.2;
    scene.contact.as_mut().unwrap().friction = 0.5;
    scene.obstacles = match onto {
        Onto::Ball => vec![sphere(DVec3::NEG_Y * 0.15, 0.15, 3)],
        Onto::Box => vec![cube()],
        Onto::Ground => vec![ground(0.0)],
    };
    scene.mesh = match onto {
        Onto::Ground => copies(&sheet, 5, |k, p| {
            DQuat::from_rotation_y(0.3 * k as f64) * p + DVec3::Y * (3e-3 * k as f64)
        }),
        _ => sheet,
    };
    scene.handles = Handles::new(&[], scene.mesh.positions().len()).unwrap();
    let mut simulator = Simulator::new(&scene).unwrap();
    let mut told = String::new();
    for frame in 1..=3600 {
        simulator.step(&none()).unwrap();
        let seconds = frame as f64 / 60.0;
        if TOLD.contains(&frame) {
            let speed = 1e3 * mean(simulator.velocities_f64().iter().map(|v| v.length()));
            told += &format!(", {seconds} s {speed:.3}");
        }
        if simulator.stats().contact.resting > 0 {
            told += &format!(", rests since {seconds:.2} s");
            break;
        }
    }
    println!("{onto:?}, mesh {seed}{told}");
}

#[test]
#[ignore = "minutes"]
fn sheets_come_to_rest() {
    for seed in numbers() {
        follow(Onto::Ball, 256, seed as u64);
        follow(Onto::Box, 256, seed as u64);
        follow(Onto::Ground, 100, seed as u64);
    }
}
