//! Energy of falling sheets, solves to the rest pose, and speeds at rest and a minute after swings,
//! of the default physics: the tables of `docs/src/concepts/physics.md`.
//!
//! `cargo run --release -p selvedge-sim --example energy_and_rest -- VERTICES SUBSTEPS`, for a
//! square of 1 m that hangs from two corners, of each shipped fabric and an isotropic one.
#![allow(
    clippy::unwrap_used,
    clippy::print_stdout,
    reason = "a measuring program that prints its result"
)]

use std::f64::consts::TAU;

use glam::{DQuat, DVec3};
use selvedge_cloth::generate::{SquareSpec, square};
use selvedge_cloth::{
    Environment, HandleSchedule, HandleTargets, Handles, Isotropic, Material, Motion,
    PhysicsSettings, SagSettings, Scene, Stepper,
};
use selvedge_sim::{Simulator, sag};

const FABRICS: [&str; 4] = [
    selvedge_assets::materials::GRAY_INTERLOCK,
    selvedge_assets::materials::CAMEL_PONTE_ROMA,
    selvedge_assets::materials::NAVY_SPARKLE_SWEAT,
    selvedge_assets::materials::DENIM,
];
const RATE: f64 = 60.0;

/// Way `[m]`, time there `[s]`, and how many times there and back.
const SWINGS: [([f64; 3], f64, f64); 10] = [
    ([0.5, 0.0, 0.0], 0.6, 1.0),
    ([0.0, 0.0, 0.4], 0.5, 2.0),
    ([0.0, 0.3, 0.0], 0.7, 1.0),
    ([0.42, 0.0, 0.42], 0.6, 3.0),
    ([0.35, 0.35, 0.0], 0.8, 2.0),
    ([0.0, 0.28, 0.28], 0.5, 1.0),
    ([0.3, 0.25, 0.3], 0.6, 2.0),
    ([-0.77, 0.0, 0.23], 0.9, 1.0),
    ([0.13, -0.2, -0.32], 0.5, 3.0),
    ([0.21, 0.0, -0.21], 0.3, 4.0),
];

fn main() {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let [vertices, substeps] = words.as_slice() else {
        panic!("say a number of vertices and of substeps: -- 400 2");
    };
    let (vertices, substeps) = (vertices.parse().unwrap(), substeps.parse().unwrap());
    println!(
        "| fabric | rise of energy, parts of the drop | solves to the rest pose | held still, mm/s | after swings, mm/s |"
    );
    println!("|---|---|---|---|---|");
    for material in materials() {
        let rise = [1, 2, 3].map(|seed| {
            let scene = scene(&material, vertices, seed, substeps);
            [0.0_f64, 60.0, 90.0]
                .map(|tilt| fall(&scene, tilt.to_radians()))
                .into_iter()
                .fold(0.0, f64::max)
        });
        let scenes = (1..).zip(SWINGS);
        let swung = scenes.map(|(seed, (way, there, times))| {
            let scene = scene(&material, vertices, seed, substeps);
            let motion = |time: f64| {
                let part = (time / (2.0 * there)).min(times);
                DVec3::from(way) * (0.5 - 0.5 * (TAU * part).cos())
            };
            speed_after(&scene, 2.0 * there * times + 60.0, motion)
        });
        let swung: Vec<(u32, f64)> = swung.collect();
        let (_, still) = speed_after(&scene(&material, vertices, 1, substeps), 30.0, |_| {
            DVec3::ZERO
        });
        println!(
            "| {} | {:.1e} | {} to {} | {still:.4} | {:.2} |",
            material.name,
            rise.into_iter().fold(0.0, f64::max),
            swung.iter().map(|run| run.0).min().unwrap(),
            swung.iter().map(|run| run.0).max().unwrap(),
            swung.iter().map(|run| run.1).fold(0.0, f64::max)
        );
    }
}

fn materials() -> Vec<Material> {
    let isotropic = Isotropic {
        youngs_modulus: 1e5,
        poissons_ratio: 0.3,
        thickness: 5e-4,
    };
    let mut all: Vec<Material> = FABRICS.map(|text| toml::from_str(text).unwrap()).into();
    let mut sheet = all[0].clone();
    sheet.name = "isotropic".to_owned();
    sheet.density = 0.2;
    sheet.stretch = isotropic.stretch_table();
    sheet.bend = isotropic.bend_table();
    all.push(sheet);
    all
}

/// A flat sheet, turned about the line between its handles by `tilt`, falls for six seconds. Gives
/// the largest rise of its energy within a frame, as a part of the whole drop.
fn fall(scene: &Scene, tilt: f64) -> f64 {
    let mut scene = scene.clone();
    let turn = DQuat::from_rotation_x(tilt);
    let places = scene.mesh.positions().iter().map(|p| turn * *p).collect();
    scene.mesh = scene.mesh.with_positions(places).unwrap();
    let held = scene.handles.select(scene.mesh.positions());
    let targets = HandleTargets::at_frame_end(held).unwrap();
    let mut cloth = Simulator::new(&scene).unwrap();
    let energy = |cloth: &Simulator| cloth.potential_energy().unwrap() + cloth.kinetic_energy();
    let first = energy(&cloth);
    let (mut last, mut rise) = (first, 0.0_f64);
    for _ in 0..360 {
        cloth.step(&targets).unwrap();
        let now = energy(&cloth);
        rise = rise.max(now - last);
        last = now;
    }
    rise / (first - last)
}

/// Solves to the rest pose, and the mean speed of the vertices `[mm/s]` so many `seconds` later,
/// with the handles moved by `motion` of the time.
fn speed_after(scene: &Scene, seconds: f64, motion: impl Fn(f64) -> DVec3) -> (u32, f64) {
    let found = sag(scene).unwrap();
    let rest = found.positions;
    let held = scene.handles.select(&rest);
    let still = vec![DVec3::ZERO; rest.len()];
    let mut cloth = Simulator::with_state(scene, rest, still).unwrap();
    for frame in 1..=(seconds * RATE).round() as u32 {
        let shift = motion(f64::from(frame) / RATE);
        let targets = held.iter().map(|place| *place + shift).collect();
        cloth
            .step(&HandleTargets::at_frame_end(targets).unwrap())
            .unwrap();
    }
    let speeds = cloth.velocities_f64().iter().map(|v| v.length());
    let mean = speeds.sum::<f64>() / cloth.velocities_f64().len() as f64;
    (found.solves, 1e3 * mean)
}

fn scene(material: &Material, vertices: usize, seed: u64, substeps: u32) -> Scene {
    let size = 1.0;
    let sheet = square(&SquareSpec {
        vertices,
        size,
        seed,
    })
    .unwrap();
    Scene {
        name: "hanging".to_owned(),
        handles: Handles::new(&sheet.labels["upper-corners"], vertices).unwrap(),
        fabrics: std::collections::BTreeMap::new(),
        schedule: HandleSchedule::default(),
        mesh: sheet.mesh,
        material: material.clone(),
        environment: Environment::default(),
        motion: Motion::still(1.0),
        physics: PhysicsSettings {
            substeps,
            ..PhysicsSettings::default()
        },
        sag: SagSettings::default(),
        frame_rate: RATE,
        contact: None,
        obstacles: Vec::new(),
    }
}
