//! Bad input: each kind has an error that names file, field and remedy, the exit code 1 (2 where
//! the call itself is wrong), and leaves nothing behind.

use crate::common::{PUSH, TestFolder, rows};

/// A folder with [`PUSH`] in which `from` has become `to`.
fn folder_with(from: &str, to: &str) -> TestFolder {
    let dir = TestFolder::new();
    assert!(PUSH.contains(from), "{from}");
    dir.write("scene.toml", PUSH.replace(from, to));
    dir
}

/// Simulating `scene.toml` must fail with all of `words`, and leave only `names`.
fn refuses(dir: &TestFolder, words: &[&str]) {
    let names = dir.names();
    dir.fails("run scene.toml -o run.safetensors", 1, words);
    assert_eq!(dir.names(), names);
}

const GENERATOR: &str = r#"generator = { kind = "square", vertices = 36, size = 1.0, seed = 1 }"#;

/// Two triangles of a square metre.
const SQUARE_OBJ: &str = "v 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nf 1 2 3\nf 1 3 4\n";

#[test]
fn what_is_not_there_is_named_with_what_is_shipped() {
    TestFolder::new().refuses(
        "1 | run scene.toml -o run.safetensors | scene.toml | default
         1 | info nothing.safetensors | nothing.safetensors
         1 | info nothing | nothing | preset that ships
         1 | compare a.safetensors b.safetensors | a.safetensors
         1 | data generate none -o d | none | tiny
         1 | run --compare --model none.safetensors | none.safetensors | no such file | are: paper",
    );
}

#[test]
fn an_unknown_key_is_named() {
    let dir = folder_with("name = \"push\"", "name = \"push\"\ndampling = 3");
    refuses(&dir, &["scene.toml", "dampling"]);
}

#[test]
fn a_handle_that_the_mesh_does_not_have_is_refused() {
    let dir = folder_with("label = \"upper-corners\"", "vertices = [0, 36]");
    refuses(&dir, &["scene.toml", "36", "0 to 35"]);
    let dir = folder_with("upper-corners", "upper-left");
    refuses(&dir, &["upper-left", "upper-corners"]);
}

#[test]
fn a_motion_that_is_not_finite_is_refused() {
    let dir = folder_with("distance = 0.2", "distance = nan");
    refuses(&dir, &["scene.toml", "NaN"]);
}

#[test]
fn a_scene_without_handles_says_how_to_run_it() {
    let handles = "handles = { label = \"upper-corners\" }";
    let dir = folder_with(handles, "start = \"rest\"\nhandles = { vertices = [] }");
    refuses(&dir, &["no handles", "start = \"mesh\""]);
    dir.json("run scene.toml -o run.safetensors --start mesh --frames 2");
    let dir = folder_with(handles, "");
    let report = dir.json("run scene.toml -o run.safetensors --frames 2");
    let warning = report["warnings"][0].as_str().unwrap();
    assert!(warning.contains("falls freely"), "{warning}");
}

#[test]
fn a_sag_that_does_not_come_to_rest_says_what_to_change() {
    let name = "name = \"push\"";
    let dir = folder_with(name, &format!("{name}\nsag = {{ max_steps = 3 }}"));
    let words = [
        "sag.max_steps",
        "push",
        "start = \"mesh\"",
        "start = \"fit\"",
    ];
    refuses(&dir, &words);
    // Where the rest pose is not needed for the run, it goes on without.
    let report = dir.json("run scene.toml -o run.safetensors --start mesh --frames 2");
    assert!(report["sag_solves"].is_null());
}

#[test]
fn two_outputs_are_never_one_file() {
    let dir = folder_with("name = \"push\"", "name = \"push\"");
    #[cfg(unix)]
    std::os::unix::fs::symlink("q.safetensors", dir.path("link.safetensors")).unwrap();
    std::fs::create_dir(dir.path("folder")).unwrap();
    let names = dir.names();
    for other in [
        "q.safetensors",
        "./q.safetensors",
        "folder/../q.safetensors",
        #[cfg(unix)]
        "link.safetensors",
    ] {
        for flag in ["--states", "--start"] {
            let call = format!("run scene.toml -o q.safetensors {flag} {other}");
            dir.fails(&call, 2, &["--output", flag, "the same file", other]);
        }
    }
    assert_eq!(dir.names(), names);
    dir.json("run scene.toml -o folder/q.safetensors --states q.safetensors --frames 1");
}

