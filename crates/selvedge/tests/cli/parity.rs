//! Agreement with ARCSim, and what it needs: its scenes from the command line, runs that start from
//! saved states and keep theirs.
//!
//! `arcsim/` holds a scene, the mesh and two states (frames 120 and 180) of a run of ARCSim 0.3.1
//! in double precision: its own numbers, made once for this test.
use std::path::Path;

use crate::common::{PUSH, PUSH_FRAMES, TestFolder, number};
use selvedge_cloth::{Checkpoint, Stepper};
use selvedge_data::{StateChoice, StateRun, open_scene};
use selvedge_sim::Simulator;

/// A sheet of 3 x 3 vertices whose upper corners go forward, as ARCSim has it.
const SWING: &str = r#"{
    "frame_time": 0.016666666666666666, "frame_steps": 4, "end_frame": 12,
    "cloths": [{"mesh": "sheet.obj", "materials": [{"data": "gray-interlock.json"}]}],
    "handles": [{"nodes": [6, 8], "motion": 0}],
    "motions": [[{"time": 0}, {"time": 0.1}, {"time": 0.2, "transform": {"translate": [0, 0, 0.1]}}]],
    "gravity": [0, -9.8, 0], "wind": {"density": 1},
    "disable": ["proximity", "collision", "remeshing", "popfilter"]
}"#;

fn state(frame: usize) -> Checkpoint {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/arcsim");
    let choice = StateChoice {
        file: "states.npz".to_owned(),
        frame: Some(frame),
        ..StateChoice::default()
    };
    choice.read(&folder, 1024).unwrap().0
}

#[test]
fn sixty_frames_of_a_turning_sheet_are_arcsims() {
    let scene = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/arcsim/scene.json");
    let scene = open_scene(scene).unwrap().scene;
    let (start, end) = (state(120), state(180));
    let simulator = Simulator::with_state(&scene, start.positions, start.velocities);
    let mut simulator = simulator.unwrap().at_frame(120);
    let path = scene.handle_path().unwrap();
    for frame in 120..180 {
        let targets = path.targets(frame, scene.physics.substeps as usize);
        simulator.step(&targets.unwrap()).unwrap();
    }
    let found = simulator.positions_f64().iter().zip(&end.positions);
    let error = found.map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    // 240 solves that each agree to 4.5e-9 m and forget; over the whole run it was 9e-9 m.
    assert!(error < 1e-7, "{error:e} m");
}

fn swing() -> TestFolder {
    let dir = TestFolder::new();
    dir.write("swing.json", SWING);
    let mut mesh = String::new();
    for k in 0..9 {
        let (x, y) = (0.05 * f64::from(k % 3), 0.05 * f64::from(k / 3));
        mesh += &format!("v {x} {y} 0\nvt {x} {y}\n");
    }
    for k in [1, 2, 4, 5] {
        let corners = [k, k + 1, k + 4, k + 3].map(|v| format!("{v}/{v}"));
        mesh += &format!("f {}\n", corners.join(" "));
    }
    dir.write("sheet.obj", mesh);
    dir
}

