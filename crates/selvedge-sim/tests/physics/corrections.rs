//! States that are corrected from outside between two frames.

use glam::{DVec3, Vec3};
use selvedge_cloth::{Correctable, HandleTargets, Integrator, PhysicsSettings, Scene, Stepper};
use selvedge_sim::{Simulator, SimulatorError};

use crate::scenes::{floating, hanging, largest_distance, noise};

/// A hanging cloth by physics of second order.
fn scene(substeps: u32) -> Scene {
    let mut scene = hanging(5);
    scene.physics = PhysicsSettings {
        integrator: Integrator::SecondOrder,
        substeps,
        ..scene.physics
    };
    scene
}

fn run(simulator: &mut Simulator, scene: &Scene, frames: usize) {
    let still = scene.handles.select(scene.mesh.positions());
    let targets = HandleTargets::at_frame_end(still).unwrap();
    for _ in 0..frames {
        simulator.step(&targets).unwrap();
    }
}

#[test]
fn a_correction_by_nothing_changes_nothing() {
    for substeps in [1, 2, 3] {
        let scene = scene(substeps);
        let mut corrected = Simulator::new(&scene).unwrap();
        let mut other = Simulator::new(&scene).unwrap();
        for _ in 0..4 {
            let (x, v) = (corrected.positions_f64(), corrected.velocities_f64());
            let (x, v) = (x.to_vec(), v.to_vec());
            corrected.correct(&x, &v).unwrap();
            run(&mut corrected, &scene, 1);
            run(&mut other, &scene, 1);
            assert_eq!(corrected.positions_f64(), other.positions_f64());
            assert_eq!(corrected.velocities_f64(), other.velocities_f64());
        }
    }
}

#[test]
fn the_state_one_substep_ago_takes_its_part_of_a_correction() {
    for (substeps, part) in [(1, 0.0), (2, 0.5), (4, 0.75)] {
        let scene = scene(substeps);
        let mut simulator = Simulator::new(&scene).unwrap();
        run(&mut simulator, &scene, 3);
        let before = simulator.checkpoint().previous.unwrap();
        let [dx, dv] = [1e-3, 1e-2].map(|size| noise(25, size));
        let sum = |a: &[DVec3], b: &[DVec3], part: f64| -> Vec<DVec3> {
            a.iter().zip(b).map(|(a, b)| *a + part * *b).collect()
        };
        let x = sum(simulator.positions_f64(), &dx, 1.0);
        let v = sum(simulator.velocities_f64(), &dv, 1.0);
        simulator.correct(&x, &v).unwrap();
        assert_eq!(simulator.positions_f64(), x);
        assert_eq!(simulator.velocities_f64(), v);
        assert_eq!(simulator.positions()[7], x[7].as_vec3());
        let after = simulator.checkpoint().previous.unwrap();
        assert_eq!(after.seconds, before.seconds);
        // Sums of numbers of size 1.
        for (found, expected) in [
            (&after.positions, sum(&before.positions, &dx, part)),
            (&after.velocities, sum(&before.velocities, &dv, part)),
        ] {
            assert!(largest_distance(found, &expected) < 1e-14, "{substeps}");
        }
    }
}

/// The formula looks back: were the state one substep ago left where it was, the next substep would
/// take a replaced frame for motion.
#[test]
fn a_replaced_frame_is_not_taken_for_motion() {
    for integrator in [Integrator::SecondOrder, Integrator::default()] {
        let mut scene = floating(4);
        scene.physics.integrator = integrator;
        let mut simulator = Simulator::new(&scene).unwrap();
        let none = HandleTargets::at_frame_end(Vec::new()).unwrap();
        for _ in 0..3 {
            simulator.step(&none).unwrap();
        }
        // The whole cloth 6 cm aside: the velocity that goes with it is 3.6 m/s, and nothing acts.
        let aside = Vec3::new(0.06, 0.0, 0.0);
        let moved: Vec<Vec3> = simulator.positions().iter().map(|p| *p + aside).collect();
        simulator.replace_frame(&moved).unwrap();
        let first = simulator.velocities_f64()[0];
        assert!((first.x - 3.6).abs() < 1e-5, "{first}");
        for _ in 0..3 {
            simulator.step(&none).unwrap();
            for velocity in simulator.velocities_f64() {
                assert!(
                    velocity.distance(first) < 1e-4,
                    "{integrator:?}: {velocity}"
                );
            }
        }
    }
}

#[test]
fn the_state_one_substep_ago_is_shown_where_a_frame_was_divided_as_the_scene_says() {
    let scene = scene(2);
    let mut simulator = Simulator::new(&scene).unwrap();
    assert!(simulator.substep_before().is_none());
    run(&mut simulator, &scene, 2);
    let mut halfway = Simulator::new(&scene).unwrap();
    run(&mut halfway, &scene, 1);
    let still = scene.handles.select(scene.mesh.positions());
    halfway.substep(1.0 / 120.0, &still).unwrap();
    let (positions, velocities) = simulator.substep_before().unwrap();
    assert_eq!(positions, halfway.positions_f64());
    assert_eq!(velocities, halfway.velocities_f64());
    // A substep of another length is none of the scene's.
    halfway.substep(1.0 / 500.0, &still).unwrap();
    assert!(halfway.checkpoint().previous.is_some() && halfway.substep_before().is_none());
    simulator.forget_previous();
    assert!(simulator.substep_before().is_none());
}

#[test]
fn a_state_that_is_not_finite_is_refused_and_the_cloth_left_as_it_was() {
    let scene = scene(2);
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, &scene, 2);
    let (x, v) = (
        simulator.positions_f64().to_vec(),
        simulator.velocities_f64().to_vec(),
    );
    let before = simulator.checkpoint().previous;
    let mut wrong = v.clone();
    wrong[3].y = f64::NAN;
    let refused = simulator.correct(&vec![DVec3::ONE; 25], &wrong);
    assert!(matches!(refused, Err(SimulatorError::NonFinite { .. })));
    assert!(simulator.correct(&x[1..], &v).is_err());
    assert_eq!(simulator.positions_f64(), x);
    assert_eq!(simulator.velocities_f64(), v);
    assert_eq!(simulator.checkpoint().previous, before);
}

#[test]
fn a_step_that_forgets_is_that_of_a_fresh_simulator() {
    let scene = scene(1);
    let mut simulator = Simulator::new(&scene).unwrap();
    run(&mut simulator, &scene, 3);
    let (x, v) = (
        simulator.positions_f64().to_vec(),
        simulator.velocities_f64().to_vec(),
    );
    let mut fresh = Simulator::with_state(&scene, x, v).unwrap().at_frame(3);
    let mut mindful = Simulator::new(&scene).unwrap();
    run(&mut mindful, &scene, 4);
    simulator.forget_previous();
    assert!(simulator.checkpoint().previous.is_none());
    run(&mut simulator, &scene, 1);
    run(&mut fresh, &scene, 1);
    let apart = largest_distance(simulator.positions_f64(), fresh.positions_f64());
    assert!(apart < 1e-9, "{apart}");
    let apart = largest_distance(simulator.positions_f64(), mindful.positions_f64());
    assert!(apart > 1e-7, "{apart}");
}
