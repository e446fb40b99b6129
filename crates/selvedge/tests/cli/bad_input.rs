//! Bad input: each kind has an error that names file, field and remedy, the exit code 1 (2 where
//! the call itself is wrong), and leaves nothing behind.

use crate::common::{Desk, PUSH, contents};

/// A desk with [`PUSH`] in which `from` has become `to`.
fn desk_with(from: &str, to: &str) -> Desk {
    let desk = Desk::new();
    assert!(PUSH.contains(from), "{from}");
    desk.write("scene.toml", PUSH.replace(from, to));
    desk
}

/// Simulating `scene.toml` must fail with all of `words`, and leave only `names`.
fn refuses(desk: &Desk, words: &[&str]) {
    let names = desk.names();
    desk.fails("run scene.toml -o run.safetensors", 1, words);
    assert_eq!(desk.names(), names);
}

const GENERATOR: &str = r#"generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }"#;

/// Two triangles of a square metre.
const SQUARE_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

#[test]
fn a_missing_scene_is_named_with_those_that_are_shipped() {
    let desk = Desk::new();
    refuses(&desk, &["scene.toml", "default"]);
    desk.fails("info nothing.safetensors", 1, &["nothing.safetensors"]);
    desk.fails("compare a.safetensors b.safetensors", 1, &["a.safetensors"]);
    desk.fails("data generate none -o d", 1, &["none", "tiny"]);
    let known = ["none.safetensors", "no such file", "are: paper"];
    desk.fails("run --compare --model none.safetensors", 1, &known);
    assert_eq!(desk.names(), Vec::<String>::new());
}

#[test]
fn an_unknown_key_is_named() {
    let desk = desk_with("name = \"push\"", "name = \"push\"\ndampling = 3");
    refuses(&desk, &["scene.toml", "dampling"]);
}

#[test]
fn a_handle_that_the_mesh_does_not_have_is_refused() {
    let desk = desk_with("label = \"upper-corners\"", "vertices = [0, 36]");
    refuses(&desk, &["scene.toml", "36", "0 to 35"]);
    let desk = desk_with("upper-corners", "upper-left");
    refuses(&desk, &["upper-left", "upper-corners"]);
}

#[test]
fn a_motion_that_is_not_finite_is_refused() {
    let desk = desk_with("distance = 0.2", "distance = nan");
    refuses(&desk, &["scene.toml", "NaN"]);
}

#[test]
fn a_scene_without_handles_says_how_to_run_it() {
    let desk = desk_with(
        "handles = { label = \"upper-corners\" }",
        "start = \"rest\"\nhandles = { vertices = [] }",
    );
    refuses(&desk, &["no handles", "start = \"mesh\""]);
    desk.json("run scene.toml -o run.safetensors --start mesh --frames 2");
    let desk = desk_with("handles = { label = \"upper-corners\" }", "");
    let report = desk.json("run scene.toml -o run.safetensors --frames 2");
    assert!(
        report["warnings"][0]
            .as_str()
            .unwrap()
            .contains("falls freely")
    );
}

#[test]
fn a_sag_that_does_not_come_to_rest_says_what_to_change() {
    let desk = desk_with(
        "name = \"push\"",
        "name = \"push\"\nsag = { max_steps = 3 }",
    );
    refuses(&desk, &["sag.max_steps", "push"]);
    refuses(&desk, &["start = \"mesh\"", "start = \"fit\""]);
    // Where the rest pose is not needed for the run, it goes on without.
    let report = desk.json("run scene.toml -o run.safetensors --start mesh --frames 2");
    assert!(report["sag_solves"].is_null());
}

#[test]
fn two_outputs_are_never_one_file() {
    let desk = desk_with("name = \"push\"", "name = \"push\"");
    #[cfg(unix)]
    std::os::unix::fs::symlink("q.safetensors", desk.path("link.safetensors")).unwrap();
    std::fs::create_dir(desk.path("folder")).unwrap();
    let names = desk.names();
    for other in [
        "q.safetensors",
        "./q.safetensors",
        "folder/../q.safetensors",
        #[cfg(unix)]
        "link.safetensors",
    ] {
        for flag in ["--states", "--start"] {
            let call = format!("run scene.toml -o q.safetensors {flag} {other}");
            desk.fails(&call, 2, &["--output", flag, "the same file", other]);
        }
    }
    assert_eq!(desk.names(), names);
    desk.json("run scene.toml -o folder/q.safetensors --states q.safetensors --frames 1");
}

