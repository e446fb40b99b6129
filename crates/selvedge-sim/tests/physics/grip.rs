//! Cloth between two fingers: the push is that of the fabric under pressure, whatever the mesh and the
//! substeps, and friction holds what it should.
#![allow(clippy::print_stdout, reason = "the figures, for the docs")]

use std::f64::consts::TAU;

use glam::{DVec2, DVec3};
use selvedge_cloth::{
    Compression, ContactSettings, HandleTargets, Mesh, Obstacle, PhysicsSettings, Scene, bodies,
};
use selvedge_sim::Simulator;

use crate::scenes::{CAMEL, DENIM, GRAY, NAVY, material, steps, still};
use crate::sheets::{grid, scene};
use crate::touching::{GRAVITY, led};

/// Width of the cloth `[m]`, which hangs in the plane x = 0 from y = 0.
const WIDTH: f64 = 0.12;
/// Side of the fingers' faces `[m]`: the pads of a common gripper.
const PAD: f64 = 0.03;
const FRICTION: f64 = 0.6;
/// Of gray interlock `[kg/m²]`.
const DENSITY: f64 = 0.187;

/// A cloth of `squares`² squares, held at its upper edge, and two fingers around it, 1 cm below. They close
/// from 10 mm to `gap` `[m]` a side within 0.3 s, and go where `way` has them then.
fn gripped(squares: usize, fabric: &str, gap: f64, way: &[(f64, DVec3)]) -> Scene {
    layered(1, squares, fabric, gap, way)
}

/// The same of several cloths, 1 mm apart at first, that bear on each other: `gap` is that of each two.
fn layered(layers: u32, squares: usize, fabric: &str, gap: f64, way: &[(f64, DVec3)]) -> Scene {
    let spacing = WIDTH / squares as f64;
    let count = ((squares + 1) * (squares + 1)) as u32;
    let (mut faces, mut coordinates, mut places, mut held) = (vec![], vec![], vec![], vec![]);
    for layer in 0..layers {
        let aside = 1e-3 * (f64::from(layer) - 0.5 * f64::from(layers - 1));
        let own = grid(squares, squares, spacing, |c| {
            DVec3::new(aside, c.y - WIDTH, c.x - 0.5 * WIDTH)
        });
        let first = layer * count;
        faces.extend(squares_of(squares).iter().map(|f| f.map(|v| v + first)));
        places.extend_from_slice(own.positions());
        let flat = own.positions().iter();
        coordinates.extend(flat.map(|p| DVec2::new(p.z + 0.5 * WIDTH, p.y + WIDTH)));
        held.extend(first..=first + squares as u32);
    }
    let mesh = Mesh::new(&faces, coordinates, places).unwrap();
    let mut scene = scene(mesh, material(fabric), &held);
    scene.physics = PhysicsSettings::default();
    scene.contact = Some(ContactSettings {
        friction: FRICTION,
        ..ContactSettings::default()
    });
    let half = 0.5 * f64::from(layers + 1) * gap;
    scene.obstacles = [-1.0, 1.0].map(|sign| finger(sign, half, way)).to_vec();
    scene
}

fn finger(sign: f64, gap: f64, way: &[(f64, DVec3)]) -> Obstacle {
    let body = bodies::cuboid(DVec3::new(0.02, PAD, PAD));
    let middle = DVec3::new(sign * 0.02, -0.5 * PAD - 0.01, 0.0);
    let points = body.points.iter().map(|p| *p + middle).collect();
    let name = if sign > 0.0 { "right" } else { "left" };
    let closed = DVec3::X * (-sign * (0.01 - gap));
    let start = [(0.0, DVec3::ZERO), (0.3, closed)];
    let places = way.iter().map(|(time, by)| (*time, closed + *by));
    let places: Vec<_> = start.into_iter().chain(places).collect();
    led(Obstacle::new(name, points, body.faces).unwrap(), &places)
}

/// Closes the fingers in 0.4 s.
fn closed(scene: &Scene, substeps: u32) -> Simulator {
    let mut scene = scene.clone();
    scene.physics.substeps = substeps;
    let mut simulator = Simulator::new(&scene).unwrap();
    steps(&mut simulator, &still(&scene), 24);
    simulator
}

/// Targets of handles that have let go.
fn let_go(scene: &Scene) -> HandleTargets {
    still(scene)
        .releasing(vec![true; scene.handles.len()])
        .unwrap()
}

/// Vertices between the closed fingers, within this part of their pads.
fn between(scene: &Scene, positions: &[DVec3], part: f64) -> Vec<usize> {
    let within = |p: DVec3| p.z.abs().max((p.y + 0.5 * PAD + 0.01).abs()) < part * 0.5 * PAD;
    let all = 0..scene.mesh.positions().len();
    all.filter(|v| within(positions[*v])).collect()
}

fn squares_of(squares: usize) -> Vec<[u32; 3]> {
    crate::scenes::squares(squares, squares)
}

