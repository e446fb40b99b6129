//! Calls as C makes them: wrong handles, wrong counts, panics, threads.

use std::ffi::{CStr, c_char, c_void};
use std::ptr;

use glam::Vec3;
use selvedge_cloth::{Handles, Scene, StepError, Topology};

use super::*;
use crate::models::selvedge_model_open;
use crate::process::selvedge_last_error;
use crate::scenes::{selvedge_scene_free, selvedge_scene_open, selvedge_scene_warnings};
use crate::snapshots::{
    selvedge_snapshot_free, selvedge_stepper_reset, selvedge_stepper_restore,
    selvedge_stepper_snapshot,
};

/// A small scene that is at rest at once.
const SMALL: &str = "name = \"small\"\nstart = \"mesh\"\nmaterial = \"gray-interlock\"\n\
    mesh = { generator = { kind = \"square\", vertices = 25, size = 0.5, seed = 1 } }\n\
    handles = { label = \"upper-corners\" }\nmotion = { named = \"forward\" }\n";

fn words() -> String {
    let words = unsafe { CStr::from_ptr(selvedge_last_error()) };
    words.to_str().unwrap().to_owned()
}

fn scene() -> SelvedgeScene {
    scene_of(SMALL)
}

fn scene_of(text: &str) -> SelvedgeScene {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("small.toml");
    std::fs::write(&path, text).unwrap();
    let text = std::ffi::CString::new(path.to_str().unwrap()).unwrap();
    let mut handle = 0;
    let status = unsafe { selvedge_scene_open(text.as_ptr(), &raw mut handle) };
    assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
    handle
}

fn physics(scene: SelvedgeScene) -> SelvedgeStepper {
    let mut stepper = 0;
    let status = unsafe { selvedge_stepper_physics(scene, ptr::null(), &raw mut stepper) };
    assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
    stepper
}

/// The shipped model on a scene, from the scene's rest pose.
fn learned(scene: SelvedgeScene) -> SelvedgeStepper {
    let (mut model, mut stepper) = (0, 0);
    let status = unsafe { selvedge_model_open(ptr::null(), &raw mut model) };
    assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
    let status = unsafe { selvedge_stepper_model(scene, model, 0, ptr::null(), &raw mut stepper) };
    assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
    stepper
}

fn positions(stepper: SelvedgeStepper, vertices: usize) -> Vec<f32> {
    let mut copied = vec![f32::NAN; 3 * vertices];
    let status = unsafe { selvedge_copy_positions(stepper, copied.as_mut_ptr(), vertices) };
    assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
    copied
}

/// A stepper with a defect: its second step panics.
struct Defective {
    scene: Scene,
    positions: Vec<Vec3>,
    frame: usize,
}

impl Stepper for Defective {
    fn topology(&self) -> &Topology {
        self.scene.mesh.topology()
    }

    fn handles(&self) -> &Handles {
        &self.scene.handles
    }

    fn positions(&self) -> &[Vec3] {
        &self.positions
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, _: &HandleTargets) -> Result<(), StepError> {
        self.frame += 1;
        assert!(self.frame < 2, "frame {} is one too many", self.frame);
        Ok(())
    }
}

#[test]
fn a_panic_becomes_an_error_and_leaves_a_handle_that_can_only_be_freed() {
    let scene = selvedge::Scene::named("default").unwrap();
    let built = Scene::clone(scene.built());
    let defective = Defective {
        positions: selvedge::rounded(built.mesh.positions()),
        scene: built,
        frame: 0,
    };
    let stepper = STEPPERS.keep(Run::of_stepper(&scene, Box::new(defective)).unwrap().into());
    assert_eq!(selvedge_step_along(stepper), SelvedgeStatus::Ok);
    assert_eq!(selvedge_step_along(stepper), SelvedgeStatus::Panic);
    assert!(words().contains("frame 2 is one too many"), "{}", words());
    for _ in 0..2 {
        assert_eq!(selvedge_step_along(stepper), SelvedgeStatus::Poisoned);
        let (mut lent, mut count) = (ptr::null(), 0);
        let status = unsafe { selvedge_positions(stepper, &raw mut lent, &raw mut count) };
        assert_eq!((status, count), (SelvedgeStatus::Poisoned, 0));
    }
    assert_eq!(selvedge_stepper_free(stepper), SelvedgeStatus::Ok);
    assert_eq!(selvedge_stepper_free(stepper), SelvedgeStatus::Freed);
}