#[test]
fn no_output_takes_the_place_of_what_is_read() {
    let dir = folder_with(GENERATOR, "obj = \"sheet.obj\"");
    let scene = dir.text("scene.toml");
    let scene = scene.replace("label = \"upper-corners\"", "vertices = [2, 3]");
    dir.write("scene.toml", scene);
    dir.write("sheet.obj", SQUARE_OBJ);
    dir.write("push.toml", PUSH);
    dir.json("run push.toml -o run.safetensors --frames 2 --states states.safetensors");
    let start = "start = { state = { file = \"states.safetensors\", frame = 2 } }";
    dir.write("on.toml", format!("{start}\n{PUSH}"));
    dir.json("export run.safetensors -o hands.npz");
    let motion = PUSH.find("[motion.inline]").unwrap();
    let hands = "motion = { recorded = \"hands.npz\" }\n";
    dir.write("hands.toml", format!("{}{hands}", &PUSH[..motion]));
    std::fs::create_dir(dir.path("out")).unwrap();
    dir.write("out/rollout.safetensors", "a model");
    for call in [
        "run --rest scene.toml -o sheet.obj",
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
        dir.refuses(&format!("2 | {call} | the same file | a name of its own"));
    }
    // A point cache has its mesh beside it, as .obj.
    dir.refuses(
        "1 | run scene.toml -o x.safetensors --export sheet.pc2 | sheet.obj | move it away",
    );
    // What is read twice is no reason to refuse.
    dir.json("run on.toml -o x.safetensors --start states.safetensors:2");
}

#[test]
fn more_motions_at_random_than_can_be_meant_are_refused_at_once() {
    let dir = TestFolder::new();
    let many = format!(
        "name = \"many\"\nsections = \"whole\"\ntest = []\n\
        train = {{ set = \"all-training\", random = 4000000000 }}\n[setting]\n\
        material = \"gray-interlock\"\nhandles = {{ label = \"upper-corners\" }}\n\
        mesh = {{ {GENERATOR} }}\n"
    );
    dir.write("many.toml", many);
    dir.refuses("1 | info many.toml | many.toml | train.random | 100000");
}

#[test]
fn a_cloth_that_starts_far_from_its_size_is_warned_of() {
    let dir = folder_with(GENERATOR, "obj = \"cloth.obj\"");
    let scene = dir.text("scene.toml");
    let scene = scene.replace("label = \"upper-corners\"", "vertices = [2, 3]");
    dir.write("scene.toml", &scene);
    // Two metres, and texture coordinates from 0 to 1.
    let cloth = "v 0 0 0\nv 2 0 0\nv 2 2 0\nv 0 2 0\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n\
        f 1/1 2/2 3/3\nf 1/1 3/3 4/4\n";
    dir.write("cloth.obj", cloth);
    let said = dir.run("run scene.toml -o run.safetensors --start mesh --frames 1 --json");
    assert_eq!(said.code, Some(0), "{}", said.err);
    for text in [&said.out, &said.err] {
        assert!(text.contains("2.000 × their material length"), "{text}");
        assert!(text.contains("mesh.texture ="), "{text}");
    }
    let file = dir.json("info cloth.obj");
    let text = rows(&file, "warnings")[0].as_str().unwrap();
    assert!(text.contains("2.000 × their material length"), "{text}");
    let fitted = scene.replace("cloth.obj\"", "cloth.obj\", texture = \"fit\"");
    dir.write("scene.toml", fitted);
    let report = dir.json("info scene.toml");
    assert_eq!(rows(&report, "warnings").len(), 0);
}