#[test]
fn no_output_takes_the_place_of_what_is_read() {
    let desk = desk_with(GENERATOR, "obj = \"sheet.obj\"");
    let scene = desk.text("scene.toml");
    let scene = scene.replace("label = \"upper-corners\"", "vertices = [2, 3]");
    desk.write("scene.toml", scene);
    desk.write("sheet.obj", SQUARE_OBJ);
    desk.write("push.toml", PUSH);
    desk.json("run push.toml -o run.safetensors --frames 2 --states states.safetensors");
    let start = "start = { state = { file = \"states.safetensors\", frame = 2 } }";
    desk.write("on.toml", format!("{start}\n{PUSH}"));
    desk.json("export run.safetensors -o hands.npz");
    let motion = PUSH.find("[motion.inline]").unwrap();
    let hands = "motion = { recorded = \"hands.npz\" }\n";
    desk.write("hands.toml", format!("{}{hands}", &PUSH[..motion]));
    std::fs::create_dir(desk.path("out")).unwrap();
    desk.write("out/rollout.safetensors", "a model");
    let before = contents(&desk.path(""));
    for call in [
        "run --rest scene.toml -o sheet.obj",
        // A point cache has its mesh beside it, as .obj.
        "run scene.toml -o x.safetensors --export sheet.pc2",
        "run on.toml -o states.safetensors",
        "run hands.toml -o x.safetensors --export ./hands.npz",
        "run --model paper --compare hands.toml --export hands.npz",
        "run --model paper --compare push.toml --export out/clip.gif",
        "run --compare push.toml --model out/rollout.safetensors",
        // A file of an earlier rollout would be removed, written anew or not.
        "run push.toml --model out/truth.safetensors",
        "export run.safetensors -o run.safetensors --format glb",
        "model convert out/rollout.safetensors --weights f16 -o out/./rollout.safetensors",
    ] {
        desk.fails(call, 2, &["the same file", "a name of its own"]);
        assert!(contents(&desk.path("")) == before, "{call}");
    }
    // What is read twice is no reason to refuse.
    desk.json("run on.toml -o x.safetensors --start states.safetensors:2");
}

#[test]
fn more_motions_at_random_than_can_be_meant_are_refused_at_once() {
    let desk = Desk::new();
    let many = format!(
        "name = \"many\"\nsections = \"whole\"\ntest = []\n\
        train = {{ set = \"all-training\", random = 4000000000 }}\n[setting]\n\
        material = \"gray-interlock\"\nhandles = {{ label = \"upper-corners\" }}\n\
        mesh = {{ {GENERATOR} }}\n"
    );
    desk.write("many.toml", many);
    let words = ["many.toml", "train.random", "100000"];
    desk.fails("info many.toml", 1, &words);
}

#[test]
fn a_cloth_that_starts_far_from_its_size_is_warned_of() {
    let desk = desk_with(GENERATOR, "obj = \"cloth.obj\"");
    let scene = desk.text("scene.toml");
    let scene = scene.replace("label = \"upper-corners\"", "vertices = [2, 3]");
    desk.write("scene.toml", &scene);
    // Two metres, and texture coordinates from 0 to 1.
    let cloth = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    desk.write("cloth.obj", cloth);
    let said = desk.run("run scene.toml -o run.safetensors --start mesh --frames 1 --json");
    assert_eq!(said.code, Some(0), "{}", said.err);
    for told in [&said.out, &said.err] {
        assert!(told.contains("2.000 × their material length"), "{told}");
        assert!(told.contains("mesh.texture ="), "{told}");
    }
    desk.write(
        "scene.toml",
        scene.replace("cloth.obj\"", "cloth.obj\", texture = \"fit\""),
    );
    let report = desk.json("info scene.toml");
    assert_eq!(report["warnings"].as_array().unwrap().len(), 0);
}

#[test]
fn files_that_are_cut_short_are_refused() {
    let desk = Desk::with_push();
    desk.model();
    desk.json("run push.toml -o run.safetensors --frames 2");
    for (file, short) in [
        ("run.safetensors", "short.safetensors"),
        ("run/model.safetensors", "weights.safetensors"),
    ] {
        let bytes = desk.read(file);
        desk.write(short, &bytes[..bytes.len() / 2]);
        desk.fails(&format!("info {short}"), 1, &[short]);
    }
    desk.fails(
        "compare run.safetensors short.safetensors",
        1,
        &["short.safetensors"],
    );
    desk.fails(
        "run --compare push.toml --model weights.safetensors -o out",
        1,
        &["weights.safetensors"],
    );
    desk.fails(
        "run --compare push.toml --model run.safetensors -o out",
        1,
        &["run.safetensors", "selvedge-trajectory", "no model"],
    );
    assert!(!desk.path("out").exists());
}

