//! Data sets from the command line: the same bytes for any number of threads, and after any
//! interruption.

use crate::common::{Desk, PUSH, PUSH_FRAMES, TRAINING, contents, names_in, number, tiny_preset};
use selvedge_data::{Dataset, Split};

/// The text of the preset `tiny`, with other settings of its sag.
fn tiny_with(sag: &str) -> String {
    format!("{}\n[setting.sag]\n{sag}\n", tiny_preset())
}

#[test]
fn a_second_run_makes_only_what_is_missing() {
    let desk = Desk::new();
    desk.tiny();
    let whole = contents(&desk.path("tiny"));
    std::fs::remove_file(desk.path("tiny/train/turn.safetensors")).unwrap();
    let report = desk.json("data generate tiny -o tiny");
    assert_eq!(number(&report, "/trajectories_kept"), 2.0);
    // The turn lasts one second.
    assert_eq!(number(&report, "/frames_made"), 61.0);
    assert!(contents(&desk.path("tiny")) == whole);
}

#[test]
fn a_preset_whose_cloth_finds_no_rest_is_corrected_in_the_same_folder() {
    let desk = Desk::new();
    let generate = "data generate own.toml -o sets/own";
    desk.write("own.toml", tiny_with("max_steps = 1"));
    desk.fails(generate, 1, &["rest pose", "sag.max_steps"]);
    assert!(!desk.path("sets").exists());
    desk.write("own.toml", tiny_with("max_steps = 100000"));
    desk.json(generate);
}

#[cfg(unix)]
#[test]
fn an_interruption_before_the_first_trajectory_leaves_nothing_behind() {
    let desk = Desk::new();
    // Hours of it, if it went on.
    let never = tiny_with("tolerance = 1e-300\nmax_steps = 1000000000");
    desk.write("never.toml", never);
    let mut generate = desk.start("data generate never.toml -o never");
    generate.wait_for("sagging to rest: begun");
    assert!(desk.path("never/index.partial.json").is_file());
    generate.press();
    assert_eq!(generate.ended().code, Some(130));
    assert!(!desk.path("never").exists());
}

#[test]
fn a_data_set_is_told_by_its_folder() {
    let desk = Desk::new();
    desk.tiny();
    let report = desk.json("info tiny");
    let dataset = Dataset::open(&desk.path("tiny")).unwrap();
    assert_eq!(report["kind"], "dataset");
    let samples = dataset.samples().count() as f64;
    assert_eq!(number(&report, "/statistics/samples"), samples);
    assert_eq!(dataset.entries(Split::Train).len(), 2);
    assert_eq!(report, desk.json("info tiny"));
}

#[test]
fn a_folder_of_something_else_is_left_alone() {
    let desk = Desk::new();
    std::fs::create_dir_all(desk.path("mine/train")).unwrap();
    desk.write("mine/train/thesis.txt", "precious");
    desk.fails("data generate tiny -o mine", 1, &["mine", "empty folder"]);
    assert_eq!(names_in(&desk.path("mine/train")), ["thesis.txt"]);
    desk.fails("info mine", 1, &["index.json"]);
}

#[test]
fn a_changed_file_is_found() {
    let desk = Desk::new();
    desk.tiny();
    let mut bytes = desk.read("tiny/test/lift.safetensors");
    *bytes.last_mut().unwrap() ^= 1;
    desk.write("tiny/test/lift.safetensors", bytes);
    desk.fails("info tiny", 1, &["lift.safetensors", "has changed"]);
}

#[test]
fn inspection_draws_every_trajectory() {
    let desk = Desk::new();
    desk.tiny();
    let report = desk.json("info tiny --picture seen");
    let names = ["test-lift.png", "train-push.png", "train-turn.png"];
    assert_eq!(
        report["pictures"].as_array().map(Vec::len),
        Some(names.len())
    );
    assert_eq!(names_in(&desk.path("seen")), names);
    for name in names {
        assert_eq!(desk.read(&format!("seen/{name}"))[1..4], *b"PNG");
    }
    desk.fails("info tiny --picture tiny.png", 2, &["data set", "folder"]);
}

