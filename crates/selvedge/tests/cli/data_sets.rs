//! Data sets from the command line: the same bytes for any number of threads, and after any
//! interruption.

use crate::common::{
    PUSH_FRAMES, TRAINING, TestFolder, contents, names_in, number, rows, tiny_preset,
};
use selvedge_data::{Dataset, Split};

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

#[test]
fn meshes_and_nodes_of_an_export_are_listed() {
    let dir = TestFolder::with_push();
    dir.json("run push.toml -o run.safetensors");
    for ending in ["usdc", "glb"] {
        dir.json(&format!("export run.safetensors -o run.{ending}"));
        let seen = dir.json(&format!("info run.{ending}"));
        assert_eq!(seen["meshes"][0]["name"], "sheet", "{ending}");
        assert_eq!(number(&seen, "/meshes/0/points"), 36.0);
        assert_eq!(number(&seen, "/meshes/0/frames"), (PUSH_FRAMES + 1) as f64);
        let rate = number(&seen, "/meshes/0/frame_rate");
        assert!((rate - 60.0).abs() < 1e-2, "{ending}: {rate}");
    }
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
