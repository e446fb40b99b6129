//! Obstacles that are led by hand beside their own motion.

use glam::{DQuat, DVec3};
use selvedge_cloth::{
    ContactSettings, GeneralisedAlpha, HandleTargets, Handles, Integrator, LinearSolver, Rigid,
    Scene, StepError, Stepper,
};
use selvedge_sim::{Checkpoint, ContactCounts, FAR, Simulator};

use crate::scenes::{by_default, hanging, momentum, steps, still};
use crate::touching::{led, lying, none, sphere};

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
        simulator.lead_obstacle(0, offset).unwrap();
        simulator.step(&hold).unwrap();
        assert_eq!(simulator.intersection_count(), 0);
        assert_eq!(simulator.obstacle_offsets(), [offset.into()]);
        let moved = simulator.obstacle_points()[0] - ball[0];
        assert!(moved.distance(offset) < 1e-12);
    }
    assert!(depth(&simulator) < -0.1, "{}", depth(&simulator));
    // Where the cloth is, it cannot be put, and stays.
    let error = simulator.put_obstacle(0, DVec3::X * -0.5).unwrap_err();
    assert!(matches!(error, StepError::Intersections { .. }), "{error}");
    assert_eq!(simulator.obstacle_offsets(), [(DVec3::X * -0.4).into()]);
    let mut other = Simulator::new(&scene).unwrap();
    other.put_obstacle(0, DVec3::X * -0.6).unwrap();
    steps(&mut other, &hold, 30);
    assert!(depth(&other) > -0.05, "{}", depth(&other));
    // There is no second one.
    let missing = StepError::Obstacle {
        frame: 30,
        number: 1,
        count: 1,
    };
    let before = other.checkpoint();
    for refused in [
        other.lead_obstacle(1, DVec3::X),
        other.put_obstacle(1, DVec3::X),
        other.teleport(DVec3::X.into(), &[0, 1]),
    ] {
        assert_eq!(refused, Err(missing.clone()));
    }
    assert_eq!(other.checkpoint(), before);
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
        let obstacles = offsets.iter().map(|offset| (*offset).into()).collect();
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
    for (friction, radius) in [(0.0, None), (0.5, None), (0.5, Some(0.0)), (0.0, Some(0.3))] {
        let mut scene = lying(12, |p| p);
        scene.physics.integrator = radius.map_or(Integrator::Linearised, |radius| {
            Integrator::GeneralisedAlpha(GeneralisedAlpha {
                spectral_radius: Some(radius),
            })
        });
        scene.physics.solver = LinearSolver::Cholesky;
        scene.physics.substeps = 4;
        scene.environment.gravity = DVec3::ZERO;
        scene.contact.as_mut().unwrap().friction = friction;
        scene.obstacles = vec![sphere(DVec3::new(0.08, -0.2, 0.03), 0.15, 2)];
        let mut simulator = Simulator::new(&scene).unwrap();
        let (mut received, mut offset) = (DVec3::ZERO, DVec3::ZERO);
        for frame in 0..30_u32 {
            let speed = if frame < 12 { 3.0 } else { 1.0 };
            offset += DVec3::new(0.2, 1.0, 0.0) * (speed / 60.0);
            simulator.lead_obstacle(0, offset).unwrap();
            simulator.step(&none()).unwrap();
            received += simulator.obstacle_impulses()[0];
        }
        let counts = simulator.stats().contact;
        assert!(counts.repeated > 0, "{counts:?}");
        assert_eq!((counts.held_back, counts.divisions), (0, 0), "{counts:?}");
        let momentum = momentum(&simulator);
        assert!(momentum.y > 0.05, "{momentum}");
        let lost = (momentum + received).length() / momentum.length();
        assert!(lost < 1e-9, "{friction} {radius:?}: {lost} of {momentum}");
    }
}

