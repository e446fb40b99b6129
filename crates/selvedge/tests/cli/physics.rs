//! The physics from the command line: `simulate`, `sag`, `compare`, and `inspect` of what they
//! make.

use crate::common::{PUSH, PUSH_FRAMES, TestFolder, number};
use selvedge_data::{MeshOptions, open_scene, read_mesh, shipped_scenes};

#[test]
fn a_simulation_starts_at_rest_and_takes_the_handles_along() {
    let dir = TestFolder::with_push();
    let report = dir.json("run push.toml -o push.safetensors");
    let run = dir.trajectory("push.safetensors");
    assert_eq!(run.frame_count(), PUSH_FRAMES + 1);
    assert_eq!(number(&report, "/frames"), run.frame_count() as f64);
    assert_eq!(run.frame(0), run.cloth().rest_positions());
    let scene = open_scene(dir.path("push.toml").to_str().unwrap());
    let scene = scene.unwrap().scene;
    let path = scene.handle_path().unwrap();
    for frame in [0, 20, PUSH_FRAMES] {
        let expected = path.at(frame as f64 / 60.0);
        let found = run.handles().select(run.frame(frame));
        for (found, expected) in found.iter().zip(expected) {
            assert_eq!(*found, expected.as_vec3());
        }
    }
}

#[test]
fn a_run_says_how_many_substeps_fell_back_to_first_order() {
    let dir = TestFolder::with_push();
    let said = dir.run("run push.toml -o push.safetensors");
    let counts = "60, 1 started anew, 0 fell back";
    assert!(said.out.contains(counts), "{}", said.out);
    assert!(!said.err.contains("fell back"), "{}", said.err);
    // 4 m in a quarter of a second, in substeps of a sixtieth.
    let fast = PUSH.replace("distance = 0.2", "distance = 4.0");
    dir.write("fast.toml", format!("{fast}\n[physics]\nsubsteps = 1\n"));
    let report = dir.json("run fast.toml -o fast.safetensors --start mesh");
    assert_eq!(number(&report, "/substeps/all"), 30.0);
    assert_eq!(number(&report, "/substeps/started_anew"), 1.0);
    assert!(number(&report, "/substeps/fell_back") > 3.0, "{report}");
    let said = dir.run("run fast.toml -o fast.safetensors --start mesh");
    for words in [
        "of 30 substeps fell back to first order",
        "physics.substeps, 1 now",
    ] {
        assert!(said.err.contains(words), "{}", said.err);
    }
    let first = format!("{fast}\n[physics]\nintegrator = \"linearised\"\n");
    dir.write("first.toml", first);
    let report = dir.json("run first.toml -o first.safetensors --start mesh");
    assert!(report["substeps"].is_null());
}

#[test]
fn shipped_scenes_come_to_rest() {
    let dir = TestFolder::with_push();
    let held = shipped_scenes()
        .iter()
        .filter(|scene| scene.1.contains("handles ="));
    for (scene, _) in held {
        let report = dir.json(&format!("run --rest {scene} -o rest.obj"));
        assert!(number(&report, "/residual") <= 1e-3, "{scene}");
    }
}

#[test]
fn a_cloth_can_be_let_go_where_its_mesh_stands() {
    let dir = TestFolder::with_push();
    dir.json("run push.toml -o fall.safetensors --start mesh --frames 1");
    let run = dir.trajectory("fall.safetensors");
    let scene = open_scene(dir.path("push.toml").to_str().unwrap());
    let scene = scene.unwrap().scene;
    let start: Vec<_> = scene.mesh.positions().iter().map(|p| p.as_vec3()).collect();
    assert_eq!(run.frame(0), start);
    // Nobody waited for a rest pose: the start has its place.
    assert_eq!(run.cloth().rest_positions(), start);
}

#[test]
fn the_rest_pose_is_where_the_cloth_stays() {
    let dir = TestFolder::with_push();
    let still = PUSH.replace("distance = 0.2", "distance = 0.0");
    dir.write("still.toml", still);
    let report = dir.json("run --rest still.toml -o rest.safetensors");
    dir.json("run still.toml -o still.safetensors");
    let residual = number(&report, "/residual");
    assert!(residual <= 1e-3);
    let run = dir.trajectory("still.safetensors");
    let rest = dir.trajectory("rest.safetensors");
    assert_eq!(rest.frame_count(), 1);
    assert_eq!(rest.frame(0), run.frame(0));
    // As a mesh it is the same. The handles are at y = 0.
    let reported = dir.json("run --rest still.toml -o rest.obj");
    let read = read_mesh(&dir.path("rest.obj"), MeshOptions::default()).unwrap();
    let mesh = read.sheet.mesh;
    assert_eq!(mesh.topology(), rest.topology());
    let positions: Vec<_> = mesh.positions().iter().map(|p| p.as_vec3()).collect();
    assert_eq!(positions, rest.frame(0));
    let depths = positions.iter().map(|p| -f64::from(p.y));
    let lowest = depths.fold(0.0, f64::max);
    assert!((number(&reported, "/lowest") - lowest).abs() < 1e-6);
    assert!(number(&reported, "/middle_sag") > 0.0);
    // An acceleration of at most the residual over t = 0.5 s moves a vertex by residual t²/2 if
    // nothing pulls it back: 0.125 mm.
    let farthest = residual * 0.5 * 0.5 / 2.0;
    for (now, then) in run.frame(PUSH_FRAMES).iter().zip(rest.frame(0)) {
        assert!(f64::from(now.distance(*then)) <= farthest + 1e-6);
    }
}

