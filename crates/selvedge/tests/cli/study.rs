//! `study`: from trainings to a report, gone on with where it stopped, refused where it cannot.

use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use crate::common::{Desk, contents, number};
use selvedge_data::shipped_presets;
use selvedge_model::Model;

/// Three trainings of a moment, one of them after another, on a data set that is made.
const STUDY: &str = r#"
title = "A moment"
text = "Nothing is learned here."
budget = { steps = 6 }
set = ["log_every=3"]

[data]
tiny = { preset = "tiny" }

[evaluation]
rivals = ["rigid"]
steps = [1, 5]
starts = 3

[[train]]
name = "early"
label = "all features"
config = "moment.toml"

[[train]]
name = "late"
label = "all features"
config = "moment.toml"
after = "early"
budget = { steps = 400 }

[[train]]
name = "bare"
label = "without | forces"
config = "moment.toml"
set = ['model.node_features=["velocity", "node-type"]', "losses.kinetic_energy=0.0"]

[[question]]
title = "Which is better?"
text = "Nobody knows yet."
models = ["late", "bare", "rigid"]
show = ["table", "ablation", "steps", "time", "bars", "motions", "meshes"]

[[question]]
title = "Does time help?"
groups = [
    { heading = "early", models = ["early"] },
    { heading = "late", models = ["late"] },
]
show = ["bars", "ablation"]
"#;

fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("moment.toml", crate::common::TRAINING);
    desk.write("study.toml", STUDY);
    desk
}

/// The report without what depends on the machine.
fn report(desk: &Desk, out: &str) -> Vec<(PathBuf, Vec<u8>)> {
    let folder = desk.path(out).join("report");
    let is_kept = |path: &PathBuf| path.file_stem().is_none_or(|stem| stem != "times");
    let files = contents(&folder).into_iter();
    let files = files.filter(|(path, _)| is_kept(path));
    files
        .map(|(path, bytes)| (path.strip_prefix(&folder).unwrap().to_owned(), bytes))
        .collect()
}

#[test]
fn a_study_runs_to_its_report_and_a_second_time_does_nothing() {
    let desk = desk();
    let answer = desk.json("study study.toml --out s");
    assert_eq!(
        (number(&answer, "/trained"), number(&answer, "/measured")),
        (3.0, 4.0)
    );
    let page = String::from_utf8(desk.read("s/report/report.md")).unwrap();
    for text in [
        "# A moment\n\nNothing is learned here.\n",
        "## Which is better?\n\nNobody knows yet.\n",
        "![errors by steps](question-1-steps.svg)",
        "| without \\| forces |",
        "| all features, early |",
        "moment.toml; log_every=3; after early",
        "| 400 steps | 406 |",
    ] {
        assert!(page.contains(text), "{text}\n{page}");
    }
    let bars = String::from_utf8(desk.read("s/report/question-2-position.svg")).unwrap();
    assert!(bars.contains("early") && bars.contains("late"));
    // The training that goes on after another is the one that was never cut.
    desk.json("train moment.toml --data s/data/tiny --out whole --steps 406");
    let weights = |file: &str| {
        let model = Model::from_bytes(&desk.read(file)).unwrap();
        model.weights().to_vec()
    };
    assert!(weights("whole/model.safetensors") == weights("s/trainings/late/model.safetensors"));
    let before = contents(&desk.path("s"));
    desk.json("study study.toml --out s --threads 1");
    assert!(before == contents(&desk.path("s")));
}

#[test]
fn an_evaluation_that_failed_is_tried_again() {
    let desk = desk();
    desk.json("study study.toml --out out");
    let kept = "out/evaluations/bare.json";
    let good = desk.read(kept);
    let mut spoilt: serde_json::Value = serde_json::from_slice(&good).unwrap();
    spoilt["evaluation"]["rows"][0]["failure"] = "the disk was full".into();
    spoilt["evaluation"]["rows"][0]["measures"] = serde_json::Value::Null;
    desk.write(kept, spoilt.to_string());
    desk.json("study study.toml --out out");
    let again: serde_json::Value = serde_json::from_slice(&desk.read(kept)).unwrap();
    let good: serde_json::Value = serde_json::from_slice(&good).unwrap();
    let row = |kept: &serde_json::Value| kept["evaluation"]["rows"][0].clone();
    assert_eq!(row(&again), row(&good));
}