/// A folder `caches` with a run of the scene `push.toml` and a part of it.
fn caches(desk: &Desk) {
    desk.write("push.toml", PUSH);
    desk.json("run push.toml --start mesh -o run.safetensors");
    std::fs::create_dir(desk.path("caches")).unwrap();
    desk.json("export run.safetensors -o caches/one.usdc");
    desk.json("export run.safetensors -o caches/two.usdc --frames 5..");
}

#[test]
fn caches_become_a_data_set() {
    let desk = Desk::new();
    caches(&desk);
    let import = "data import caches --frame-rate 60 --handles handle_0";
    let lacks = format!("{import} -o set");
    desk.fails(&lacks, 2, &["--density"]);
    let import = format!("{import} --test two");
    let report = desk.json(&format!("{import} --density 0.2 -o set"));
    assert_eq!(
        (number(&report, "/train"), number(&report, "/test")),
        (1.0, 1.0)
    );
    assert!(number(&report, "/samples") > 0.0);
    let again = desk.json(&format!("{import} --density 0.2 -o set"));
    assert_eq!(number(&again, "/trajectories_kept"), 2.0);
    let other = format!("{import} --density 0.6 -o set");
    desk.fails(&other, 1, &["another configuration"]);
    assert_eq!(desk.json("info set")["kind"], "dataset");
    desk.model();
    desk.json("eval --model run/model.safetensors --data set");
    // To measure with, a set needs nothing to train on.
    let report = desk.json(&format!("{import},one --density 0.2 -o all"));
    assert_eq!(
        (number(&report, "/train"), number(&report, "/test")),
        (0.0, 2.0)
    );
    desk.json("eval --model run/model.safetensors --data all");
}

#[test]
fn the_handles_of_a_cache_can_be_named() {
    let desk = Desk::with_push();
    desk.json("run push.toml -o run.safetensors");
    let held = numbers(&desk.json("info run.safetensors")["handles"]);
    for ending in ["usda", "usdc", "glb", "pc2"] {
        std::fs::create_dir(desk.path(ending)).unwrap();
        desk.json(&format!("export run.safetensors -o {ending}/run.{ending}"));
        // At another rate than that of the file: what turns is not rigid between its frames.
        let import = format!("data import {ending} --density 0.2 --frame-rate 90");
        let named = format!("{import} --handles handle_1,handle_0 -o {ending}-named");
        if ending == "pc2" {
            desk.fails(&named, 1, &["run.pc2", "without nodes"]);
            continue;
        }
        // Both corners move alike, so that each node has both; the nearest comes first.
        let report = desk.json(&named);
        let turned: Vec<f64> = held.iter().rev().copied().collect();
        assert_eq!(numbers(&report["handles"]["run"]), turned, "{ending}");
        let seen = desk.json(&format!("info {ending}/run.{ending}"));
        assert_eq!(seen["meshes"][0]["name"], "sheet", "{ending}");
        assert_eq!(number(&seen, "/meshes/0/points"), 36.0);
        assert_eq!(number(&seen, "/meshes/0/frames"), (PUSH_FRAMES + 1) as f64);
        let rate = number(&seen, "/meshes/0/frame_rate");
        assert!((rate - 60.0).abs() < 1e-2, "{ending}: {rate}");
    }
    let import = "data import usdc --density 0.2 --frame-rate 60 -o new --handles";
    desk.fails(&format!("{import} 0,left"), 2, &["not both"]);
    desk.fails(&format!("{import} 0.5,1"), 2, &["whole numbers"]);
    desk.fails(
        &format!("{import} 0 --object hem"),
        1,
        &["\"hem\"", "sheet"],
    );
}

