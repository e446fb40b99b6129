//! A run with contact goes on from its state bit for bit: on a slope that holds it, over a ball, in
//! a stack.

use glam::DVec3;
use selvedge_cloth::{ConjugateGradients, LinearSolver, Scene};
use selvedge_sim::Simulator;

use crate::touching::{OnSlope, copies, ground, lying, run, shrunk, sphere};

/// The same run, taken up from the state of `whole`; with what contact left, or without.
fn taken_up(scene: &Scene, whole: &Simulator, with_contact: bool) -> Simulator {
    let (x, v) = (whole.positions_f64(), whole.velocities_f64());
    let mut rest = Simulator::with_state(scene, x.to_vec(), v.to_vec()).unwrap();
    if let Some(previous) = whole.previous() {
        rest = rest.with_previous(&previous).unwrap();
    }
    if let Some((changes, seconds)) = whole.last_changes() {
        rest = rest.with_last_changes(changes, seconds).unwrap();
    }
    if with_contact {
        let memory = whole.contact_memory().unwrap();
        rest = rest.with_contact_memory(&memory).unwrap();
    }
    rest.at_frame(selvedge_cloth::Stepper::frame(whole))
}

/// Takes a run of `scene` up after each of `frames`, and compares it over ten more.
fn check(scene: &Scene, frames: &[usize]) {
    let mut differs = false;
    for &frame in frames {
        let mut whole = Simulator::new(scene).unwrap();
        run(&mut whole, frame);
        let mut rest = taken_up(scene, &whole, true);
        assert_eq!(rest.contact_memory(), whole.contact_memory());
        let mut forgetful = taken_up(scene, &whole, false);
        run(&mut whole, 10);
        run(&mut rest, 10);
        run(&mut forgetful, 10);
        let apart = whole.positions_f64() != rest.positions_f64();
        assert!(!apart, "{}: from frame {frame}", scene.name);
        assert_eq!(whole.velocities_f64(), rest.velocities_f64());
        assert_eq!(rest.contact_memory(), whole.contact_memory());
        differs |= whole.positions_f64() != forgetful.positions_f64();
    }
    assert!(differs, "{}: contact leaves nothing to test", scene.name);
}

#[test]
fn a_sheet_that_a_slope_holds_goes_on() {
    let slope = 20_f64.to_radians();
    let on = OnSlope {
        side: 5,
        slope,
        friction: 1.02 * slope.tan(),
        turn: 0.4,
        speed: 0.0,
        substeps: 4,
    };
    check(&on.scene(), &[1, 7, 30]);
}

/// A sheet that falls on a ball.
fn draped() -> Scene {
    let mut scene = lying(12, |p| p + DVec3::Y * 0.02);
    let ball = sphere(DVec3::new(0.05, -0.3, 0.0), 0.3, 2);
    scene.obstacles = vec![ball];
    scene
}

#[test]
fn a_sheet_over_a_ball_goes_on() {
    check(&draped(), &[5, 14, 25]);
}

#[test]
fn conjugate_gradients_go_on_from_the_last_solve() {
    let mut scene = draped();
    scene.name = "iterated".to_owned();
    scene.physics.solver = LinearSolver::ConjugateGradients(ConjugateGradients::default());
    check(&scene, &[5, 20]);
}

#[test]
fn a_stack_of_sheets_goes_on() {
    let mut scene = lying(5, |p| p * 0.3);
    let sheet = shrunk(&scene.mesh, 0.3);
    scene.name = "stack".to_owned();
    scene.mesh = copies(&sheet, 3, |copy, p| {
        let turn = glam::DQuat::from_rotation_y(0.2 * copy as f64);
        turn * p + DVec3::Y * (9e-4 * (copy + 1) as f64)
    });
    scene.handles = selvedge_cloth::Handles::new(&[], 75).unwrap();
    scene.obstacles = vec![ground(0.0)];
    check(&scene, &[1, 12]);
}
