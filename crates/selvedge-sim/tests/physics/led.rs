//! Obstacles that are led by hand beside their own motion.

use glam::DVec3;
use selvedge_cloth::{ContactSettings, Correctable, Scene, StepError, Stepper};
use selvedge_sim::{Checkpoint, FAR, Simulator};

use crate::scenes::{hanging, momentum, steps, still};
use crate::touching::{first_order, led, lying, none, sphere};

/// A hanging sheet beside a ball of 0.1 m that stands 0.3 m before it.
fn scene() -> Scene {
    let mut scene = hanging(10);
    scene.contact = Some(ContactSettings::default());
    scene.obstacles = vec![sphere(DVec3::new(0.3, -0.6, 0.0), 0.1, 2)];
    scene
}

fn depth(simulator: &Simulator) -> f32 {
    let deepest = simulator.positions().iter().map(|p| p.x);
    deepest.fold(f32::INFINITY, f32::min)
}

#[test]
fn a_ball_that_is_led_pushes_the_sheet_and_one_that_is_put_does_not_sweep_it() {
    let scene = scene();
    let mut simulator = Simulator::new(&scene).unwrap();
    let hold = still(&scene);
    let ball = simulator.obstacle_points();
    for frame in 1..=30 {
        let offset = DVec3::X * (-0.4 * f64::from(frame) / 30.0);
        simulator.lead_obstacle(0, offset);
        simulator.step(&hold).unwrap();
        assert_eq!(simulator.intersection_count(), 0);
        assert_eq!(simulator.obstacle_offsets(), [offset]);
        let moved = simulator.obstacle_points()[0] - ball[0];
        assert!(moved.distance(offset) < 1e-12);
    }
    assert!(depth(&simulator) < -0.1, "{}", depth(&simulator));
    // Where the cloth is, it cannot be put, and stays.
    let error = simulator.put_obstacle(0, DVec3::X * -0.5).unwrap_err();
    assert!(matches!(error, StepError::Intersections { .. }), "{error}");
    assert_eq!(simulator.obstacle_offsets(), [DVec3::X * -0.4]);
    let mut other = Simulator::new(&scene).unwrap();
    other.put_obstacle(0, DVec3::X * -0.6).unwrap();
    steps(&mut other, &hold, 30);
    assert!(depth(&other) > -0.05, "{}", depth(&other));
    // There is no second one.
    other.lead_obstacle(1, DVec3::X);
    other.put_obstacle(1, DVec3::X).unwrap();
}

#[test]
fn a_simulator_that_begins_later_looks_for_obstacles_where_they_are_then() {
    let mut scene = scene();
    // At first it stands in the sheet, after a second before it.
    let ball = scene.obstacles.remove(0);
    scene.obstacles = vec![led(ball, &[(0.0, DVec3::X * -0.3), (1.0, DVec3::ZERO)])];
    assert!(Simulator::new(&scene).is_err());
    let positions = scene.mesh.positions().to_vec();
    let rest = vec![DVec3::ZERO; positions.len()];
    let begin = |frame, offsets: &[DVec3]| {
        let obstacles = offsets.to_vec();
        let start = Checkpoint::of(frame, positions.clone(), rest.clone());
        Simulator::from_checkpoint(&scene, &Checkpoint { obstacles, ..start })
    };
    assert!(begin(0, &[]).is_err());
    assert!(begin(0, &[DVec3::X * 0.3]).is_ok());
    let later = begin(60, &[]).unwrap();
    assert_eq!(later.frame(), 60);
}

#[test]
fn gaps_of_vertices_are_to_what_is_near() {
    let scene = scene();
    let mut simulator = Simulator::new(&scene).unwrap();
    let far = simulator.vertex_gaps().unwrap();
    assert!(far.iter().all(|gap| *gap == FAR), "{far:?}");
    // The ball a centimetre before the sheet, which is flat.
    simulator.put_obstacle(0, DVec3::X * -0.19).unwrap();
    let near = simulator.vertex_gaps().unwrap();
    let least = near.iter().copied().fold(FAR, f64::min);
    // Its points lie on the sphere, and one of them need not be the foremost.
    assert!((0.0099..0.0125).contains(&least), "{least}");
    assert!(near.iter().filter(|gap| **gap < FAR).count() < near.len() / 2);
    assert!(Simulator::new(&hanging(4)).unwrap().vertex_gaps().is_none());
}

#[test]
fn a_body_receives_the_momentum_that_it_gives() {
    // A ball is led into a sheet that lies in empty space, for a while faster than its substeps
    // foresee, so that solves are repeated.
    for friction in [0.0, 0.5] {
        let mut scene = first_order(lying(12, |p| p));
        scene.environment.gravity = DVec3::ZERO;
        scene.contact.as_mut().unwrap().friction = friction;
        scene.obstacles = vec![sphere(DVec3::new(0.08, -0.2, 0.03), 0.15, 2)];
        let mut simulator = Simulator::new(&scene).unwrap();
        let (mut received, mut offset) = (DVec3::ZERO, DVec3::ZERO);
        for frame in 0..30_u32 {
            let speed = if frame < 12 { 3.0 } else { 1.0 };
            offset += DVec3::new(0.2, 1.0, 0.0) * (speed / 60.0);
            simulator.lead_obstacle(0, offset);
            simulator.step(&none()).unwrap();
            received += simulator.obstacle_impulses()[0];
        }
        let counts = simulator.stats().contact;
        assert!(counts.repeated > 0, "{counts:?}");
        assert_eq!((counts.held_back, counts.divisions), (0, 0), "{counts:?}");
        let momentum = momentum(&simulator);
        assert!(momentum.y > 0.05, "{momentum}");
        let lost = (momentum + received).length() / momentum.length();
        assert!(lost < 1e-6, "{friction}: {lost} of {momentum}");
    }
}

#[test]
fn a_step_that_is_undone_leaves_bodies_where_they_were() {
    let scene = scene();
    let hold = still(&scene);
    let [mut tried, mut other] = [(); 2].map(|()| Simulator::new(&scene).unwrap());
    for frame in 1..=20 {
        let offset = DVec3::X * (-0.3 * f64::from(frame) / 20.0);
        for simulator in [&mut tried, &mut other] {
            simulator.lead_obstacle(0, offset);
        }
        let before = tried.obstacle_points();
        tried.step(&hold).unwrap();
        tried.undo_step();
        assert_eq!(tried.obstacle_points(), before);
        // It is led on as before.
        tried.step(&hold).unwrap();
        other.step(&hold).unwrap();
        assert_eq!(tried.obstacle_points(), other.obstacle_points());
        assert_eq!(tried.positions_f64(), other.positions_f64(), "{frame}");
    }
    assert!(depth(&tried) < -0.05, "it was pushed");
}
