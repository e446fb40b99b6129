//! The integrator: closed forms, conservation, handles, failures.

use glam::{DQuat, DVec3};
use selvedge_cloth::{HandleTargets, Handles, Integrator, Scene, Stepper};
use selvedge_sim::laws::external::slow_air;
use selvedge_sim::{Checkpoint, Simulator, SimulatorError};

use crate::scenes::{
    BDF2, INTEGRATORS, crumpled, floating, hanging, held, largest_distance, momentum, moved, noise,
};

const DT: f64 = 1.0 / 240.0;

/// Asserts that every vertex has fallen by `fall` `[m]` and has `velocity` `[m/s]`.
fn assert_falls(simulator: &Simulator, scene: &Scene, [fall, velocity]: [DVec3; 2], most: f64) {
    let start = scene.mesh.positions().iter();
    for (found, from) in simulator.positions_f64().iter().zip(start) {
        assert!(found.distance(*from + fall) < most, "{found}");
    }
    for found in simulator.velocities_f64() {
        assert!(found.distance(velocity) < most, "{found}");
    }
}

#[test]
fn free_fall_is_backward_eulers_or_a_parabola_in_second_order() {
    let mut scene = floating(5);
    let gravity = DVec3::new(0.0, -9.8, 1.0);
    scene.environment.gravity = gravity;
    scene.physics.integrator = Integrator::Linearised;
    let mut simulator = Simulator::new(&scene).unwrap();
    for _ in 0..25 {
        simulator.substep(DT, &[]).unwrap();
    }
    // v_n = n dt g, x_n = x_0 + dt² g (1 + 2 + … + n).
    let fallen = [DT * DT * f64::from(25 * 26 / 2), 25.0 * DT].map(|part| gravity * part);
    assert_falls(&simulator, &scene, fallen, 1e-12);
    for integrator in [BDF2, Integrator::default()] {
        scene.physics.integrator = integrator;
        let mut simulator = Simulator::new(&scene).unwrap();
        // Substeps of changing lengths: the formula keeps what is quadratic in time.
        let mut time = 0.0;
        for dt in [1.0, 1.0, 0.5, 0.5, 1.0, 0.125, 4.0, 2.0, 2.0].map(|part| DT * part) {
            simulator.substep(dt, &[]).unwrap();
            time += dt;
        }
        let fallen = [0.5 * time * time, time].map(|part| gravity * part);
        assert_falls(&simulator, &scene, fallen, 1e-13);
        let counts = simulator.stats().substeps;
        // The first one, and those of another length than the one before.
        assert_eq!((counts.all, counts.started, counts.fell_back), (9, 6, 0));
    }
}

#[test]
fn air_slows_a_flat_sheet_as_its_equation_says_in_second_order() {
    // w' = -k (w + v₀) w with w against the wind: w = v₀/((1 + v₀/w₀) exp(k v₀ t) - 1).
    let mut scene = floating(5);
    scene.environment.air_density = 1.2;
    scene.environment.wind = DVec3::new(0.5, 0.0, 0.0);
    let positions = scene.mesh.positions().to_vec();
    let velocity = DVec3::new(12.5, 0.0, 0.0);
    let rate = 1.2 / scene.material.density;
    let errors = [20_u32, 40, 80].map(|steps| {
        let start = vec![velocity; positions.len()];
        let mut simulator = Simulator::with_state(&scene, positions.clone(), start).unwrap();
        let time = 0.05;
        for _ in 0..steps {
            simulator.substep(time / f64::from(steps), &[]).unwrap();
        }
        let slow = slow_air(1.0);
        let exact = 0.5 + slow / ((1.0 + slow / 12.0) * (rate * slow * time).exp() - 1.0);
        let found = simulator.velocities_f64().iter();
        found.map(|v| (v.x - exact).abs()).fold(0.0, f64::max)
    });
    for pair in errors.windows(2) {
        let order = (pair[0] / pair[1]).log2();
        assert!((order - 2.0).abs() < 0.2, "{order} {errors:?}");
    }
    assert!(errors[2] < 5e-3, "{errors:?}");
}

#[test]
fn internal_forces_keep_the_momentum() {
    let mut scene = floating(6);
    let count = scene.mesh.positions().len();
    for integrator in INTEGRATORS {
        scene.physics.integrator = integrator;
        let mut simulator =
            Simulator::with_state(&scene, crumpled(&scene, 0.03), noise(count, 1.0)).unwrap();
        let before = momentum(&simulator);
        for _ in 0..10 {
            simulator.substep(DT, &[]).unwrap();
        }
        // 36 vertices of 5 g at about 1 m/s: rounding is 1e-16 of 0.2 kg m/s per sum and step.
        assert!(
            momentum(&simulator).distance(before) < 1e-13,
            "{integrator:?}"
        );
    }
}

