//! Motions against closed forms and laws: a pendulum, a damped hinge, angular momentum, energy, the
//! order of the integrator, mirror symmetry.

use glam::{DVec2, DVec3};
use selvedge_cloth::{Integrator, Isotropic, Material, Mesh, Scene};
use selvedge_sim::Simulator;
use selvedge_sim::laws::bend::BendElement;

use crate::scenes::{BDF2, GRAY, INTEGRATORS, crumpled, held, largest_distance, material, noise};
use crate::sheets::{elastic, grid, isotropic, scene, slope};

const GRAVITY: f64 = 9.8;

const SOFT: Isotropic = elastic(2e4, 0.3, 1e-3);

fn angular_momentum(simulator: &Simulator) -> DVec3 {
    let state = simulator
        .positions_f64()
        .iter()
        .zip(simulator.velocities_f64());
    let masses = simulator.vertex_mass().iter();
    state.zip(masses).map(|((x, v), m)| *m * x.cross(*v)).sum()
}

/// A stiff triangle of height 0.5 m held by its upper edge, turned out of rest by `start` `[rad]`.
fn triangle_pendulum(length: f64, start: f64) -> Scene {
    let sheet = elastic(1e7, 0.0, 1e-3);
    let uv = vec![
        DVec2::ZERO,
        DVec2::new(-0.2, length),
        DVec2::new(0.2, length),
    ];
    let swung = |c: &DVec2| {
        let drop = length - c.y;
        DVec3::new(drop * start.sin(), -drop * start.cos(), -c.x)
    };
    let positions = uv.iter().map(swung).collect();
    let mesh = Mesh::new(&[[0, 2, 1]], uv, positions).unwrap();
    scene(mesh, isotropic(sheet, 0.3), &[1, 2])
}

#[test]
fn a_triangle_held_by_an_edge_is_a_pendulum_in_second_order() {
    // All free mass is at the apex, l below the held edge: θ'' = -(g/l) sin θ, a cosine for small
    // θ. BDF2 turns too little by ω² dt²/3 of the phase and keeps the amplitude to (ω dt)⁴/4 a
    // step: at 300 steps per second and after 6.6 rad that is 1e-4 and 4e-5 of the amplitude. The
    // amplitude θ₀ = 0.02 makes the period longer by θ₀²/16 = 2.5e-5, and the stiff cloth by its
    // elongation, m g/(2 E h) · O(1) = 1e-5.
    let (length, start) = (0.5, 0.02_f64);
    let mut scene = triangle_pendulum(length, start);
    scene.physics.integrator = BDF2;
    scene.physics.least_damping = Some(0.0);
    let omega = (GRAVITY / length).sqrt();
    let mut simulator = Simulator::new(&scene).unwrap();
    let targets = held(&scene);
    for step in 1..=450 {
        simulator.substep(1.0 / 300.0, &targets).unwrap();
        let apex = simulator.positions_f64()[0];
        let angle = apex.x.atan2(-apex.y);
        let expected = start * (omega * f64::from(step) / 300.0).cos();
        assert!(
            (angle - expected).abs() < 7e-4 * start,
            "step {step}: {angle} {expected}"
        );
    }
}

/// A hinge folded by 1 mrad: one free wing of two triangles whose other three corners are held,
/// without gravity. For small angles m h² θ'' = -k (θ + c θ'), k the hinge's stiffness and h the
/// wing's height. Gives the scene, k and h.
fn folded_hinge(start: f64) -> (Scene, f64, f64) {
    let sheet = elastic(1e7, 0.0, 3e-4);
    let side = 0.05;
    let height = 0.75_f64.sqrt() * side;
    let uv = vec![
        DVec2::ZERO,
        DVec2::new(side, 0.0),
        DVec2::new(0.5 * side, height),
        DVec2::new(0.5 * side, -height),
    ];
    let mut positions: Vec<DVec3> = uv.iter().map(|c| c.extend(0.0)).collect();
    positions[2] = DVec3::new(0.5 * side, height * start.cos(), height * start.sin());
    let mesh = Mesh::new(&[[0, 1, 2], [0, 3, 1]], uv.clone(), positions).unwrap();
    let mut scene = scene(mesh, isotropic(sheet, 0.3), &[0, 1, 3]);
    scene.environment.gravity = DVec3::ZERO;
    scene.physics.even_bending = false;
    scene.physics.integrator = BDF2;
    scene.physics.least_damping = Some(0.0);
    let corners = [0, 1, 2, 3].map(|v| uv[v]);
    let element = BendElement::new(&scene.material.bend, corners);
    let flat = corners.map(|c| c.extend(0.0));
    let stiffness = element
        .respond(selvedge_cloth::ElasticLaw::Energy, flat)
        .stiffness;
    (scene, stiffness, height)
}

