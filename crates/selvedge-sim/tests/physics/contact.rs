//! Cloth that touches: draping, folding, momentum, threads, and that nothing ever intersects.

use glam::{DQuat, DVec3};
use selvedge_cloth::{ContactSettings, Handles, LinearSolver, Squeezed, StepError, Stepper};
use selvedge_sim::{Simulator, SimulatorError};

use crate::scenes::{BDF2, hanging, in_pool, momentum, moved, steps};
use crate::touching::{OnSlope, borne, copies, ground, led, lying, none, rest_gap, run, sphere};

/// Far off the origin single precision is coarser than the gap: no frame is given in which the cloth
/// meets the ball, as files have both, and the error says where it is.
#[test]
fn a_drape_far_away_is_refused_where_its_rounded_frames_meet() {
    refuses_far_away(DVec3::X * 2e4);
    // Where the rounded cloth meets the rounded ball, but not the exact one.
    refuses_far_away(DVec3::new(2999.5, 0.3, 0.0));
}

fn refuses_far_away(away: DVec3) {
    let mut scene = lying(16, |p| p + DVec3::Y * 0.31 + away);
    scene.obstacles = vec![sphere(away, 0.3, 3)];
    let mut simulator = Simulator::new(&scene).unwrap();
    let error = (0..60).find_map(|_| {
        let stepped = simulator.step(&none());
        assert_eq!(simulator.intersection_count(), 0);
        stepped.err()
    });
    let error = error.unwrap();
    assert!(matches!(error, StepError::Rounded { .. }), "{error}");
    assert!(error.to_string().contains("move the scene to the origin"));
}

#[test]
fn two_free_sheets_that_meet_keep_their_momentum() {
    // Both in one mesh: the second above the first, turned, and thrown at it.
    let mut scene = lying(6, |p| p);
    let turn = DQuat::from_rotation_y(0.5);
    let count = scene.mesh.positions().len();
    scene.mesh = copies(&scene.mesh, 2, |copy, p| match copy {
        0 => p,
        _ => turn * p + DVec3::Y * 0.01,
    });
    let positions = scene.mesh.positions().to_vec();
    scene.handles = Handles::new(&[], 2 * count).unwrap();
    scene.environment.gravity = DVec3::ZERO;
    scene.physics.solver = LinearSolver::Cholesky;
    let mut velocities = vec![DVec3::ZERO; count];
    velocities.extend(vec![DVec3::new(0.3, -1.0, 0.0); count]);
    let mut simulator = Simulator::with_state(&scene, positions, velocities).unwrap();
    let (before, energy) = (momentum(&simulator), simulator.kinetic_energy());
    run(&mut simulator, 30);
    let after = momentum(&simulator);
    let counts = simulator.stats().contact;

    assert!(counts.touching > 0 || counts.repeated > 0);
    assert!((after - before).length() < 1e-6 * before.length());
    assert!(simulator.kinetic_energy() < energy);
}

#[test]
fn any_number_of_threads_gives_the_same_bytes() {
    let mut scene = lying(46, |p| {
        DVec3::new(p.z, p.x + 0.55, 0.02 * (7.0 * p.x).sin())
    });
    scene.obstacles = vec![ground(0.0)];
    let [one, three] = [1, 3].map(|threads| {
        in_pool(threads, || {
            let mut simulator = Simulator::new(&scene).unwrap();
            steps(&mut simulator, &none(), 8);
            simulator.positions_f64().to_vec()
        })
    });
    assert!(one == three);
}

#[test]
fn what_cannot_be_is_said() {
    let mut scene = lying(8, |p| p);
    scene.obstacles = vec![ground(0.0)];
    let error = Simulator::new(&scene).err().unwrap();
    assert!(
        matches!(error, SimulatorError::Intersections { .. }),
        "{error}"
    );
    let words = error.to_string();
    assert!(words.contains("obstacle \"ground\""), "{error}");
    assert!(words.contains("take the obstacle away"), "{error}");
    // Folded along the middle, the halves tilted against each other.
    let mut scene = lying(8, |p| {
        let (x, z) = (p.x, p.z - 0.05);
        DVec3::new(x.abs(), x * z, p.z)
    });
    scene.obstacles.clear();
    let error = Simulator::new(&scene).err().unwrap();
    assert!(
        error.to_string().contains("start = \"untangle\""),
        "{error}"
    );
    let mut scene = lying(8, |p| p + DVec3::Y);
    scene.contact.as_mut().unwrap().thickness = 0.05;
    let error = Simulator::new(&scene).err().unwrap();
    let SimulatorError::Thickness { edge, .. } = error else {
        panic!("{error}");
    };
    let remedy = format!("write contact.thickness = {:.1e}", 0.24 * edge);
    assert!(error.to_string().contains(&remedy), "{error}");
    scene.contact.as_mut().unwrap().thickness = 0.24 * edge;
    assert!(Simulator::new(&scene).is_ok());
}

