//! Cloth that lies still is not solved, until something that acts on it changes.

use glam::DVec3;
use selvedge_cloth::{Gust, HandleTargets, Handles, Rigid, Scene, Stepper};
use selvedge_sim::Simulator;

use crate::touching::{GRAVITY, ground, led, lying, sphere};

/// A sheet of 25 vertices, 1 m wide, that falls onto the ground by 3 mm.
fn fallen() -> Scene {
    let mut scene = lying(5, |p| p + DVec3::Y * 0.003);
    scene.obstacles = vec![ground(0.0)];
    scene
}

fn targets(simulator: &Simulator) -> HandleTargets {
    HandleTargets::at_frame_end(simulator.handle_places()).unwrap()
}

fn step(simulator: &mut Simulator, frames: usize) {
    for _ in 0..frames {
        let targets = targets(simulator);
        simulator.step(&targets).unwrap();
    }
}

fn resting(simulator: &Simulator) -> u64 {
    simulator.stats().contact.resting
}

/// A simulator whose cloth rests, at the latest after eight seconds.
fn at_rest(scene: &Scene) -> Simulator {
    let mut simulator = Simulator::new(scene).unwrap();
    while resting(&simulator) == 0 {
        assert!(simulator.frame() < 480, "it never rests");
        step(&mut simulator, 1);
    }
    simulator
}

#[test]
fn nothing_is_solved_while_a_cloth_rests() {
    let mut simulator = at_rest(&fallen());
    let (places, solves) = (
        simulator.positions().to_vec(),
        simulator.stats().contact.solves,
    );
    step(&mut simulator, 100);
    assert_eq!(simulator.positions(), places);
    assert_eq!(simulator.stats().contact.solves, solves);
    assert_eq!(simulator.kinetic_energy(), 0.0);
    // The ground bears it, in a run that is taken up too.
    let mass: f64 = simulator.vertex_mass().iter().sum();
    let weight = mass * GRAVITY / 60.0;
    let bears = |simulator: &Simulator| -simulator.obstacle_impulses()[0].y / weight;
    assert!(
        (bears(&simulator) - 1.0).abs() < 0.01,
        "{}",
        bears(&simulator)
    );
    let mut taken_up = Simulator::from_checkpoint(&fallen(), &simulator.checkpoint()).unwrap();
    step(&mut taken_up, 1);
    step(&mut simulator, 1);
    assert!(
        (bears(&taken_up) - 1.0).abs() < 0.01,
        "{}",
        bears(&taken_up)
    );
    assert!(taken_up.checkpoint() == simulator.checkpoint());
}

#[test]
fn a_run_that_is_taken_up_falls_asleep_in_the_same_frame() {
    let scene = fallen();
    let first = at_rest(&scene).frame();
    let mut simulator = Simulator::new(&scene).unwrap();
    step(&mut simulator, first - 20);
    let state = simulator.checkpoint();
    assert!(!state.contact.as_ref().unwrap().still.is_empty());
    let mut taken_up = Simulator::from_checkpoint(&scene, &state).unwrap();
    step(&mut simulator, 25);
    step(&mut taken_up, 25);
    assert_eq!(resting(&taken_up), resting(&simulator));
    assert!(taken_up.checkpoint() == simulator.checkpoint());
}

/// Checks that a cloth that rests moves by more than `least` `[m]` once `wake` was called.
fn wakes(scene: &Scene, least: f64, frames: usize, wake: impl Fn(&mut Simulator)) {
    let mut simulator = at_rest(scene);
    step(&mut simulator, 5);
    let before = simulator.positions_f64().to_vec();
    wake(&mut simulator);
    step(&mut simulator, frames);
    let ways = before.iter().zip(simulator.positions_f64());
    let most = ways.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!(most > least, "{most}");
}

#[test]
fn a_body_wakes_it() {
    let ball = |y: f64| sphere(DVec3::new(0.02, y, 0.01), 0.05, 2);
    let mut scene = fallen();
    scene.obstacles.push(ball(0.3));
    wakes(&scene, 0.003, 1, |simulator| {
        for frame in 0..30 {
            simulator
                .lead_obstacle(1, DVec3::new(0.01 * f64::from(frame), -0.2495, 0.0))
                .unwrap();
            step(simulator, 1);
        }
    });
    // A body that is put elsewhere at once bears no more.
    let away = Rigid::from(DVec3::Y * -0.5);
    wakes(&fallen(), 0.01, 20, |simulator| {
        simulator.put_obstacle(0, away).unwrap()
    });
    // One that moves by itself later.
    let mut scene = fallen();
    let path = [
        (0.0, DVec3::ZERO),
        (20.0, DVec3::ZERO),
        (20.5, DVec3::Y * -0.2495),
    ];
    scene.obstacles.push(led(ball(0.3), &path));
    let mut simulator = at_rest(&scene);
    let frames = 1260 - simulator.frame();
    step(&mut simulator, frames);
    assert!(simulator.stats().contact.resting > 600);
    assert!(simulator.kinetic_energy() > 0.0);
}

#[test]
fn air_and_hands_wake_it() {
    let mut scene = fallen();
    scene.environment.air_density = 1.2;
    scene.environment.gust = Some(Gust {
        speed: DVec3::splat(0.01),
        period: 4.0,
        seed: 1,
    });
    let mut simulator = Simulator::new(&scene).unwrap();
    step(&mut simulator, 300);
    assert_eq!(resting(&simulator), 0, "a gust blows");
    let mut scene = fallen();
    scene.handles = Handles::new(&[0], 25).unwrap();
    wakes(&scene, 0.05, 1, |simulator| {
        for _ in 0..30 {
            let places = simulator.handle_places().into_iter();
            let lifted = places.map(|p| p + DVec3::Y * 0.002).collect();
            let targets = HandleTargets::at_frame_end(lifted).unwrap();
            simulator.step(&targets).unwrap();
        }
    });
}

#[test]
fn a_cloth_that_swings_never_rests() {
    let mut scene = fallen();
    scene.handles = Handles::new(&[0, 4], 25).unwrap();
    scene.obstacles = vec![ground(0.0)];
    let lifted = scene.mesh.positions().iter().map(|p| *p + DVec3::Y);
    scene.mesh = scene.mesh.clone().with_positions(lifted.collect()).unwrap();
    let mut simulator = Simulator::new(&scene).unwrap();
    step(&mut simulator, 120);
    assert_eq!(resting(&simulator), 0);
}