#[test]
fn layers_between_fingers_bear_on_each_other_as_on_the_fingers() {
    let lift = [(0.45, DVec3::ZERO), (0.65, DVec3::Y * 0.05)];
    let gap = 4e-4;
    for layers in [2, 4] {
        for (squares, substeps) in [(10, 1), (10, 2), (10, 4)] {
            let scene = layered(layers, squares, GRAY, gap, &lift);
            let mut simulator = closed(&scene, substeps);
            let start = simulator.positions_f64().to_vec();
            let own = between(&scene, &start, 1.0);
            let area: f64 = own.iter().map(|v| simulator.vertex_mass()[*v]).sum::<f64>()
                / scene.material.density
                / f64::from(layers);
            let expected = area * Compression::default().pressure(gap / 1e-3);
            let push = 60.0 * simulator.obstacle_impulses()[0].x.abs();
            let error = push / expected - 1.0;
            steps(&mut simulator, &let_go(&scene), 51);
            assert_eq!(simulator.intersection_count(), 0);
            let now = simulator.positions_f64();
            let inner = own.iter().filter(|v| start[**v].z.abs() < 0.4 * PAD);
            let slips = inner.map(|v| (now[*v] - start[*v] - DVec3::Y * 0.05).length());
            let slip = slips.fold(0.0, f64::max);
            println!("{layers} {squares} {substeps}: push {error:.3} beside, slip {slip:.2e} m");
            assert!(error.abs() < 0.1, "{layers} {squares} {substeps}: {error}");
            assert!(slip < 5e-4, "{layers} {squares} {substeps}: {slip}");
        }
    }
}

#[test]
fn what_is_gripped_is_lifted_and_shaken_without_slip() {
    // Up by 5 cm in 0.2 s, then to and fro at 2 m/s².
    let frequency = 3.0;
    let amplitude = 2.0 / (TAU * frequency).powi(2);
    let mut way = vec![(0.45, DVec3::ZERO), (0.65, DVec3::Y * 0.05)];
    for frame in 1..=36 {
        let time = f64::from(frame) / 60.0;
        let by = 0.05 + amplitude * (TAU * frequency * time).sin();
        way.push((0.65 + time, DVec3::Y * by));
    }
    for (squares, fabric) in [(6, GRAY), (8, DENIM), (12, CAMEL), (16, NAVY)] {
        let scene = gripped(squares, fabric, 3e-4, &way);
        for substeps in [1, 2, 4] {
            let mut simulator = closed(&scene, substeps);
            let start = simulator.positions_f64().to_vec();
            let own = between(&scene, &start, 0.8);
            assert!(!own.is_empty());
            steps(&mut simulator, &let_go(&scene), 51);
            assert_eq!(simulator.intersection_count(), 0);
            let (_, last) = way[37];
            let now = simulator.positions_f64();
            let slips = own.iter().map(|v| (now[*v] - start[*v] - last).length());
            let slip = slips.fold(0.0, f64::max);
            println!("{squares} {substeps}: {} vertices, {slip:.2e} m", own.len());
            assert!(slip < 5e-4, "{squares} {substeps}: {slip}");
        }
    }
}

#[test]
fn fingers_push_as_the_fabric_does_and_slide_at_the_friction_of_their_push() {
    let gap = 4e-4;
    let way = [(0.4, DVec3::ZERO), (0.9, DVec3::Y * -0.025)];
    for squares in [10, 16] {
        let scene = gripped(squares, GRAY, gap, &way);
        for substeps in [1, 2, 4] {
            let mut simulator = closed(&scene, substeps);
            let own = between(&scene, simulator.positions_f64(), 1.0);
            let area: f64 = own.iter().map(|v| simulator.vertex_mass()[*v]).sum::<f64>()
                / scene.material.density;
            let expected = area * Compression::default().pressure(gap / 1e-3);
            let push = 60.0 * simulator.obstacle_impulses()[0].x.abs();
            let error = push / expected - 1.0;
            // Slides for 0.2 s, and is looked at for 0.1 s more.
            steps(&mut simulator, &still(&scene), 12);
            let mut sums = [DVec3::ZERO; 2];
            for _ in 0..6 {
                steps(&mut simulator, &still(&scene), 1);
                let impulses = simulator.obstacle_impulses();
                sums.iter_mut()
                    .zip(impulses)
                    .for_each(|(sum, one)| *sum += one);
            }
            let drag = sums.iter().map(|sum| sum.y.abs()).sum::<f64>();
            let normal = sums.iter().map(|sum| sum.x.abs()).sum::<f64>();
            let ratio = drag / normal / FRICTION;
            println!(
                "{squares} {substeps}: push {push:.3} N of {expected:.3}, friction {ratio:.3}"
            );
            assert!(error.abs() < 0.1, "{squares} {substeps}: {error}");
            assert!((ratio - 1.0).abs() < 0.1, "{squares} {substeps}: {ratio}");
        }
    }
}

#[test]
fn a_grip_that_is_too_weak_for_the_weight_slips() {
    let weight = DENSITY * WIDTH * WIDTH * GRAVITY;
    for substeps in [1, 2, 4] {
        for (part, holds) in [(0.8, false), (1.3, true)] {
            let area = {
                let scene = gripped(10, GRAY, 1e-3, &[]);
                let own = between(&scene, scene.mesh.positions(), 1.0);
                let shape = scene.rest_shape();
                own.iter().map(|v| shape.vertex_mass[*v]).sum::<f64>() / DENSITY
            };
            let pressure = part * weight / (2.0 * FRICTION * area);
            let gap = 1e-3 * Compression::default().gap(pressure);
            let scene = gripped(10, GRAY, gap, &[]);
            let mut simulator = closed(&scene, substeps);
            let start = simulator.positions_f64()[0].y;
            steps(&mut simulator, &let_go(&scene), 60);
            let fallen = start - simulator.positions_f64()[0].y;
            println!("{substeps}: {part} of the weight, falls by {fallen} m");
            assert_eq!(fallen < 0.01, holds, "{substeps} {part}: {fallen}");
        }
    }
}