#[test]
fn rigid_motion_of_the_scene_moves_the_answer() {
    let rotation = DQuat::from_scaled_axis(DVec3::new(0.3, -1.1, 0.7));
    let shift = DVec3::new(1.0, 2.0, -0.5);
    let scene = hanging(6);
    let (positions, velocities) = (crumpled(&scene, 0.02), noise(36, 0.5));
    let mut moved = scene.clone();
    moved.environment.gravity = rotation * scene.environment.gravity;
    let placed = |x: &[DVec3]| x.iter().map(|x| rotation * *x + shift).collect::<Vec<_>>();
    let turned = velocities.iter().map(|v| rotation * *v).collect();
    let mut moved = Simulator::with_state(&moved, placed(&positions), turned).unwrap();
    let mut simulator = Simulator::with_state(&scene, positions, velocities).unwrap();
    let (targets, moved_targets) = (held(&scene), placed(&held(&scene)));
    for _ in 0..4 {
        simulator.substep(DT, &targets).unwrap();
        moved.substep(DT, &moved_targets).unwrap();
    }
    let expected = placed(simulator.positions_f64());
    // Rounding of order 1e-15 grows with the conditioning of a few steps, not more.
    assert!(largest_distance(moved.positions_f64(), &expected) < 1e-11);
}

#[test]
fn a_frame_is_its_substeps() {
    let scene = hanging(5);
    let mut whole = Simulator::new(&scene).unwrap();
    let mut parts = Simulator::new(&scene).unwrap();
    let from = held(&scene);
    let to = moved(&scene, DVec3::new(0.02, 0.0, 0.01));
    whole.step(&to).unwrap();
    let substeps = scene.physics.substeps;
    for k in 1..=substeps {
        let between: Vec<DVec3> = from
            .iter()
            .zip(to.end())
            .map(|(from, to)| from.lerp(*to, f64::from(k) / f64::from(substeps)))
            .collect();
        parts
            .substep(1.0 / 60.0 / f64::from(substeps), &between)
            .unwrap();
    }
    assert_eq!((whole.frame(), parts.frame()), (1, 0));
    assert!(largest_distance(whole.positions_f64(), parts.positions_f64()) < 1e-14);
    for (rounded, position) in whole.positions().iter().zip(whole.positions_f64()) {
        assert_eq!(*rounded, position.as_vec3());
    }
}

#[test]
fn a_start_that_is_no_state_is_refused() {
    let scene = hanging(4);
    let mut positions = scene.mesh.positions().to_vec();
    let velocities = vec![DVec3::ZERO; 16];
    let error = Simulator::with_state(&scene, positions.clone(), vec![DVec3::ZERO; 3]).err();
    assert_eq!(
        error,
        Some(SimulatorError::Count {
            what: "velocities",
            expected: 16,
            found: 3
        })
    );
    positions[5].y = f64::NAN;
    let error = Simulator::with_state(&scene, positions, velocities)
        .err()
        .unwrap();
    assert!(matches!(error, SimulatorError::NonFinite { vertex, .. } if vertex.0 == 5));
}

#[test]
fn a_cloth_of_handles_alone_follows_them() {
    let mut scene = hanging(2);
    scene.handles = Handles::new(&[3, 0, 2, 1], 4).unwrap();
    let mut simulator = Simulator::new(&scene).unwrap();
    let targets: Vec<DVec3> = held(&scene).iter().map(|x| *x * 1.1).collect();
    simulator
        .step(&HandleTargets::at_frame_end(targets.clone()).unwrap())
        .unwrap();
    assert_eq!(scene.handles.select(simulator.positions_f64()), targets);
}

#[test]
fn a_cloth_taken_up_again_goes_on_as_a_new_one_there() {
    let mut scene = hanging(6);
    scene.environment.wind = DVec3::new(1.0, 0.0, 0.5);
    let targets = |frame: usize| moved(&scene, DVec3::new(0.002, 0.001, 0.0) * frame as f64);
    let mut used = Simulator::new(&scene).unwrap();
    // One handle let go on the way, which is held again where its path is.
    for frame in 1..=4 {
        let released = targets(frame).releasing(vec![false, frame > 2]).unwrap();
        used.step(&released).unwrap();
    }
    let positions = crumpled(&scene, 0.003);
    let velocities = noise(positions.len(), 0.1);
    let spoilt = vec![DVec3::NAN; positions.len()];
    let at = |x: &[DVec3], v: &[DVec3]| Checkpoint::of(7, x.to_vec(), v.to_vec());
    assert!(used.restore(&at(&positions, &spoilt)).is_err());
    assert!(used.restore(&at(&positions[1..], &velocities)).is_err());
    assert_eq!(used.frame(), 4);
    used.restore(&at(&positions, &velocities)).unwrap();
    let fresh = Simulator::with_state(&scene, positions, velocities).unwrap();
    let mut fresh = fresh.at_frame(7);
    for frame in 8..=10 {
        assert_eq!(used.positions(), fresh.positions());
        used.step(&targets(frame)).unwrap();
        fresh.step(&targets(frame)).unwrap();
    }
    assert_eq!(used.positions_f64(), fresh.positions_f64());
    assert_eq!(used.frame(), fresh.frame());
    // And from a checkpoint of its own, bit for bit.
    let kept = used.checkpoint();
    used.step(&targets(11)).unwrap();
    let there = used.checkpoint();
    used.restore(&kept).unwrap();
    assert_eq!(used.checkpoint(), kept);
    used.step(&targets(11)).unwrap();
    assert_eq!(used.checkpoint(), there);
}