/// What is wrong for a program in C, `examples/mistakes.c` shows; here, that nothing moves.
#[test]
fn wrong_counts_and_null_pointers_move_nothing() {
    let scene = scene();
    let stepper = physics(scene);
    let start = positions(stepper, 25);
    let (targets, lost) = ([0.0; 9], [f64::NAN; 6]);
    for (given, samples, handles, status) in [
        (targets.as_ptr(), 1, 3, SelvedgeStatus::Count),
        (targets.as_ptr(), 0, 2, SelvedgeStatus::Argument),
        (targets.as_ptr(), usize::MAX, 2, SelvedgeStatus::Argument),
        (ptr::null(), 1, 2, SelvedgeStatus::Argument),
        (lost.as_ptr(), 1, 2, SelvedgeStatus::Argument),
    ] {
        let found = unsafe { selvedge_step(stepper, given, samples, handles, ptr::null()) };
        assert_eq!(found, status, "{samples} {handles}");
    }
    let mut few = [0.0_f32; 3];
    let status = unsafe { selvedge_copy_positions(stepper, few.as_mut_ptr(), 1) };
    assert_eq!((status, few), (SelvedgeStatus::Count, [0.0; 3]));
    assert_eq!(positions(stepper, 25), start);
    let status = unsafe { selvedge_stepper_physics(scene, ptr::null(), ptr::null_mut()) };
    assert_eq!(status, SelvedgeStatus::Argument);
    assert!(words().contains("out is null"), "{}", words());
    // A cloth moves on when its scene is gone.
    assert_eq!(selvedge_step_along(scene), SelvedgeStatus::Handle);
    assert!(words().contains("found a scene"), "{}", words());
    assert_eq!(selvedge_scene_free(scene), SelvedgeStatus::Ok);
    assert_eq!(selvedge_scene_free(scene), SelvedgeStatus::Freed);
    assert_eq!(selvedge_step_along(stepper), SelvedgeStatus::Ok);
    selvedge_stepper_free(stepper);
}

#[test]
fn targets_of_the_motion_move_the_cloth_as_the_motion_does() {
    let scene = scene();
    let (along, led) = (physics(scene), physics(scene));
    let mut counts = unsafe { std::mem::zeroed::<SelvedgeCounts>() };
    let status = unsafe { selvedge_stepper_counts(led, &raw mut counts) };
    assert_eq!(status, SelvedgeStatus::Ok);
    let (samples, handles) = (counts.samples as usize, counts.handles as usize);
    assert!(samples > 0 && counts.vertices == 25 && handles == 2);
    let (mut targets, mut released) = (vec![0.0; samples * handles * 3], vec![9; handles]);
    for _ in 0..10 {
        assert_eq!(selvedge_step_along(along), SelvedgeStatus::Ok);
        let written = unsafe {
            let (targets, released) = (targets.as_mut_ptr(), released.as_mut_ptr());
            selvedge_motion_targets(led, targets, samples, handles, released)
        };
        assert_eq!((written, &released[..]), (SelvedgeStatus::Ok, &[0, 0][..]));
        let (given, free) = (targets.as_ptr(), released.as_ptr());
        let status = unsafe { selvedge_step(led, given, samples, handles, free) };
        assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
    }
    assert_eq!(positions(along, 25), positions(led, 25));
    let (mut lent, mut count) = (ptr::null(), 0);
    let status = unsafe { selvedge_positions(led, &raw mut lent, &raw mut count) };
    assert_eq!((status, count), (SelvedgeStatus::Ok, 25));
    let lent = unsafe { std::slice::from_raw_parts(lent, 75) };
    assert_eq!(lent, positions(led, 25));
    for handle in [along, led] {
        selvedge_stepper_free(handle);
    }
    selvedge_scene_free(scene);
}

