//! Data sets from the command line: the same bytes for any number of threads, and after any
//! interruption.

use crate::common::{
    PUSH, PUSH_FRAMES, TRAINING, TestFolder, contents, names_in, number, rows, tiny_preset,
};
use selvedge_data::{Dataset, Split};
use serde_json::Value;

/// The text of the preset `tiny`, with other settings of its sag.
fn tiny_with(sag: &str) -> String {
    format!("{}\n[setting.sag]\n{sag}\n", tiny_preset())
}

#[test]
fn a_second_run_makes_only_what_is_missing() {
    let dir = TestFolder::new();
    dir.tiny();
    let whole = contents(&dir.path("tiny"));
    std::fs::remove_file(dir.path("tiny/train/turn.safetensors")).unwrap();
    let report = dir.json("data generate tiny -o tiny");
    assert_eq!(number(&report, "/trajectories_kept"), 2.0);
    // The turn lasts one second.
    assert_eq!(number(&report, "/frames_made"), 61.0);
    assert!(contents(&dir.path("tiny")) == whole);
}

#[test]
fn a_preset_whose_cloth_finds_no_rest_is_corrected_in_the_same_folder() {
    let dir = TestFolder::new();
    let generate = "data generate own.toml -o sets/own";
    dir.write("own.toml", tiny_with("max_steps = 1"));
    dir.fails(generate, 1, &["rest pose", "sag.max_steps"]);
    assert!(!dir.path("sets").exists());
    dir.write("own.toml", tiny_with("max_steps = 100000"));
    dir.json(generate);
}

#[test]
fn a_folder_of_something_else_is_left_alone() {
    let dir = TestFolder::new();
    std::fs::create_dir_all(dir.path("mine/train")).unwrap();
    dir.write("mine/train/thesis.txt", "precious");
    dir.fails("data generate tiny -o mine", 1, &["mine", "empty folder"]);
    assert_eq!(names_in(&dir.path("mine/train")), ["thesis.txt"]);
    dir.fails("info mine", 1, &["index.json"]);
}

#[test]
fn inspection_tells_of_a_data_set() {
    let dir = TestFolder::new();
    dir.tiny();
    let report = dir.json("info tiny");
    let dataset = Dataset::open(&dir.path("tiny")).unwrap();
    let samples = dataset.samples().count() as f64;
    assert_eq!(number(&report, "/statistics/samples"), samples);
    dir.refuses("1 | info tiny --picture tiny.png | nothing to draw");
    // What a preset will make is told without making it.
    let plan = dir.json("info paper");
    assert_eq!(number(&plan, "/samples"), 6550.0);
    assert_eq!(number(&plan, "/frames"), 31.0 * 1261.0);
    assert_eq!(rows(&plan["forecast"], "sections").len(), 42);
    assert_eq!(dir.names(), ["tiny"]);
}

/// A folder `caches` with a run of the scene `push.toml` and a part of it.
fn caches(dir: &TestFolder) {
    dir.write("push.toml", PUSH);
    dir.json("run push.toml --start mesh -o run.safetensors");
    std::fs::create_dir(dir.path("caches")).unwrap();
    dir.json("export run.safetensors -o caches/one.usdc");
    dir.json("export run.safetensors -o caches/two.usdc --frames 5..");
}

#[test]
fn caches_become_a_data_set() {
    let dir = TestFolder::new();
    caches(&dir);
    let import = "data import caches --frame-rate 60 --handles handle_0";
    dir.refuses(&format!("2 | {import} -o set | --density"));
    let parts = |report: &Value| ["/train", "/test"].map(|part| number(report, part));
    let import = format!("{import} --test two");
    let report = dir.json(&format!("{import} --density 0.2 -o set"));
    assert_eq!(parts(&report), [1.0, 1.0]);
    assert!(number(&report, "/samples") > 0.0);
    let again = dir.json(&format!("{import} --density 0.2 -o set"));
    assert_eq!(number(&again, "/trajectories_kept"), 2.0);
    dir.refuses(&format!(
        "1 | {import} --density 0.6 -o set | another configuration"
    ));
    assert_eq!(dir.json("info set")["kind"], "dataset");
    dir.model();
    dir.json("eval --model run/model.safetensors --data set");
    // To measure with, a set needs nothing to train on.
    let report = dir.json(&format!("{import},one --density 0.2 -o all"));
    assert_eq!(parts(&report), [0.0, 2.0]);
    dir.json("eval --model run/model.safetensors --data all");
}

