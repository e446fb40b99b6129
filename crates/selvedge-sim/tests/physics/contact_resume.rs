//! A run with contact goes on from its state bit for bit: on a slope that holds it, over a ball, in
//! a stack, with springs for handles, and with handles that have let go.

use glam::DVec3;
use selvedge_cloth::{HandleConstraint, Handles, Scene};
use selvedge_sim::{Checkpoint, Simulator};

use crate::releases::{released, run};
use crate::scenes::led_by;
use crate::touching::{OnSlope, copies, ground, lying, shrunk, sphere};

/// The parts of a state that a run is taken up without.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Without {
    Nothing,
    Contact,
    Changes,
}

/// The state ten frames after `state`, from which a run is taken up.
fn ten_more(scene: &Scene, mut state: Checkpoint, without: Without) -> Checkpoint {
    assert!(state.contact.is_some());
    match without {
        Without::Nothing => {}
        Without::Contact => state.contact = None,
        Without::Changes => state.changes = None,
    }
    let rest = Simulator::from_checkpoint(scene, &state).unwrap();
    let mut rest = rest.taken_up_at(state.frame).unwrap();
    run(&mut rest, scene, 10);
    rest.checkpoint()
}

/// Takes a run of `scene` up after each of `frames`, and compares it over ten more. Without
/// `needed` it differs.
fn check(scene: &Scene, frames: &[usize], needed: Without) {
    let mut whole = Simulator::new(scene).unwrap();
    let states = (0..=frames[frames.len() - 1] + 10).map(|_| {
        let state = whole.checkpoint();
        run(&mut whole, scene, 1);
        state
    });
    let states: Vec<Checkpoint> = states.collect();
    let mut differs = false;
    for &frame in frames {
        let (from, to) = (&states[frame], &states[frame + 10]);
        let rest = ten_more(scene, from.clone(), Without::Nothing);
        assert!(rest == *to, "{}: from frame {frame}", scene.name);
        differs = differs || ten_more(scene, from.clone(), needed).positions != to.positions;
    }
    assert!(differs, "{}: nothing depends on {needed:?}", scene.name);
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
    check(&on.scene(), &[1, 7, 30], Without::Contact);
}

/// A sheet of `side`² vertices that falls on a ball.
fn draped(side: usize) -> Scene {
    let mut scene = lying(side, |p| p + DVec3::Y * 0.02);
    let ball = sphere(DVec3::new(0.05, -0.3, 0.0), 0.3, 2);
    scene.obstacles = vec![ball];
    scene
}

#[test]
fn a_sheet_over_a_ball_goes_on() {
    check(&draped(12), &[5, 14, 25], Without::Contact);
}

/// The sheet over a ball with two corners that are led upwards and back, one that lets go.
fn led(side: usize) -> Scene {
    let mut scene = draped(side);
    scene.name = "led".to_owned();
    scene.handles = Handles::new(&[0, side as u32 - 1], side * side).unwrap();
    scene.motion = led_by(DVec3::new(0.1, 0.15, 0.05));
    released(scene, vec![1], 0.2, None)
}

/// Before, at and after one handle lets go. More substeps than samples of the path: where the path
/// is in between is told by where it was.
#[test]
fn handles_that_hold_and_let_go_go_on() {
    for (side, needed) in [(12, Without::Contact), (18, Without::Changes)] {
        for constraint in [HandleConstraint::Exact, HandleConstraint::Spring] {
            let mut scene = led(side);
            scene.physics.handles = constraint;
            scene.physics.substeps = 6;
            check(&scene, &[8, 12, 13, 20], needed);
        }
    }
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
    scene.handles = Handles::new(&[], 75).unwrap();
    scene.obstacles = vec![ground(0.0)];
    check(&scene, &[1, 12], Without::Contact);
}