/// Stops at the third unit, which `context` counts.
unsafe extern "C" fn stop_at_third(
    context: *mut c_void,
    _: *const c_char,
    done: u64,
    _: u64,
) -> i32 {
    unsafe { *context.cast::<u64>() = done };
    i32::from(done >= 3)
}

#[test]
fn a_listener_hears_of_the_rest_pose_and_stops_it() {
    let (mut scene, mut stepper, mut heard) = (0, 7, 0_u64);
    let name = c"default";
    let status = unsafe { selvedge_scene_open(name.as_ptr(), &raw mut scene) };
    assert_eq!(status, SelvedgeStatus::Ok);
    let listener = SelvedgeListener {
        hear: Some(stop_at_third),
        context: (&raw mut heard).cast(),
    };
    let status = unsafe { selvedge_stepper_physics(scene, &raw const listener, &raw mut stepper) };
    assert_eq!((status, stepper, heard), (SelvedgeStatus::Stopped, 0, 3));
    let mut needed = 0;
    let status = unsafe { selvedge_scene_warnings(scene, ptr::null_mut(), 0, &raw mut needed) };
    assert_eq!((status, needed), (SelvedgeStatus::Ok, 1));
    selvedge_scene_free(scene);
}

#[test]
fn a_model_rests_by_the_law_of_its_scene_whatever_was_made_before() {
    let at_rest = SMALL.replace("start = \"mesh\"\n", "");
    let alone = positions(learned(scene_of(&at_rest)), 25);
    let scene = scene_of(&at_rest);
    let by_physics = positions(physics(scene), 25);
    assert_eq!(positions(learned(scene), 25), alone);
    assert_eq!(positions(physics(scene), 25), by_physics);
    assert_eq!(by_physics, alone);
}

#[test]
fn a_stepper_goes_back_to_a_snapshot_and_to_its_beginning() {
    let at_rest = SMALL.replace("start = \"mesh\"\n", "");
    let scene = scene_of(&at_rest);
    let (solver, network) = (physics(scene), learned(scene));
    let mut taken = [0; 2];
    for (stepper, snapshot) in [solver, network].into_iter().zip(&mut taken) {
        let start = positions(stepper, 25);
        (0..3).for_each(|_| assert_eq!(selvedge_step_along(stepper), SelvedgeStatus::Ok));
        let status = unsafe { selvedge_stepper_snapshot(stepper, snapshot) };
        assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
        assert_eq!(selvedge_step_along(stepper), SelvedgeStatus::Ok);
        let there = positions(stepper, 25);
        let status = selvedge_stepper_restore(stepper, *snapshot);
        assert_eq!(status, SelvedgeStatus::Ok, "{}", words());
        assert_eq!(selvedge_step_along(stepper), SelvedgeStatus::Ok);
        assert_eq!(positions(stepper, 25), there);
        assert_eq!(selvedge_stepper_reset(stepper), SelvedgeStatus::Ok);
        assert_eq!(positions(stepper, 25), start);
    }
    let [of_solver, of_network] = taken;
    assert_eq!(
        selvedge_stepper_restore(solver, of_network),
        SelvedgeStatus::Argument
    );
    assert!(words().contains("another kind of stepper"), "{}", words());
    assert_eq!(
        selvedge_stepper_restore(solver, scene),
        SelvedgeStatus::Handle
    );
    assert_eq!(selvedge_snapshot_free(of_solver), SelvedgeStatus::Ok);
    assert_eq!(
        selvedge_stepper_restore(solver, of_solver),
        SelvedgeStatus::Freed
    );
    selvedge_snapshot_free(of_network);
    for stepper in [solver, network] {
        selvedge_stepper_free(stepper);
    }
    selvedge_scene_free(scene);
}