/// The first scene of docs/src/guides/scenes.md, a flag, starts in its rest pose although it
/// flutters.
#[test]
fn the_first_scene_of_the_docs_runs() {
    let docs = include_str!("../../../../docs/src/guides/scenes.md");
    let scene = docs.split("```toml\n").nth(1).unwrap();
    let scene = scene.split("```").next().unwrap();
    assert!(scene.contains("wind"), "{scene}");
    let dir = TestFolder::new();
    dir.write("flag.toml", scene);
    let report = dir.json("run flag.toml -o flag.safetensors --frames 30");
    assert!(number(&report, "/sag_residual") <= 1e-3);
    // It hangs still at first and is then blown along x: a speed of the wind's order.
    let run = dir.trajectory("flag.safetensors");
    let mean = |frame: usize| {
        let x = run.frame(frame).iter().map(|p| f64::from(p.x));
        x.sum::<f64>() / run.vertex_count() as f64
    };
    assert!(mean(30) - mean(0) > 0.1, "{} {}", mean(0), mean(30));
}

#[test]
fn the_second_start_takes_the_rest_pose_from_the_cache() {
    let dir = TestFolder::new();
    let cache = dir.path("cache");
    let sag = |options: &str, cache: &std::path::Path| {
        let mut command = dir.command(&format!("run --rest square-1024 {options}"));
        let output = command.env("SELVEDGE_CACHE", cache).output().unwrap();
        assert!(output.status.success());
    };
    let poses = || std::fs::read_dir(cache.join("rest-poses")).map_or(0, Iterator::count);
    sag("-o none.safetensors --no-cache", &cache);
    assert_eq!(poses(), 0);
    sag("-o first.safetensors", &cache);
    assert_eq!(poses(), 1);
    sag("-o second.safetensors", &cache);
    sag("-o off.safetensors", std::path::Path::new("off"));
    assert_eq!(poses(), 1);
    let first = dir.read("first.safetensors");
    for other in ["none", "second", "off"] {
        let other = format!("{other}.safetensors");
        assert!(dir.read(&other) == first, "{other}");
    }
}

#[test]
fn handles_let_go_of_a_learned_cloth_too() {
    let dir = TestFolder::new();
    dir.model();
    let groups = "handles = { groups = [{ name = \"both\", select = { label = \"upper-corners\" }, \
        released = [{ from = 0.05 }] }] }";
    let scene = PUSH.replace("handles = { label = \"upper-corners\" }", groups);
    assert_ne!(scene, PUSH);
    dir.write("drop.toml", &scene);
    dir.json("run drop.toml -o drop.safetensors --frames 12");
    let run = dir.trajectory("drop.safetensors");
    let height = |frame: usize| run.handles().select(run.frame(frame))[0].y;
    assert_eq!(height(3), height(0));
    // Nine frames of free fall would be 0.11 m; the air and the cloth hold it up a little.
    assert!(height(12) < height(3) - 0.02);
    dir.json("run drop.toml --model run/model.safetensors -o out --frames 12");
    let rolled = dir.trajectory("out/rollout.safetensors");
    let corner = |frame: usize| rolled.handles().select(rolled.frame(frame))[0];
    assert_eq!(corner(3), run.handles().select(run.frame(3))[0]);
    assert_ne!(corner(12), corner(3));
}

#[test]
fn gusts_blow_on_a_learned_cloth_too() {
    let dir = TestFolder::with_push();
    dir.model();
    let windy = PUSH.replace(
        "name = \"push\"",
        "name = \"push\"\nenvironment = { gust = { speed = [3, 0, 0], period = 2, seed = 1 } }",
    );
    dir.write("windy.toml", windy);
    let rollout = |scene: &str| {
        let command = "--model run/model.safetensors -o out --frames 3 --guard none";
        dir.json(&format!("run {scene} {command}"));
        dir.trajectory("out/rollout.safetensors")
    };
    let [calm, windy] = ["push.toml", "windy.toml"].map(rollout);
    assert_eq!(windy.frame(0), calm.frame(0));
    assert_ne!(windy.frame(3), calm.frame(3));
}