#[test]
fn the_handles_of_a_cache_can_be_named() {
    let dir = TestFolder::with_push();
    dir.json("run push.toml -o run.safetensors");
    let held = numbers(&dir.json("info run.safetensors")["handles"]);
    for ending in ["usda", "usdc", "glb", "pc2"] {
        std::fs::create_dir(dir.path(ending)).unwrap();
        dir.json(&format!("export run.safetensors -o {ending}/run.{ending}"));
        // At another rate than that of the file: what turns is not rigid between its frames.
        let import = format!("data import {ending} --density 0.2 --frame-rate 90");
        let named = format!("{import} --handles handle_1,handle_0 -o {ending}-named");
        if ending == "pc2" {
            dir.refuses(&format!("1 | {named} | run.pc2 | without nodes"));
            continue;
        }
        // Both corners move alike, so that each node has both; the nearest comes first.
        let report = dir.json(&named);
        let turned: Vec<f64> = held.iter().rev().copied().collect();
        assert_eq!(numbers(&report["handles"]["run"]), turned, "{ending}");
        let seen = dir.json(&format!("info {ending}/run.{ending}"));
        assert_eq!(seen["meshes"][0]["name"], "sheet", "{ending}");
        assert_eq!(number(&seen, "/meshes/0/points"), 36.0);
        assert_eq!(number(&seen, "/meshes/0/frames"), (PUSH_FRAMES + 1) as f64);
        let rate = number(&seen, "/meshes/0/frame_rate");
        assert!((rate - 60.0).abs() < 1e-2, "{ending}: {rate}");
    }
    let import = "data import usdc --density 0.2 --frame-rate 60 -o new --handles";
    dir.refuses(&format!(
        "2 | {import} 0,left | not both
         2 | {import} 0.5,1 | whole numbers
         1 | {import} 0 --object hem | \"hem\" | sheet",
    ));
}

fn numbers(list: &Value) -> Vec<f64> {
    let list = list.as_array().unwrap().iter();
    list.map(|number| number.as_f64().unwrap()).collect()
}

#[test]
fn an_import_that_fails_at_once_leaves_nothing_behind() {
    let dir = TestFolder::new();
    caches(&dir);
    let import = "data import caches --density 0.2 --frame-rate 60 --handles handle_0 -o sets/new";
    // The second of two: what was written before it is kept.
    dir.write("caches/two.usdc", "no stage");
    dir.fails(import, 1, &["caches/two.usdc"]);
    assert!(dir.path("sets/new/train/one.safetensors").is_file());
    let words = ["not complete", "data generate", "data import"];
    dir.fails("info sets/new", 1, &words);
    std::fs::remove_dir_all(dir.path("sets")).unwrap();
    dir.write("caches/one.usdc", "no stage");
    dir.fails(import, 1, &["caches/one.usdc"]);
    assert!(!dir.path("sets").exists());
}

#[test]
fn frames_beyond_what_cloth_does_are_not_imported() {
    let dir = TestFolder::new();
    caches(&dir);
    let import = "data import caches --density 0.2 --frame-rate 60 --handles handle_0 --max-strain";
    let words = "trajectory one | from frame | bound of 0.000001 | --max-strain";
    dir.refuses(&format!("1 | {import} 0.000001 -o small | {words}"));
    for bad in ["nan", "0", "-1", "inf", "much"] {
        dir.refuses(&format!(
            "2 | {import} {bad} -o bad | --max-strain | {bad} | above 0"
        ));
    }
    let taken = dir.json(&format!("{import} 0.2 -o taken"));
    assert!(number(&taken, "/samples") > 0.0);
}

#[test]
fn nothing_is_learned_from_a_damaged_data_set() {
    let dir = TestFolder::new();
    dir.to_train();
    let train = "train moment.toml --data tiny -o run";
    let (file, index) = ("tiny/train/push.safetensors", "tiny/index.json");
    let good = dir.read(file);
    let mut altered = good.clone();
    *altered.last_mut().unwrap() ^= 1;
    dir.write(file, altered);
    dir.refuses(&format!(
        "1 | info tiny | push.safetensors | has changed
         1 | {train} | push.safetensors | has changed",
    ));
    dir.write(file, good);
    let (text, from) = (dir.text(index), "\"vertices\": 36");
    assert!(text.contains(from));
    dir.write(index, text.replace(from, "\"vertices\": 37"));
    dir.refuses(&format!("1 | {train} | tiny | 91 frames of 37 vertices"));
}

#[test]
fn a_set_on_several_meshes_has_a_rest_pose_for_each() {
    let dir = TestFolder::new();
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
    dir.write("two.toml", preset);
    dir.json("data generate two.toml -o two");
    let dataset = Dataset::open(&dir.path("two")).unwrap();
    let entries = dataset.entries(Split::Test);
    assert_eq!([entries[0].vertices, entries[1].vertices], [15, 90]);
    for entry in entries {
        let trajectory = dataset.read(entry).unwrap();
        // It starts in its own rest pose.
        assert_eq!(trajectory.frame(0), trajectory.cloth().rest_positions());
        assert_eq!(trajectory.frame_count(), 7);
    }
    dir.write("moment.toml", TRAINING);
    dir.fails("train moment.toml --data two -o run", 1, &["no samples"]);
}