#[test]
fn a_scene_of_arcsim_runs_from_where_its_mesh_stands() {
    let dir = swing();
    let said = dir.run("run swing.json -o run.safetensors");
    assert_eq!(said.code, Some(0), "{}", said.err);
    let material = "the shipped material gray-interlock";
    assert!(said.err.contains(material), "{}", said.err);
    let run = dir.trajectory("run.safetensors");
    assert_eq!(run.frame_count(), 13);
    assert_eq!(run.frame(0)[4].to_array(), [0.05, 0.05, 0.0]);
    // Spring handles lag behind their targets: by the force on them over 1000 N/m, for a sheet of 2
    // g that is accelerated by up to 60 m/s² at most 0.12 mm.
    let [before, after] = [run.frame(0)[6], run.frame(12)[6]];
    assert!((after.z - before.z - 0.1).abs() < 1.2e-4);
    let report = dir.json("info swing.json");
    assert_eq!(number(&report, "/frames"), 12.0);
    dir.json("run --rest swing.json -o rest.safetensors");
    for (key, words) in [
        (
            r#""frame_steps": "four""#,
            "frame_steps: invalid type | four",
        ),
        (r#""glow": 1, "frame_steps": 4"#, "unknown field | glow"),
    ] {
        dir.write("bad.json", SWING.replace(r#""frame_steps": 4"#, key));
        dir.refuses(&format!(
            "1 | run bad.json -o x.safetensors | bad.json | {words}"
        ));
    }
}

#[test]
fn a_run_goes_on_from_a_kept_state_bit_for_bit() {
    let dir = swing();
    dir.write("push.toml", PUSH);
    for (scene, frames) in [("push.toml", PUSH_FRAMES), ("swing.json", 12)] {
        dir.json(&format!(
            "run {scene} -o whole.safetensors --states whole-s.safetensors"
        ));
        let on = format!(
            "run {scene} -o on.safetensors --states on-s.safetensors --start whole-s.safetensors:7"
        );
        let report = dir.json(&on);
        assert_eq!(number(&report, "/first_frame"), 7.0);
        assert_eq!(number(&report, "/frames"), (frames - 7 + 1) as f64);
        let [whole, on] = ["whole-s.safetensors", "on-s.safetensors"]
            .map(|name| StateRun::from_bytes(&dir.read(name)).unwrap());
        assert_eq!(on.states, whole.states[7..]);
        let vertices = whole.states[0].positions.len();
        // The default looks back at the substep before, ARCSim's mode does not.
        let looks_back = scene == "push.toml";
        assert_eq!(whole.states[7].previous.is_some(), looks_back);
        let [long, short] =
            ["whole.safetensors", "on.safetensors"].map(|name| dir.trajectory(name));
        assert_eq!(short.positions(), &long.positions()[7 * vertices..]);
    }
    let report = dir.json("info whole-s.safetensors");
    assert_eq!(report["kind"], "states");
    dir.json("run push.toml -o on.safetensors --states own-s.safetensors");
    let start = "run push.toml -o on.safetensors --start";
    dir.refuses(&format!(
        "1 | {start} whole-s.safetensors:1 | array positions: expected [36, 3]
         1 | {start} own-s.safetensors:30 | 30 of them have passed
         1 | {start} own-s.safetensors:31 | own-s.safetensors | frames 0, 1, 2",
    ));
}

#[test]
fn a_scene_can_say_where_it_starts() {
    let dir = swing();
    dir.json("run swing.json -o run.safetensors --states states.safetensors");
    let scene = r#"
name = "on"
material = "gray-interlock"
mesh = { obj = "sheet.obj" }
handles = { vertices = [6, 8] }
motion = { inline = { kind = "blocks", blocks = [{ duration = 0.2 }] } }
physics = "arcsim"
"#;
    let start = "start = { state = { file = \"states.safetensors\", frame = 12 } }\n";
    dir.write("mesh.toml", format!("{scene}start = \"mesh\""));
    dir.write("on.toml", format!("{scene}{start}"));
    dir.json("run mesh.toml -o mesh.safetensors");
    dir.json("run on.toml -o on.safetensors --frames 3");
    let [swing, mesh, on] =
        ["run.safetensors", "mesh.safetensors", "on.safetensors"].map(|name| dir.trajectory(name));
    assert_eq!(mesh.frame(0), swing.frame(0));
    assert_eq!(on.frame(0), swing.frame(12));
    dir.write("none.toml", format!("{scene}{}", start.replace("12", "99")));
    let words = "none.toml | start.state | states.safetensors | frames 0, 1, 2";
    dir.refuses(&format!("1 | run none.toml -o on.safetensors | {words}"));
}