fn numbers(list: &serde_json::Value) -> Vec<f64> {
    let list = list.as_array().unwrap().iter();
    list.map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn an_import_that_fails_at_once_leaves_nothing_behind() {
    let desk = Desk::new();
    caches(&desk);
    let import = "data import caches --density 0.2 --frame-rate 60 --handles handle_0 -o sets/new";
    // The second of two: what was written before it is kept.
    desk.write("caches/two.usdc", "no stage");
    desk.fails(import, 1, &["caches/two.usdc"]);
    assert!(desk.path("sets/new/train/one.safetensors").is_file());
    let words = ["not complete", "data generate", "data import"];
    desk.fails("info sets/new", 1, &words);
    std::fs::remove_dir_all(desk.path("sets")).unwrap();
    desk.write("caches/one.usdc", "no stage");
    desk.fails(import, 1, &["caches/one.usdc"]);
    assert!(!desk.path("sets").exists());
}

#[test]
fn frames_beyond_what_cloth_does_are_not_imported() {
    let desk = Desk::new();
    caches(&desk);
    let import = "data import caches --density 0.2 --frame-rate 60 --handles handle_0";
    let words = [
        "trajectory one",
        "from frame",
        "bound of 0.000001",
        "--max-strain",
    ];
    let small = format!("{import} --max-strain 0.000001 -o small");
    desk.fails(&small, 1, &words);
    assert!(!desk.path("small").exists());
    for bad in ["nan", "0", "-1", "inf", "much"] {
        let command = format!("{import} --max-strain {bad} -o bad");
        desk.fails(&command, 2, &["--max-strain", bad, "above 0"]);
    }
    let taken = desk.json(&format!("{import} --max-strain 0.2 -o taken"));
    assert!(number(&taken, "/samples") > 0.0);
}

#[test]
fn nothing_is_learned_from_a_damaged_data_set() {
    let desk = Desk::new();
    desk.to_train();
    let train = "train moment.toml --data tiny -o run";
    let (file, index) = ("tiny/train/push.safetensors", "tiny/index.json");
    let [good, good_index] = [desk.read(file), desk.read(index)];
    let mut altered = good.clone();
    *altered.last_mut().unwrap() ^= 1;
    desk.write(file, altered);
    desk.fails(train, 1, &["push.safetensors", "has changed"]);
    desk.write(file, good);
    let text = String::from_utf8(good_index).unwrap();
    let (from, to) = ("\"vertices\": 36", "\"vertices\": 37");
    assert!(text.contains(from));
    desk.write(index, text.replace(from, to));
    desk.fails(train, 1, &["tiny", "91 frames of 37 vertices"]);
    assert!(!desk.path("run/model.safetensors").exists());
}

#[test]
fn a_plan_is_told_without_simulating_anything() {
    let desk = Desk::new();
    let report = desk.json("info paper");
    assert_eq!(number(&report, "/samples"), 6550.0);
    assert_eq!(number(&report, "/frames"), 31.0 * 1261.0);
    let sections = report["forecast"]["sections"].as_array().unwrap();
    assert_eq!(sections.len(), 42);
    assert!(desk.names().is_empty());
    desk.fails("info nothing", 1, &["nothing", "preset that ships"]);
}

#[test]
fn a_set_on_several_meshes_has_a_rest_pose_for_each() {
    let desk = Desk::new();
    let preset = r#"
name = "two"
sections = "whole"
train = []
test = ["step"]
[meshes]
names = ["quarter", "wide-3"]
density = 60.0
seed = 1
[setting]
material = "gray-interlock"
mesh = { generator = { kind = "square", vertices = 16, size = 1.0, seed = 1 } }
handles = { label = "upper-corners" }
[motions.step.inline]
kind = "blocks"
blocks = [{ duration = 0.1, translations = [{ direction = [1, 0, 0], pace = { distance = 0.01 } }] }]
"#;
    desk.write("two.toml", preset);
    desk.json("data generate two.toml -o two");
    let dataset = Dataset::open(&desk.path("two")).unwrap();
    let vertices: Vec<usize> = dataset
        .entries(Split::Test)
        .iter()
        .map(|e| e.vertices)
        .collect();
    assert_eq!(vertices, [15, 90]);
    for entry in dataset.entries(Split::Test) {
        let trajectory = dataset.read(entry).unwrap();
        // It starts in its own rest pose.
        assert_eq!(trajectory.frame(0), trajectory.cloth().rest_positions());
        assert_eq!(trajectory.frame_count(), 7);
    }
    desk.write("moment.toml", TRAINING);
    desk.fails("train moment.toml --data two -o run", 1, &["no samples"]);
}
