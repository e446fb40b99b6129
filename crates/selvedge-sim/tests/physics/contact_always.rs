//! Of every scene with contact: energy does not grow, no gap is below the floor, and the order of
//! vertices and faces does not matter.
#![allow(clippy::print_stdout, reason = "the numbers, for the docs")]

use glam::DVec3;
use selvedge_cloth::{ContactSettings, Isotropic, Mesh, Scene};
use selvedge_sim::Simulator;

use crate::dynamics::energy;
use crate::scenes::{at_rest, largest_distance};
use crate::sheets::{elastic, isotropic};
use crate::touching::{glide, ground, lying, run, smallest_gap, sphere};

/// Ten times as stiff in the plane as a light knit.
const SOFT: Isotropic = elastic(1e5, 0.3, 1e-3);

/// A sheet of isotropic material that falls on a ball and a floor.
fn dropped(side: usize) -> Scene {
    let mut scene = lying(side, |p| p + DVec3::Y * 0.35);
    scene.material = isotropic(SOFT, 0.2);
    scene.obstacles = vec![sphere(DVec3::ZERO, 0.3, 2), ground(0.0)];
    scene
}

#[test]
fn the_energy_of_a_falling_sheet_does_not_rise_and_no_gap_is_below_the_floor() {
    let scene = dropped(13);
    let mut simulator = Simulator::new(&scene).unwrap();
    let first = energy(&simulator);
    let (mut before, mut rises) = (first, 0.0_f64);
    let least = least_gap(&scene, &mut simulator, 90, |simulator| {
        let now = energy(simulator);
        rises = rises.max(now - before);
        before = now;
    });
    let drop = first - before;
    println!("drop {drop} J, largest rise in a frame {rises} J, least gap {least:e} m");
    assert!(drop > 0.1, "{drop}");
    assert!(rises < 1e-3 * drop, "{rises} of {drop}");
    let counts = simulator.stats().contact;
    assert!(counts.touching > 50 && counts.divisions == 0, "{counts:?}");
}

/// A floor that is nearly reached: a strip folds onto itself.
#[test]
fn no_gap_of_a_fold_is_below_the_floor() {
    let mut strip = lying(12, |p| {
        DVec3::new(0.2 * p.z, p.x + 0.55, 0.02 * (7.0 * p.x).sin())
    });
    strip.obstacles = vec![ground(0.0)];
    let mut simulator = Simulator::new(&strip).unwrap();
    least_gap(&strip, &mut simulator, 80, |_| {});
}

/// Runs, and tells of every frame. Gives the least gap `[m]`, which is near the floor and not below.
fn least_gap(
    scene: &Scene,
    simulator: &mut Simulator,
    frames: usize,
    mut on_frame: impl FnMut(&Simulator),
) -> f64 {
    let mut least = 1e-3_f64;
    for _ in 0..frames {
        run(simulator, 1);
        least = least.min(smallest_gap(scene, simulator));
        on_frame(simulator);
    }
    let floor = ContactSettings::default().floor;
    assert!((0.9 * floor..9e-4).contains(&least), "{least}");
    least
}

#[test]
fn the_order_of_vertices_and_faces_does_not_matter() {
    let scene = dropped(9);
    let count = 81_usize;
    // 40 and 81 have no common factor; nor have 77 and 128.
    let moved = |v: usize| (40 * v + 7) % count;
    let mut mixed = scene.clone();
    let mesh = &scene.mesh;
    let mut coordinates = mesh.material_coordinates().to_vec();
    let mut positions = mesh.positions().to_vec();
    for v in 0..count {
        coordinates[moved(v)] = mesh.material_coordinates()[v];
        positions[moved(v)] = mesh.positions()[v];
    }
    let faces = mesh.topology().face_indices();
    let turned = |k: usize| {
        let [a, b, c] = faces[(77 * k + 3) % faces.len()].map(|v| moved(v as usize) as u32);
        [b, c, a]
    };
    let faces: Vec<[u32; 3]> = (0..faces.len()).map(turned).collect();
    mixed.mesh = Mesh::new(&faces, coordinates, positions).unwrap();
    let mut runs = [&scene, &mixed].map(|scene| {
        // A little above the ball.
        let near = |p: &DVec3| *p - DVec3::Y * 0.0485;
        at_rest(scene, scene.mesh.positions().iter().map(near).collect())
    });
    for simulator in &mut runs {
        glide(simulator, 10);
        let counts = simulator.stats().contact;
        assert!(counts.touching > 0 && counts.projected == 0, "{counts:?}");
    }
    let [straight, other] = runs.map(|run| run.positions_f64().to_vec());
    let back: Vec<DVec3> = (0..count).map(|v| other[moved(v)]).collect();
    let distance = largest_distance(&straight, &back);
    println!("{distance:e} m apart");
    assert!(distance <= 1e-6, "{distance}");
}