/// A handle led through a body is an error that names both, and the cloth stays where it was. An
/// obstacle that is suddenly within the cloth, or on its other side, has gone there straight within
/// a frame, at 18 and 36 m/s: the cloth is pushed along.
#[test]
fn a_led_handle_is_said_and_a_leap_of_an_obstacle_pushes() {
    let (aside, at_once) = (DVec3::X * 0.3, 1.0 / 60.0);
    let still = sphere(DVec3::new(0.25, 0.0, -0.5), 0.1, 2);
    let ball = |to: DVec3| {
        let keys = [(0.0, aside), (at_once, aside), (2.0 * at_once, to)];
        led(sphere(DVec3::Y * -0.5, 0.1, 2), &keys)
    };
    // A frame takes the handle by 2 cm, the ball by 0.3 m into the sheet, or by 0.6 m through it.
    let cases = [
        (still, 0.02, 0.0),
        (ball(DVec3::ZERO), 0.0, -0.08),
        (ball(-aside), 0.0, -0.35),
    ];
    for (obstacle, speed, pushed) in cases {
        let mut scene = hanging(12);
        scene.contact = Some(ContactSettings {
            squeezed: Squeezed::Stop,
            ..ContactSettings::default()
        });
        scene.obstacles = vec![obstacle];
        let mut simulator = Simulator::new(&scene).unwrap();
        for frame in 1..=30 {
            let led = DVec3::X * (speed * f64::from(frame));
            let before = simulator.positions().to_vec();
            let step = simulator.step(&moved(&scene, led));
            assert_eq!(simulator.intersection_count(), 0, "{frame}");
            if let Err(error) = step {
                assert!(matches!(error, StepError::Contact { .. }), "{error}");
                let text = error.to_string();
                assert!(text.contains("obstacle \"sphere\""), "{text}");
                assert!(text.contains("vertex 0 "), "{text}");
                assert_eq!(simulator.positions(), before);
                break;
            }
        }
        let frame = simulator.frame();
        let least = simulator.positions().iter().map(|p| p.x);
        let least = least.fold(f32::INFINITY, f32::min);
        if speed > 0.0 {
            assert!((4..12).contains(&frame), "{frame}");
        } else {
            assert!(frame == 30 && f64::from(least) < pushed, "{frame} {least}");
        }
    }
}

/// Second order goes on where the same things touch.
#[test]
fn a_sheet_at_rest_or_sliding_keeps_its_second_order() {
    for (slope, speed) in [(0.0, 0.0), (0.0, 1.0)] {
        let on = OnSlope {
            side: 9,
            slope,
            friction: 0.3,
            turn: 0.3,
            speed,
            substeps: 4,
        };
        let mut scene = on.scene();
        scene.physics.integrator = BDF2;
        let start = scene.mesh.positions().to_vec();
        let velocities = vec![DVec3::X * speed; start.len()];
        let mut simulator = Simulator::with_state(&scene, start, velocities).unwrap();
        run(&mut simulator, 30);
        let stats = simulator.stats();
        assert!(stats.contact.touching >= 81, "{stats:?}");
        assert!(
            stats.substeps.fell_back <= stats.contact.solves / 20,
            "{stats:?}"
        );
    }
}

/// A sheet at rest on the ground stays where it is while another lands far off, in whose substeps
/// the first is taken by backward Euler too: what it rests on is as stiff in these.
#[test]
fn a_landing_elsewhere_does_not_shake_what_rests() {
    let mut scene = lying(5, |p| p);
    scene.physics.substeps = 4;
    let gap = rest_gap(0.0, 4);
    let count = scene.mesh.positions().len();
    scene.mesh = copies(&scene.mesh, 2, |copy, p| match copy {
        0 => p + DVec3::Y * gap,
        _ => p + DVec3::new(2.0, 0.02, 0.0),
    });
    scene.handles = Handles::new(&[], 2 * count).unwrap();
    scene.obstacles = vec![ground(0.0)];
    let mut simulator = borne(&scene, vec![DVec3::ZERO; 2 * count], count, gap, DVec3::Y);
    let start = simulator.positions_f64()[..count].to_vec();
    let mut strayed = 0.0_f64;
    for _ in 0..30 {
        run(&mut simulator, 1);
        let places = simulator.positions_f64().iter().zip(&start);
        strayed = places.fold(strayed, |most, (now, start)| most.max(now.distance(*start)));
    }
    assert!(simulator.stats().substeps.fell_back > 0);
    assert!(strayed < 1e-6, "{strayed}");
}

#[test]
fn contact_without_a_touch_changes_no_byte() {
    let mut apart = hanging(12);
    // Of one formula: that of the defaults is another one with contact.
    apart.physics.integrator = BDF2;
    let mut together = apart.clone();
    together.contact = Some(ContactSettings::default());
    let mut runs = [&apart, &together].map(|scene| Simulator::new(scene).unwrap());
    for frame in 1..=20 {
        let aside = DVec3::X * 0.1 * (0.1 * f64::from(frame)).sin();
        for simulator in &mut runs {
            simulator.step(&moved(&apart, aside)).unwrap();
        }
        assert_eq!(runs[0].positions_f64(), runs[1].positions_f64());
    }
    assert!(runs[1].stats().contact.certified > 0);
}
