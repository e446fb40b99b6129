//! Closed forms of what motions are like.

use glam::{DVec2, DVec3, Vec3};
use selvedge_cloth::generate::square;
use selvedge_cloth::{Handles, Mesh};

use super::*;

const RATE: f64 = 50.0;

fn cloth() -> Cloth {
    let sheet = square(30, 1.0, 3).expect("a sheet");
    let handles = Handles::new(&[0], 30).expect("a handle");
    Cloth::of_mesh(&sheet.mesh, 0.2, handles).expect("a cloth")
}

/// Frames of `cloth`, vertices where `place` puts them at a time `[s]`.
fn frames(cloth: &Cloth, count: usize, place: impl Fn(DVec3, f64) -> DVec3) -> Vec<Vec3> {
    let rest = cloth.rest_positions();
    let at = |frame: usize| {
        let time = frame as f64 / RATE;
        let places = rest.iter().map(|p| place(p.as_dvec3(), time).as_vec3());
        places.collect::<Vec<_>>()
    };
    (0..count).flat_map(at).collect()
}

fn character(cloth: &Cloth, positions: &[Vec3]) -> Character {
    let frames = Frames::new(positions, cloth.vertex_count()).expect("frames");
    Character::of(frames, cloth, RATE).expect("a character")
}

fn near(found: f64, expected: f64, tolerance: f64) {
    assert!((found - expected).abs() <= tolerance, "{found} {expected}");
}

#[test]
fn a_thrown_sheet_has_its_energy_and_acceleration_and_no_folds() {
    let cloth = cloth();
    let (speed, gravity) = (DVec3::new(1.0, 2.0, 0.0), DVec3::new(0.0, -9.8, 0.0));
    let count = 21;
    let thrown = |p: DVec3, t: f64| p + speed * t + gravity * (0.5 * t * t);
    let positions = frames(&cloth, count, thrown);
    let found = character(&cloth, &positions);
    near(found.acceleration, 9.8, 2e-3);
    // Rounding of f32 positions, times the third power of the rate.
    near(found.jerk, 0.0, 0.15);
    near(found.folds, 0.0, 1e-4);
    near(found.stretch, 0.0, 1e-5);
    // Mean velocities between frames are those of their middles.
    let mass: f64 = cloth.vertex_mass().iter().map(|m| f64::from(*m)).sum();
    let of_step = |step: usize| {
        let middle = (step as f64 + 0.5) / RATE;
        0.5 * mass * (speed + gravity * middle).length_squared()
    };
    let energy = (0..count - 1).map(of_step).sum::<f64>() / (count - 1) as f64;
    near(found.kinetic_energy, energy, 1e-4 * energy);
}

#[test]
fn a_cubic_motion_has_its_jerk() {
    let cloth = cloth();
    let positions = frames(&cloth, 16, |p, t| p + DVec3::Z * (10.0 * t.powi(3)));
    near(character(&cloth, &positions).jerk, 60.0, 0.2);
}

#[test]
fn a_stretched_sheet_has_its_strain() {
    let cloth = cloth();
    let positions = frames(&cloth, 2, |p, _| p * 1.1);
    let found = character(&cloth, &positions);
    near(found.stretch, 0.1, 1e-5);
    near(found.compression, 0.1, 1e-5);
    // One edge of a hundred and more is beyond either percentile.
    let squeezed = frames(&cloth, 2, |p, _| DVec3::new(p.x, p.y * 0.5, p.z));
    let found = character(&cloth, &squeezed);
    near(found.compression, -0.5, 1e-3);
    assert!(found.stretch <= 1e-5, "{found:?}");
}

#[test]
fn a_rolled_strip_has_the_curvature_of_its_cylinder() {
    // Strips along the axis of a cylinder of 0.2 m, 4° each: their diagonals do not bend.
    let (radius, turn, strips) = (0.2_f64, 4.0_f64.to_radians(), 30_u32);
    let mut flat = Vec::new();
    let mut rolled = Vec::new();
    let width = 2.0 * radius * (0.5 * turn).sin();
    for strip in 0..=strips {
        let angle = turn * f64::from(strip);
        for side in [0.0, 0.5] {
            flat.push(DVec2::new(width * f64::from(strip), side));
            rolled.push(DVec3::new(radius * angle.cos(), side, radius * angle.sin()));
        }
    }
    let quad = |strip: u32| [[0, 2, 1], [2, 3, 1]].map(|face| face.map(|v: u32| v + 2 * strip));
    let faces: Vec<[u32; 3]> = (0..strips).flat_map(quad).collect();
    let mesh = Mesh::new(&faces, flat, rolled.clone()).expect("a mesh");
    let handles = Handles::new(&[0], rolled.len()).expect("a handle");
    let cloth = Cloth::of_mesh(&mesh, 0.2, handles).expect("a cloth");
    let positions: Vec<Vec3> = rolled.iter().map(|p| p.as_vec3()).collect();
    let found = character(&cloth, &positions);
    // The first and the last half strip are without a fold, and chords are shorter than arcs.
    let folds = f64::from(strips - 1) / f64::from(strips);
    near(found.curvature, folds / radius, 2e-3 / radius);
    // Every other interior edge is a diagonal.
    let interior = f64::from(2 * strips - 1);
    near(found.folds, turn * f64::from(strips - 1) / interior, 1e-4);
    assert_eq!(found.kinetic_energy, 0.0);
}

#[test]
fn ratios_are_those_of_sums() {
    let of = |folds: f64| Character {
        folds,
        curvature: 2.0 * folds,
        ..Character::default()
    };
    let ratios = Character::ratios(&[(of(1.0), of(2.0)), (of(2.0), of(4.0))]);
    assert_eq!(ratios[..3], [Some(0.5), Some(0.5), None]);
    assert_eq!(Character::ratios(&[]), [None; Character::COUNT]);
}

#[test]
fn frames_of_another_mesh_are_an_error() {
    let cloth = cloth();
    let frames = Frames::new(&[Vec3::ZERO; 4], 4).expect("frames");
    assert!(Character::of(frames, &cloth, RATE).is_err());
}