/// Threads with a cloth each are in `examples/mistakes.c`.
#[test]
fn threads_step_one_cloth_in_turn() {
    let scene = scene();
    let (shared, alone) = (physics(scene), physics(scene));
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(move || {
                for _ in 0..20 {
                    assert_eq!(selvedge_step_along(shared), SelvedgeStatus::Ok);
                    positions(shared, 25);
                }
            });
        }
    });
    (0..80).for_each(|_| assert_eq!(selvedge_step_along(alone), SelvedgeStatus::Ok));
    assert_eq!(positions(alone, 25), positions(shared, 25));
    for stepper in [alone, shared] {
        selvedge_stepper_free(stepper);
    }
    selvedge_scene_free(scene);
}

#[test]
fn a_body_receives_the_weight_of_what_lies_on_it() {
    let scene = scene_of(concat!(
        "name = 'lies'\nmaterial = { from = 'gray-interlock', density = 0.2 }\nstart = 'mesh'\n",
        "mesh = { generator = { kind = 'square', vertices = 25, size = 0.3, seed = 1 },",
        " transform = { rotation = { axis = [0, 0, 1], angle_deg = 90 } } }\n",
        "[[obstacles]]\nname = 'box'\nbox = { size = [2, 0.1, 2] }\n",
        "transform = { translation = [0, -0.051, 0] }\n"
    ));
    let stepper = physics(scene);
    for _ in 0..90 {
        assert_eq!(
            selvedge_step_along(stepper),
            SelvedgeStatus::Ok,
            "{}",
            words()
        );
    }
    let mut six = [f64::NAN; 6];
    let read = |six: &mut [f64; 6], bodies| unsafe {
        selvedge_copy_impulses(stepper, six.as_mut_ptr(), bodies)
    };
    assert_eq!(read(&mut six, 1), SelvedgeStatus::Ok, "{}", words());
    let weight = 0.2 * 0.09 * 9.8;
    assert!((60.0 * -six[1] / weight - 1.0).abs() < 0.01, "{six:?}");
    assert_ne!(read(&mut six, 2), SelvedgeStatus::Ok);
    assert!(words().contains("bodies"), "{}", words());
    selvedge_stepper_free(stepper);
    selvedge_scene_free(scene);
}

#[test]
fn a_cloth_is_set_elsewhere_by_a_matrix() {
    let stepper = physics(scene());
    let before = positions(stepper, 25);
    let mut matrix = glam::DMat4::from_translation(DVec3::X * 2.0).to_cols_array();
    let to = |matrix: &[f64; 16]| unsafe {
        selvedge_stepper_teleport(stepper, matrix.as_ptr(), ptr::null(), 0)
    };
    assert_eq!(to(&matrix), SelvedgeStatus::Ok, "{}", words());
    let after = positions(stepper, 25);
    for (before, after) in before.iter().zip(&after).step_by(3) {
        assert!((after - before - 2.0).abs() < 1e-6);
    }
    let led = unsafe { selvedge_stepper_lead_body(stepper, 0, matrix.as_ptr()) };
    assert_eq!(led, SelvedgeStatus::Argument);
    assert!(words().contains("there is no obstacle 0"), "{}", words());
    matrix[0] = 2.0;
    assert_ne!(to(&matrix), SelvedgeStatus::Ok);
    assert!(words().contains("without scale"), "{}", words());
    assert_ne!(
        unsafe { selvedge_stepper_teleport(stepper, ptr::null(), ptr::null(), 0) },
        SelvedgeStatus::Ok
    );
    assert_eq!(positions(stepper, 25), after);
    selvedge_stepper_free(stepper);
}