#[test]
fn the_file_of_a_study_is_inspected() {
    let desk = desk();
    let report = desk.json("inspect study.toml");
    assert_eq!(report["kind"], "study-file");
    assert_eq!(report["trainings"], 3);
    assert_eq!(report["questions"], 2);
    desk.write(
        "bad.toml",
        STUDY.replace("models = [\"late\"", "models = [\"nobody\""),
    );
    desk.fails("inspect bad.toml", 1, &["bad.toml", "nobody"]);
}

#[test]
fn an_interrupted_study_goes_on_to_the_same_report() {
    let desk = desk();
    desk.json("study study.toml --out whole");
    let mut study = desk
        .command("study study.toml --out cut")
        .stdout(Stdio::null())
        .stderr(Stdio::null())
        .spawn()
        .unwrap();
    // While the longest training is under way.
    let begun = desk.path("cut/trainings/late/record.json");
    for _ in 0..6000 {
        if begun.exists() {
            break;
        }
        thread::sleep(Duration::from_millis(10));
    }
    let pid = study.id().to_string();
    Command::new("kill").args(["-INT", &pid]).status().unwrap();
    let code = study.wait().unwrap().code();
    assert!(code == Some(1) || code == Some(0), "{code:?}");
    desk.json("study study.toml --out cut");
    let [whole, cut] = ["whole", "cut"].map(|out| report(&desk, out));
    assert!(whole.len() > 10);
    for (a, b) in whole.iter().zip(&cut) {
        assert!(a == b, "{}", a.0.display());
    }
    assert_eq!(whole.len(), cut.len());
}

#[test]
fn a_model_that_has_vanished_or_changed_is_named_with_the_remedy() {
    let desk = desk();
    desk.json("study study.toml --out s");
    let model = desk.path("s/trainings/bare/model.safetensors");
    let bytes = desk.read("s/trainings/bare/model.safetensors");
    std::fs::remove_file(&model).unwrap();
    let words = [
        "\"bare\"",
        "model.safetensors",
        "has vanished",
        "remove the folder",
        "remove the entry",
    ];
    desk.fails("study study.toml --out s", 1, &words);
    std::fs::write(&model, "another").unwrap();
    desk.fails(
        "study study.toml --out s",
        1,
        &["\"bare\"", "another one by now"],
    );
    std::fs::write(&model, bytes).unwrap();
    desk.json("study study.toml --out s");
    // A model that was never this study's.
    let entry =
        "[[model]]\nname = \"old\"\nfile = \"old.safetensors\"\n\n[[question]]\ntitle = \"Does";
    desk.write(
        "study.toml",
        STUDY.replace("[[question]]\ntitle = \"Does", entry),
    );
    let words = [
        "\"old\"",
        "old.safetensors",
        "has vanished",
        "remove the entry",
    ];
    desk.fails("study study.toml --out s", 1, &words);
    std::fs::copy(model, desk.path("old.safetensors")).unwrap();
    let answer = desk.json("study study.toml --out s");
    assert_eq!(number(&answer, "/measured"), 5.0);
}

#[test]
fn what_was_made_otherwise_is_not_taken_for_the_same() {
    let desk = desk();
    desk.json("study study.toml --out s");
    desk.write(
        "study.toml",
        STUDY.replace("losses.kinetic_energy=0.0", "losses.kinetic_energy=0.5"),
    );
    desk.fails(
        "study study.toml --out s",
        1,
        &["\"bare\"", "another configuration", "remove the folder"],
    );
    desk.write("study.toml", STUDY.replace("steps = 6", "steps = 7"));
    desk.fails(
        "study study.toml --out s",
        1,
        &["\"early\"", "another configuration"],
    );
    // What is measured otherwise is measured again; trainings are kept.
    desk.write("study.toml", STUDY.replace("starts = 3", "starts = 2"));
    let before = desk.read("s/report/steps.csv");
    desk.json("study study.toml --out s");
    assert!(before != desk.read("s/report/steps.csv"));
}