#[test]
fn files_that_are_cut_short_or_nothing_of_ours_are_refused() {
    let dir = TestFolder::with_push();
    dir.model();
    dir.json("run push.toml -o run.safetensors --frames 2");
    for (file, short) in [
        ("run.safetensors", "short.safetensors"),
        ("run/model.safetensors", "weights.safetensors"),
    ] {
        let bytes = dir.read(file);
        dir.write(short, &bytes[..bytes.len() / 2]);
    }
    dir.write("a.safetensors", "no tensors");
    dir.write("a.xyz", "1 2 3");
    dir.write("a.toml", "name = [");
    let roll = "run --compare push.toml -o out --model";
    dir.refuses(&format!(
        "1 | info short.safetensors | short.safetensors
         1 | info weights.safetensors | weights.safetensors
         1 | compare run.safetensors short.safetensors | short.safetensors
         1 | {roll} weights.safetensors | weights.safetensors
         1 | {roll} run.safetensors | run.safetensors | selvedge-trajectory | no model
         1 | info a.safetensors | a.safetensors
         1 | info a.xyz | a.xyz | .safetensors
         1 | info a.toml | a.toml | line 1
         1 | export push.toml -o a.usdc | push.toml",
    ));
}

#[test]
fn trajectories_of_different_meshes_are_not_compared() {
    let dir = TestFolder::new();
    dir.write("a.toml", PUSH);
    dir.write("b.toml", PUSH.replace("vertices = 36", "vertices = 25"));
    dir.write("c.toml", PUSH.replace("seed = 1", "seed = 2"));
    for name in ["a", "b", "c"] {
        dir.json(&format!("run {name}.toml -o {name}.safetensors --frames 1"));
    }
    dir.refuses(
        "1 | compare a.safetensors b.safetensors | a.safetensors | b.safetensors | 36 and 25
         1 | compare a.safetensors c.safetensors | different meshes | other faces",
    );
}

#[test]
fn a_place_that_cannot_be_written_is_found_before_the_work() {
    let dir = TestFolder::with_push();
    dir.write("file", "");
    std::fs::create_dir(dir.path("folder.safetensors")).unwrap();
    dir.refuses(
        "1 | run push.toml -o no/such/folder/run.safetensors | no/such/folder/run | no folder
         1 | run push.toml -o folder.safetensors | folder.safetensors | folder
         1 | run push.toml -o file/run.safetensors | file/run.safetensors | no folder
         1 | data generate tiny -o file/d | file/d
         2 | run push.toml -o run.txt | run.txt | .safetensors
         2 | run --rest push.toml -o rest.stl | .safetensors or .obj",
    );
}

#[cfg(target_os = "linux")]
#[test]
fn a_write_that_fails_at_the_end_says_so() {
    let dir = TestFolder::with_push();
    std::os::unix::fs::symlink("/dev/full", dir.path("full.safetensors")).unwrap();
    let words = ["full.safetensors", "not a regular file"];
    dir.fails("run push.toml -o full.safetensors --frames 1", 1, &words);
    assert_eq!(dir.names(), ["full.safetensors", "push.toml"]);
}

#[test]
fn a_folder_of_results_takes_no_results_of_another_kind() {
    let dir = TestFolder::with_push();
    dir.model();
    dir.json("data generate tiny -o part --shard 1/1");
    let data = "the folder holds a data set (index.json) | choose another folder";
    let run = "the folder holds a training (log.jsonl) | choose another folder";
    let model = "--model run/model.safetensors";
    dir.refuses(&format!(
        "1 | train moment.toml --data tiny -o tiny | {data}
         1 | train moment.toml --data tiny -o tiny --resume | {data}
         1 | run --compare push.toml {model} -o tiny | {data}
         1 | run --compare push.toml {model} -o run | {run}
         1 | eval {model} --data tiny -o tiny | {data}
         1 | eval {model} --data tiny -o run | {run}
         1 | data generate tiny -o run | {run}
         1 | data merge part -o run | {run}
         1 | eval push.toml -o tiny --physics 1 | {data}",
    ));
}