#[test]
fn a_cloth_that_is_set_elsewhere_with_its_body_moves_on_as_it_would_have() {
    let scene = scene();
    let turn = DQuat::from_rotation_y(2.0);
    let to = Rigid::about(DVec3::new(0.3, 1.0, 0.2), turn, DVec3::new(2.0, 0.5, -1.0));
    let lead = |simulator: &mut Simulator, by: f64, place: Rigid| {
        simulator
            .lead_obstacle(0, place.after(&(DVec3::X * by).into()))
            .unwrap();
        let held = simulator.handle_places();
        let still = HandleTargets::at_frame_end(held).unwrap();
        simulator.step(&still).unwrap();
    };
    let mut here = Simulator::new(&scene).unwrap();
    let mut there = Simulator::new(&scene).unwrap();
    for frame in 1..=24 {
        let by = -0.4 * f64::from(frame) / 24.0;
        let place = if frame > 12 { to } else { Rigid::default() };
        if frame == 13 {
            // A body that is named twice goes along once.
            there.teleport(to, &[0, 0]).unwrap();
            assert_eq!(there.frame(), 12);
        }
        lead(&mut here, by, Rigid::default());
        lead(&mut there, by, place);
        assert_eq!(there.intersection_count(), 0);
    }
    let pairs = here.positions_f64().iter().zip(there.positions_f64());
    let off = pairs
        .map(|(here, there)| to.of(*here).distance(*there))
        .fold(0.0, f64::max);
    // Friction takes hold anew, and gravity is the same in both places.
    assert!(off < 3e-3, "{off}");
    // Into a body that stays it cannot go, and is as it was.
    let before = there.positions_f64().to_vec();
    let error = there
        .teleport((turn * DVec3::X * 0.1).into(), &[])
        .unwrap_err();
    assert!(matches!(error, StepError::Intersections { .. }), "{error}");
    let far = there.teleport((DVec3::X * f64::NAN).into(), &[]);
    assert!(matches!(far, Err(StepError::NonFinite { .. })), "{far:?}");
    assert_eq!(there.positions_f64(), before);
}

/// Handles that jump far within a frame: the search for a way ends after a bounded number of pairs, the error
/// says what helps, and that does help.
#[test]
fn a_leap_ends_after_a_bounded_search() {
    let side = 16;
    let count = (side * side) as u64;
    let mut scene = by_default(side);
    let upper: Vec<u32> = (0..side as u32).collect();
    scene.handles = Handles::new(&upper, side * side).unwrap();
    scene.contact = Some(ContactSettings::default());
    let mut simulator = Simulator::new(&scene).unwrap();
    steps(&mut simulator, &still(&scene), 5);
    let mut refused = 0;
    for leap in [DVec3::X * 12.0, DVec3::new(9.0, 3.0, 3.0), DVec3::Z * 12.0] {
        let before = simulator.snapshot().unwrap();
        let began = simulator.stats().contact;
        let places = simulator.handle_places();
        let there = places.iter().map(|place| *place + leap).collect();
        let moved = simulator.step(&HandleTargets::at_frame_end(there).unwrap());
        let pairs = |c: ContactCounts| c.certified + c.halved + c.uncertified;
        let pairs = pairs(simulator.stats().contact) - pairs(began);
        assert!(pairs < 300_000 * count, "{leap}: {}", pairs / count);
        if let Err(error) = moved {
            assert_eq!(simulator.handle_places(), places);
            assert!(error.to_string().contains("teleport the cloth"), "{error}");
            refused += 1;
        }
        simulator.rewind(&before).unwrap();
        simulator.teleport(leap.into(), &[]).unwrap();
        steps_in_place(&mut simulator, 2);
        simulator.rewind(&before).unwrap();
    }
    assert!(refused > 0);
}

/// Steps with the handles where they are.
fn steps_in_place(simulator: &mut Simulator, frames: usize) {
    for _ in 0..frames {
        let held = HandleTargets::at_frame_end(simulator.handle_places()).unwrap();
        simulator.step(&held).unwrap();
    }
}