#[test]
fn trajectories_of_different_meshes_are_not_compared() {
    let desk = Desk::new();
    desk.write("a.toml", PUSH);
    desk.write("b.toml", PUSH.replace("vertices = 36", "vertices = 25"));
    desk.write("c.toml", PUSH.replace("seed = 1", "seed = 2"));
    for name in ["a", "b", "c"] {
        desk.json(&format!("run {name}.toml -o {name}.safetensors --frames 1"));
    }
    let compare = |other: &str, words: &[&str]| {
        desk.fails(
            &format!("compare a.safetensors {other}.safetensors"),
            1,
            words,
        );
    };
    compare("b", &["a.safetensors", "b.safetensors", "36 and 25"]);
    compare("c", &["different meshes", "other faces"]);
}

#[test]
fn a_place_that_cannot_be_written_is_found_before_the_work() {
    let desk = Desk::new();
    desk.write("scene.toml", PUSH);
    desk.write("file", "");
    std::fs::create_dir(desk.path("folder.safetensors")).unwrap();
    for (out, word) in [
        ("no/such/folder/run.safetensors", "no folder"),
        ("folder.safetensors", "folder"),
        ("file/run.safetensors", "no folder"),
    ] {
        desk.fails(&format!("run scene.toml -o {out}"), 1, &[out, word]);
    }
    desk.fails("data generate tiny -o file/d", 1, &["file/d"]);
    desk.fails("run scene.toml -o run.txt", 2, &["run.txt", ".safetensors"]);
    desk.fails(
        "run --rest scene.toml -o rest.stl",
        2,
        &[".safetensors or .obj"],
    );
    assert_eq!(desk.names(), ["file", "folder.safetensors", "scene.toml"]);
}

#[cfg(target_os = "linux")]
#[test]
fn a_write_that_fails_at_the_end_says_so() {
    let desk = Desk::new();
    desk.write("scene.toml", PUSH);
    std::os::unix::fs::symlink("/dev/full", desk.path("full.safetensors")).unwrap();
    desk.fails(
        "run scene.toml -o full.safetensors --frames 1",
        1,
        &["full.safetensors", "not a regular file"],
    );
    assert_eq!(desk.names(), ["full.safetensors", "scene.toml"]);
}

#[test]
fn what_is_nothing_of_ours_is_refused() {
    let desk = Desk::new();
    desk.write("a.safetensors", "no tensors");
    desk.write("a.xyz", "1 2 3");
    desk.write("a.toml", "name = [");
    desk.fails("info a.safetensors", 1, &["a.safetensors"]);
    desk.fails("info a.xyz", 1, &["a.xyz", ".safetensors"]);
    desk.fails("info a.toml", 1, &["a.toml", "line 1"]);
}

#[test]
fn a_folder_of_results_takes_no_results_of_another_kind() {
    let desk = Desk::with_push();
    desk.model();
    desk.json("data generate tiny -o part --shard 1/1");
    std::fs::create_dir_all(desk.path("studied/trainings")).unwrap();
    let before = ["tiny", "run", "studied"].map(|folder| contents(&desk.path(folder)));
    let data = "the folder holds a data set (index.json)";
    let run = "the folder holds a training (log.jsonl)";
    for (arguments, held) in [
        ("train moment.toml --data tiny -o tiny", data),
        ("train moment.toml --data tiny -o tiny --resume", data),
        ("train moment.toml --data tiny -o studied", "a study"),
        (
            "run --compare push.toml --model run/model.safetensors -o tiny",
            data,
        ),
        (
            "run --compare push.toml --model run/model.safetensors -o run",
            run,
        ),
        (
            "eval --model run/model.safetensors --data tiny -o tiny",
            data,
        ),
        ("eval --model run/model.safetensors --data tiny -o run", run),
        ("data generate tiny -o run", run),
        ("data merge part -o run", run),
        ("info tiny --picture tiny", data),
        ("info tiny --picture run", run),
        ("eval push.toml -o tiny --physics 1", data),
    ] {
        desk.fails(arguments, 1, &[held, "choose another folder"]);
    }
    let after = ["tiny", "run", "studied"].map(|folder| contents(&desk.path(folder)));
    assert!(before == after);
}