#[test]
fn a_folded_hinge_opens_as_a_damped_oscillator_in_second_order() {
    // θ = θ₀ e^(-σ t) (cos ν t + (σ/ν) sin ν t) with σ = c ω²/2, ν² = ω² - σ². With ω dt = 0.05
    // BDF2 is behind by (ω dt)²/3 of the phase: 0.8 % of the amplitude after 10 rad.
    let start = 1e-3_f64;
    let (mut scene, stiffness, height) = folded_hinge(start);
    for damping in [0.0, 0.01] {
        scene.material.damping = damping;
        let mut simulator = Simulator::new(&scene).unwrap();
        let square = stiffness / (simulator.vertex_mass()[2] * height.powi(2));
        let dt = 0.05 / square.sqrt();
        let decay = 0.5 * damping * square;
        // Above 0 it swings, below it creeps: cos and sin of an imaginary angle.
        let turn = square - decay * decay;
        for step in 1..=200 {
            simulator.substep(dt, &held(&scene)).unwrap();
            let (time, nu) = (dt * f64::from(step), turn.abs().sqrt());
            let (even, odd) = if turn > 0.0 {
                ((nu * time).cos(), (nu * time).sin())
            } else {
                ((nu * time).cosh(), (nu * time).sinh())
            };
            let expected = start * (-decay * time).exp() * (even + decay / nu * odd);
            let wing = simulator.positions_f64()[2];
            let found = wing.z.atan2(wing.y);
            assert!(
                (found - expected).abs() < 1e-2 * start,
                "{step}: {found} {expected}"
            );
        }
    }
}

#[test]
fn angular_momentum_is_kept_to_the_order_of_the_integrator() {
    // F at x has no torque about x. The implicit part dt² J v of a stressed face has, of size
    // dt² (stress × turn), in every step: after a given time the loss is proportional to dt. At a
    // prediction the implicit part is smaller by a factor dt.
    let mesh = grid(4, 4, 0.25, |c| c.extend(0.0));
    let mut scene = scene(mesh, isotropic(SOFT, 0.3), &[]);
    scene.environment.gravity = DVec3::ZERO;
    let positions = scene.mesh.positions().to_vec();
    let middle = DVec3::new(0.5, 0.5, 0.0);
    let spin = |x: &DVec3| DVec3::new(0.3, -0.2, 4.0).cross(*x - middle);
    let velocities: Vec<DVec3> = positions.iter().map(spin).collect();
    let cases = [
        (Integrator::Linearised, [100_u32, 200, 400], 0.02),
        (BDF2, [200, 400, 800], 2e-4),
        (Integrator::default(), [200, 400, 800], 2e-4),
    ];
    for (integrator, counts, most) in cases {
        scene.physics.integrator = integrator;
        scene.physics.least_damping = Some(0.0);
        let points = counts.map(|steps| {
            let mut simulator =
                Simulator::with_state(&scene, positions.clone(), velocities.clone()).unwrap();
            let before = angular_momentum(&simulator);
            let dt = 0.25 / f64::from(steps);
            for _ in 0..steps {
                simulator.substep(dt, &[]).unwrap();
            }
            let lost = angular_momentum(&simulator).distance(before) / before.length();
            (dt.ln(), lost.ln())
        });
        let order = slope(&points);
        let expected = f64::from(integrator.order());
        assert!(order > expected - 0.15, "{integrator:?} {order}");
        assert!(points[2].1 < f64::ln(most), "{integrator:?} {points:?}");
    }
}

/// Kinetic energy, and of gravity, stretching and bending `[J]`.
pub(crate) fn energy(simulator: &Simulator) -> f64 {
    simulator.kinetic_energy() + simulator.potential_energy().unwrap()
}