#[test]
fn a_data_set_of_another_preset_is_not_taken_for_the_same() {
    let desk = desk();
    let tiny = shipped_presets().iter().find(|preset| preset.0 == "tiny");
    let tiny = tiny.unwrap().1;
    desk.write("own.toml", tiny);
    let study = STUDY.replace("\"tiny\" }", "\"own.toml\" }");
    desk.write("study.toml", study);
    desk.json("dataset generate own.toml --out s/data/tiny");
    for (from, to, word) in [
        ("-0.25", "-0.2", "another configuration"),
        ("\"tiny\"", "\"large\"", "called \"tiny\", not \"large\""),
    ] {
        desk.write("own.toml", tiny.replace(from, to));
        let words = ["data set \"tiny\"", word, "remove the folder", "another"];
        desk.fails("study study.toml --out s", 1, &words);
        assert!(!desk.path("s/trainings").exists());
    }
    // From the same preset it is taken, whoever made it.
    desk.write("own.toml", tiny);
    let index = desk.read("s/data/tiny/index.json");
    desk.json("study study.toml --out s");
    assert!(index == desk.read("s/data/tiny/index.json"));
}

#[test]
fn a_time_is_kept_to_and_is_not_spent_twice() {
    let desk = desk();
    let late = "budget = { steps = 400 }";
    desk.write(
        "moment.toml",
        crate::common::TRAINING.replace("steps = 6", "steps = 100000000"),
    );
    desk.write(
        "study.toml",
        STUDY.replace(late, "budget = { time = \"1s\" }"),
    );
    desk.json("study study.toml --out s");
    let record: serde_json::Value =
        serde_json::from_slice(&desk.read("s/trainings/late/record.json")).unwrap();
    assert!(number(&record, "/seconds") >= 1.0 && number(&record, "/steps_done") > 6.0);
    let before = contents(&desk.path("s"));
    desk.json("study study.toml --out s");
    assert!(before == contents(&desk.path("s")));
    // A training that was made again ends elsewhere, and is another to go on from.
    std::fs::remove_dir_all(desk.path("s/trainings/early")).unwrap();
    let timed = STUDY.replace(late, "budget = { time = \"1s\" }");
    desk.write("study.toml", timed.replacen("steps = 6", "steps = 7", 1));
    desk.fails(
        "study study.toml --out s",
        1,
        &["\"late\"", "another training to go on from"],
    );
}

#[test]
fn what_cannot_be_measured_is_found_before_anything_is_trained() {
    let desk = desk();
    desk.tiny();
    let preset = "tiny = { preset = \"tiny\" }";
    let there = STUDY.replace(preset, "tiny = { folder = \"tiny\" }");
    let model =
        "[[model]]\nname = \"old\"\nfile = \"old.safetensors\"\n\n[[train]]\nname = \"early\"";
    desk.write("old.safetensors", "no model");
    let cases = [
        (
            "starts = 3",
            "motions = [\"zz\"]",
            "evaluation.motions: motion zz",
        ),
        (
            "steps = [1, 5]",
            "steps = [1, 5000]",
            "evaluation.steps: 5000 fit into no",
        ),
        ("[[train]]\nname = \"early\"", model, "model \"old\""),
    ];
    for (from, to, word) in cases {
        desk.write("study.toml", there.replacen(from, to, 1));
        desk.fails("study study.toml --out s", 1, &["study.toml", word]);
        assert!(!desk.path("s/trainings").exists());
    }
    desk.write("study.toml", &there);
    let lift = desk.path("tiny/test/lift.safetensors");
    let mut bytes = std::fs::read(&lift).unwrap();
    *bytes.last_mut().unwrap() ^= 1;
    std::fs::write(&lift, bytes).unwrap();
    desk.fails(
        "study study.toml --out s",
        1,
        &["data set \"tiny\"", "lift.safetensors"],
    );
    assert!(!desk.path("s/trainings").exists());
}

#[test]
fn bad_studies_leave_nothing_behind() {
    let desk = desk();
    let cases = [
        ("title", "titel", "titel"),
        (
            "name = \"late\"",
            "name = \"early\"",
            "two entries are called",
        ),
        ("steps = 400", "steps = 0", "budget"),
        ("moment.toml\"\nset", "none.toml\"\nset", "none.toml"),
    ];
    for (from, to, word) in cases {
        desk.write("study.toml", STUDY.replacen(from, to, 1));
        desk.fails("study study.toml --out s", 1, &["study.toml", word]);
        assert!(!desk.path("s").exists());
    }
    desk.fails("study none --out s", 1, &["none", "small", "table1"]);
}