#[test]
fn a_rollout_starts_at_rest_whatever_the_scene_says() {
    let dir = TestFolder::new();
    dir.write("mesh.toml", format!("start = \"mesh\"\n{PUSH}"));
    let report = dir.json("run --model paper --compare mesh.toml -o out --frames 1 --no-clip");
    let warning = report["warnings"][0].as_str().unwrap();
    assert!(warning.contains("sagged rest pose"), "{warning}");
    for name in ["rollout", "truth"] {
        let run = dir.trajectory(&format!("out/{name}.safetensors"));
        assert_eq!(run.frame(0), run.cloth().rest_positions(), "{name}");
        assert_eq!(run.provenance().scene.get("start"), None, "{name}");
    }
}

#[test]
fn a_state_goes_on_at_its_own_frame_rate_only() {
    let dir = TestFolder::with_push();
    dir.json("run push.toml -o run.safetensors --states states.safetensors --frames 2");
    let fast = format!("frame_rate = 120\n{PUSH}");
    let start = "start = { state = { file = \"states.safetensors\", frame = 2 } }";
    dir.write("fast.toml", &fast);
    dir.write("on.toml", format!("{start}\n{fast}"));
    let words = "states.safetensors | was saved at 60 | frame_rate = 60";
    dir.refuses(&format!(
        "1 | run fast.toml --start states.safetensors:2 -o on.safetensors | {words}
         1 | run on.toml -o on.safetensors | {words}",
    ));
}

#[test]
fn frames_before_one_that_fails_are_kept() {
    let dir = TestFolder::new();
    // A sheet lies on its way down on a ball, through which its middle is led.
    let scene = r#"
name = "led"
material = "gray-interlock"
start = "mesh"
mesh = { generator = { kind = "square", vertices = 49, size = 1.0, seed = 1 }, transform = { rotation = { axis = [0, 0, 1], angle_deg = 90 }, translation = [-0.5, 0.35, 0] } }
contact = { squeezed = "stop" }
obstacles = [{ name = "ball", sphere = { radius = 0.3 } }]
[[handles.groups]]
name = "middle"
select = { box = { min = [-0.1, 0.3, -0.1], max = [0.1, 0.4, 0.1] } }
[motion.groups]
duration = 1.0
[[motion.groups.moves]]
group = "middle"
keyframes = [{ time = 1.0, translation = [0, -0.7, 0] }]
"#;
    dir.write("led.toml", scene);
    let call = "run led.toml -o led.safetensors --states states.safetensors";
    let said = dir.run(call);
    assert_eq!(said.code, Some(1), "{}", said.err);
    for words in ["frame ", "\"ball\"", "the frames before", "led.safetensors"] {
        assert!(said.err.contains(words), "{words}: {}", said.err);
    }
    let trajectory = dir.trajectory("led.safetensors");
    let kept = trajectory.frame_count();
    assert!((2..61).contains(&kept), "{kept}");
    let last = kept - 1;
    let kept_frames = format!("up to {last}, are in");
    assert!(said.err.contains(&kept_frames), "{}", said.err);
    // They are those of a run that ends there.
    let report = dir.json(&format!(
        "run led.toml -o short.safetensors --frames {last}"
    ));
    assert!(report["failure"].is_null(), "{report}");
    assert_eq!(report["contact"]["intersections"], 0);
    let short = dir.trajectory("short.safetensors");
    assert_eq!(short.frame_count(), kept);
    assert_eq!(trajectory.frames(), short.frames());
}

#[test]
fn a_drape_is_measured_over_seeds_and_a_fabric_is_fitted_to_some() {
    let dir = TestFolder::new();
    let report = dir.json("drape test denim --vertices 150 --seeds 2");
    let pointer = |key: &str| number(&report, &format!("/fabrics/0/{key}"));
    assert!(
        (0.4..1.0).contains(&pointer("means/coefficient/0")),
        "{report}"
    );
    // D = ke: (6.4e-5 to 9.7e-5 N·m over 0.324 kg/m² × 9.8 m/s²)^(1/3).
    assert!(
        (0.027..0.033).contains(&pointer("bending_length/0")),
        "{report}"
    );
    let head = "fabric,sample,drape_coefficient,nodes,a2_mm,a3_mm,a4_mm,a5_mm,a6_mm,a7_mm,a8_mm";
    dir.write(
        "drapes.csv",
        format!("{head}\nlinen,1,0.9,2,1,1,1,1,1,1,1\n"),
    );
    let call = "drape fit drapes.csv --fabric linen --density 0.2 -o linen.toml --vertices 150";
    let fitted = dir.json(&format!("{call} --seeds 1 --tries 3"));
    assert_eq!(number(&fitted, "/tries"), 3.0);
    dir.run("drape test linen.toml --vertices 150 --seeds 1");
    dir.write("bare.csv", "fabric,sample\nlinen,1\n");
    let call = call.replace("drapes.csv", "bare.csv");
    dir.fails(&call, 1, &["bare.csv", "no column a2_mm"]);
}
