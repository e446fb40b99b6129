//! Solves to the rest pose of 48 squares: the four fabrics, 400 and 1024 vertices, three meshes,
//! both sides. The table of `notebook/2026-11-22-rest-pose-acceleration.md`.
//!
//! `cargo run --release -p selvedge-sim --example rest_poses -- [POSES]` with a file of poses,
//! which is written where there is none. Where there is one, each pose's distance to it is printed:
//! so two versions of the search are compared.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program that prints its result"
)]

use std::time::Instant;

use glam::DVec3;
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{
    Environment, HandleSchedule, Handles, Motion, PhysicsSettings, SagSettings, Scene,
};
use selvedge_sim::sag;

const FABRICS: [&str; 4] = [
    selvedge_assets::materials::GRAY_INTERLOCK,
    selvedge_assets::materials::DENIM,
    selvedge_assets::materials::CAMEL_PONTE_ROMA,
    selvedge_assets::materials::NAVY_SPARKLE_SWEAT,
];

fn main() {
    let file = std::env::args().nth(1);
    let known = file.as_deref().and_then(|file| std::fs::read(file).ok());
    let mut known = known.as_deref().map(|bytes| bytes.chunks_exact(8));
    let (mut poses, mut solves) = (Vec::new(), Vec::new());
    println!(
        "| fabric | vertices | seed | bulge | solves | seconds | to the other pose: RMS, largest |"
    );
    println!("|---|---|---|---|---|---|---|");
    for fabric in FABRICS {
        for vertices in [400, 1024] {
            for (seed, side) in [
                (1, 1.0),
                (1, -1.0),
                (2, 1.0),
                (2, -1.0),
                (3, 1.0),
                (3, -1.0),
            ] {
                let scene = scene(fabric, vertices, seed, side);
                let begin = Instant::now();
                let rest = sag(&scene).unwrap();
                let seconds = begin.elapsed().as_secs_f64();
                solves.push(rest.solves);
                let distance = known.as_mut().map(|known| {
                    let mut next = || f64::from_le_bytes(known.next().unwrap().try_into().unwrap());
                    let other = rest
                        .positions
                        .iter()
                        .map(|_| DVec3::new(next(), next(), next()));
                    distance(&rest.positions, &other.collect::<Vec<_>>())
                });
                println!(
                    "| {} | {vertices} | {seed} | {} m | {} | {seconds:.2} | {} |",
                    scene.material.name,
                    scene.sag.bulge,
                    rest.solves,
                    distance.unwrap_or_default()
                );
                let numbers = rest.positions.iter().flat_map(|p| p.to_array());
                poses.extend(numbers.flat_map(f64::to_le_bytes));
            }
        }
    }
    solves.sort_unstable();
    println!(
        "{} to {} solves, {} in the median, {} in all",
        solves[0],
        solves[solves.len() - 1],
        solves[solves.len() / 2],
        solves.iter().sum::<u32>()
    );
    if let Some(file) = file.filter(|_| known.is_none()) {
        std::fs::write(file, poses).unwrap();
    }
}

/// Distances of the vertices of two poses, in words.
fn distance(a: &[DVec3], b: &[DVec3]) -> String {
    let squares = || a.iter().zip(b).map(|(a, b)| a.distance_squared(*b));
    let mean = squares().sum::<f64>() / a.len() as f64;
    let largest = squares().fold(0.0, f64::max);
    let [mean, largest] = [mean, largest].map(|square| 1e3 * square.sqrt());
    format!("{mean:.4}, {largest:.4} mm")
}

fn scene(fabric: &str, vertices: usize, seed: u64, side: f64) -> Scene {
    let size = 1.0;
    let sheet = square(&SquareSpec {
        vertices,
        size,
        seed,
    })
    .unwrap();
    let mut sag = SagSettings::default();
    sag.bulge *= side;
    Scene {
        name: "hanging".to_owned(),
        handles: Handles::new(&sheet.labels["upper-corners"], vertices).unwrap(),
        fabrics: std::collections::BTreeMap::new(),
        schedule: HandleSchedule::default(),
        mesh: sheet.mesh,
        material: toml::from_str(fabric).unwrap(),
        environment: Environment::default(),
        motion: Motion::still(1.0),
        physics: PhysicsSettings::default(),
        sag,
        frame_rate: 60.0,
        contact: None,
        obstacles: Vec::new(),
    }
}