#[test]
fn without_input_the_energy_never_grows() {
    // Both orders only take energy away at 240 substeps per second. Rounding, and the stiffness that
    // bending holds constant while edges change their lengths, are allowed 1e-6 of what there was.
    //
    // BDF2 never lets grow what it keeps of two states, E = |y|² + |2y - y'|² in the norm of a
    // linear system's energy (Dahlquist 1978). The energy |y|² of one state can swing within that:
    // by (ω dt)³ of the part of a vibration of ω in a substep, and a linear solve adds what the
    // Jacobian lacks. Measured at 60 substeps per second: from the lowest so far it rises by
    // 1.8e-4 of the first energy with the integrator's damping, 5.4e-4 without.
    let place = |c: DVec2| DVec3::new(0.05 * (7.0 * c.x + 3.0 * c.y).sin(), c.y, c.x);
    let mut scene = scene(grid(8, 8, 0.125, place), isotropic(SOFT, 0.3), &[0]);
    let start = crumpled(&scene, 0.004);
    let targets = vec![start[0]];
    let [first_order, bdf2, alpha] = INTEGRATORS.map(|integrator| (integrator, None, 240, 1e-6));
    let long = [None, Some(0.0)].map(|damping| (BDF2, damping, 60, 1e-3));
    for (integrator, damping, rate, most) in [first_order, bdf2, alpha].into_iter().chain(long) {
        scene.physics.integrator = integrator;
        scene.physics.least_damping = damping;
        let mut simulator = Simulator::with_state(&scene, start.clone(), noise(81, 0.3)).unwrap();
        let first = energy(&simulator);
        let mut lowest = first;
        for step in 0..2 * rate.max(120) {
            simulator.substep(1.0 / f64::from(rate), &targets).unwrap();
            let now = energy(&simulator);
            assert!(
                now <= lowest + most * first.abs(),
                "{integrator:?} step {step}: {lowest} J to {now} J"
            );
            lowest = lowest.min(now);
        }
        assert!(lowest < first - 0.1, "{first} J to {lowest} J");
    }
}

#[test]
fn every_integrator_has_its_order_in_positions_and_velocities() {
    // A small swing in air. Differences of runs with dt and dt/2 at the same time fall by 2 to the
    // order.
    let mesh = grid(4, 4, 0.25, |c| {
        DVec3::new(0.05 * (3.0 * c.x + 2.0 * c.y).sin(), c.y - 1.0, c.x - 0.5)
    });
    let mut scene = scene(mesh, isotropic(SOFT, 0.3), &[0, 4]);
    scene.environment.air_density = 1.0;
    for integrator in INTEGRATORS {
        scene.physics.integrator = integrator;
        let expected = f64::from(integrator.order());
        // In second order substeps so short that no prediction is projected.
        let counts = [400, 800, 1600, 3200].map(|count| count * integrator.order());
        let runs = counts.map(|steps| {
            let mut simulator = Simulator::new(&scene).unwrap();
            for _ in 0..steps {
                let dt = 0.2 / f64::from(steps);
                simulator.substep(dt, &held(&scene)).unwrap();
            }
            [simulator.positions_f64(), simulator.velocities_f64()].map(<[DVec3]>::to_vec)
        });
        let bounds = [0.1, if expected == 1.0 { 0.15 } else { 0.1 }];
        for (part, most) in bounds.into_iter().enumerate() {
            let points = [0, 1, 2].map(|k: usize| {
                let difference = largest_distance(&runs[k][part], &runs[k + 1][part]);
                ((0.2 / f64::from(counts[k])).ln(), difference.ln())
            });
            let order = slope(&points);
            assert!(
                (order - expected).abs() < most,
                "{integrator:?} {part}: {order}"
            );
        }
    }
}

#[test]
fn a_symmetric_sheet_stays_symmetric() {
    // Mesh, handles, start and (orthotropic) material are their own mirror images in the plane
    // z = 0.
    let fabrics: [Material; 2] = [material(GRAY), isotropic(SOFT, 0.3)];
    let cases = INTEGRATORS.map(|integrator| fabrics.clone().map(|fabric| (integrator, fabric)));
    for (integrator, fabric) in cases.into_iter().flatten() {
        let side = 8;
        let mesh = grid(side, side, 1.0 / side as f64, |c| {
            let (y, z) = (c.y - 1.0, c.x - 0.5);
            DVec3::new(0.02 * (4.0 * z).cos() * (3.0 * y).sin(), y, z)
        });
        let mut scene = scene(mesh, fabric, &[0, side as u32]);
        scene.environment.air_density = 1.0;
        scene.physics.integrator = integrator;
        let mut simulator = Simulator::new(&scene).unwrap();
        for _ in 0..120 {
            simulator.substep(1.0 / 240.0, &held(&scene)).unwrap();
        }
        let x = simulator.positions_f64();
        let mirrored: Vec<DVec3> = (0..x.len())
            .map(|v| {
                let (row, column) = (v / (side + 1), v % (side + 1));
                let other = x[row * (side + 1) + side - column];
                DVec3::new(other.x, other.y, -other.z)
            })
            .collect();
        // Rounding, 1e-16, grows where the sheet folds up; half a second is too short for more than
        // a few powers of ten.
        assert!(largest_distance(x, &mirrored) < 1e-9);
    }
}
