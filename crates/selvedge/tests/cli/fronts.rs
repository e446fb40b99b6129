//! The same scenes by the program, the library for Rust, that for C and the viewer: the same bytes. Python's are
//! compared in `python/tests/test_same_bytes.py`, those of WebAssembly in `web/tests/module.mjs`.
#![allow(unsafe_code, reason = "the library for C is called as C calls it")]

use std::ffi::CString;
use std::ops::ControlFlow;
use std::ptr;

use selvedge::machine::Machine;
use selvedge::{Model, Run, Scene};
use selvedge_c::models::selvedge_model_open;
use selvedge_c::scenes::selvedge_scene_open;
use selvedge_c::status::SelvedgeStatus;
use selvedge_c::steppers::{
    selvedge_copy_positions, selvedge_step_along, selvedge_stepper_free, selvedge_stepper_model,
    selvedge_stepper_physics,
};

use selvedge_live::protocol::{VERSION, kind};
use selvedge_live::{EmbeddedSession, Mover, Opening, Order};
use selvedge_workshop::SceneWorkshop;

use crate::common::TestFolder;

/// Scenes of `tests/fronts`, and who moves them.
const RUNS: [(&str, Option<&str>); 8] = [
    ("substeps-1", None),
    ("substeps-3", None),
    ("substeps-8", None),
    ("garment", None),
    ("wind", None),
    ("let-go", None),
    ("substeps-3", Some("paper")),
    ("let-go", Some("paper")),
];
const FRAMES: usize = 36;

fn of_program(scene: &str, model: Option<&str>) -> Vec<f32> {
    let dir = TestFolder::new();
    let file = match model {
        None => {
            dir.json(&format!("run {scene} --frames {FRAMES} -o run.safetensors"));
            "run.safetensors"
        }
        Some(model) => {
            let by = format!("--model {model} --frames {FRAMES} --no-clip");
            dir.json(&format!("run {scene} {by} -o run"));
            "run/rollout.safetensors"
        }
    };
    let run = dir.trajectory(file);
    run.positions().iter().flat_map(|p| p.to_array()).collect()
}

fn of_rust(scene: &str, model: Option<&str>) -> Vec<f32> {
    let scene = Scene::named(scene).unwrap();
    let run = match model {
        None => Run::new(&scene),
        Some(name) => Run::of_model(&scene, &Model::open(Some(name.as_ref())).unwrap()),
    };
    let made = run
        .unwrap()
        .record(FRAMES, &mut |_| ControlFlow::Continue(()));
    made.positions.iter().flat_map(|p| p.to_array()).collect()
}

fn of_c(scene: &str, model: Option<&str>, vertices: usize) -> Vec<f32> {
    let ok = |status: SelvedgeStatus| assert_eq!(status, SelvedgeStatus::Ok);
    let text = |name: &str| CString::new(name).unwrap();
    let (mut opened, mut network, mut stepper) = (0, 0, 0);
    // SAFETY: the texts end with a zero byte, and the places may be written.
    unsafe {
        ok(selvedge_scene_open(text(scene).as_ptr(), &raw mut opened));
        match model {
            None => ok(selvedge_stepper_physics(
                opened,
                ptr::null(),
                &raw mut stepper,
            )),
            Some(name) => {
                ok(selvedge_model_open(text(name).as_ptr(), &raw mut network));
                let status =
                    selvedge_stepper_model(opened, network, 0, ptr::null(), &raw mut stepper);
                ok(status);
            }
        }
    }
    let mut all = vec![0.0; 3 * vertices * (FRAMES + 1)];
    for (frame, positions) in all.chunks_mut(3 * vertices).enumerate() {
        if frame > 0 {
            ok(selvedge_step_along(stepper));
        }
        // SAFETY: there is room for three numbers of each vertex.
        ok(unsafe { selvedge_copy_positions(stepper, positions.as_mut_ptr(), vertices) });
    }
    ok(selvedge_stepper_free(stepper));
    all
}

/// A recording of the scene's own motion, as a page orders it frame by frame.
fn of_viewer(scene: &str, model: Option<&str>) -> Vec<f32> {
    let dir = TestFolder::new();
    let workshop = SceneWorkshop::new(scene, &[], Machine::Cpu).unwrap();
    let order = Order {
        model: model.unwrap_or("paper").to_owned(),
        ..workshop.first_order()
    };
    let mover = if model.is_some() { Mover::Model } else { Mover::Physics };
    let opening = Opening {
        order,
        mover,
        replay: None,
    };
    let folder = Some(dir.path("recordings"));
    let mut session = EmbeddedSession::new(Box::new(workshop), opening, folder);
    // Makes the cloth ready; what follows is done as it is received.
    session.turn(&mut |_| {});
    let begin = [
        r#"{"do":"pause"}"#,
        r#"{"do":"motion","name":"scene"}"#,
        r#"{"do":"record"}"#,
    ];
    let steps = [r#"{"do":"step"}"#; FRAMES];
    for command in begin
        .iter()
        .chain(&steps)
        .chain(&[r#"{"do":"stop-recording"}"#])
    {
        let message = [&[VERSION, kind::COMMAND, 0, 0], command.as_bytes()].concat();
        session.receive(&message).unwrap();
    }
    let by = if model.is_some() { "model" } else { "physics" };
    let run = dir.trajectory(&format!("recordings/recording-1-{by}.safetensors"));
    run.positions().iter().flat_map(|p| p.to_array()).collect()
}

/// The first frame and vertex in which two runs differ.
fn apart(a: &[f32], b: &[f32], vertices: usize) -> Option<(usize, usize)> {
    assert_eq!(a.len(), b.len());
    let bits = |x: &f32| x.to_bits();
    let first = (0..a.len()).find(|k| bits(&a[*k]) != bits(&b[*k]))?;
    Some((first / (3 * vertices), first / 3 % vertices))
}

#[test]
fn the_same_scenes_have_the_same_bytes_by_every_front() {
    for (name, model) in RUNS {
        let scene = format!("{}/tests/fronts/{name}.toml", env!("CARGO_MANIFEST_DIR"));
        let wanted = of_program(&scene, model);
        let vertices = wanted.len() / 3 / (FRAMES + 1);
        let moved = |frame: usize| wanted[3 * vertices * frame] != wanted[0];
        assert!(moved(FRAMES), "{name}: nothing moves");
        let others = [
            ("Rust", of_rust(&scene, model)),
            ("C", of_c(&scene, model, vertices)),
            ("the viewer", of_viewer(&scene, model)),
        ];
        for (front, found) in others {
            let differ = apart(&wanted, &found, vertices);
            assert_eq!(differ, None, "{front}, {name} {model:?}");
        }
    }
}
