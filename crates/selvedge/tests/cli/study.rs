//! `study`: from trainings to a report, gone on with where it stopped, refused where it cannot.

use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use crate::common::{TRAINING, TestFolder, contents, number, tiny_preset};
use selvedge_model::Model;
use serde_json::Value;

/// Four trainings of a moment, two of them after another, on a data set that is made.
const STUDY: &str = r#"
title = "A moment"
text = "Nothing is learned here."
budget = { steps = 6 }
set = ["log_every=3"]

[data]
tiny = { preset = "tiny" }

[evaluation]
baselines = ["rigid"]
horizons = [1, 5]
starts = 3

[[train]]
name = "early"
config = "moment.toml"

[[train]]
name = "late"
config = "moment.toml"
after = "early"
budget = { steps = 400 }

[[train]]
name = "slower"
config = "moment.toml"
set = ['learning_rate={ kind = "constant", rate = 1e-5 }']
after = "early"

[[train]]
name = "bare"
config = "moment.toml"
set = ['model.node_features=["velocity", "node-type"]', "losses.kinetic_energy=0.0"]

"#;

fn dir() -> TestFolder {
    let dir = TestFolder::new();
    dir.write("moment.toml", TRAINING);
    dir.write("study.toml", STUDY);
    dir
}

/// Making the study must fail with all of `words`, between ` | `.
fn refused(dir: &TestFolder, words: &str) {
    let words: Vec<&str> = words.split(" | ").collect();
    dir.fails("study study.toml -o s", 1, &words);
}

/// The JSON object in a file.
fn read(dir: &TestFolder, file: &str) -> Value {
    serde_json::from_slice(&dir.read(file)).unwrap()
}

/// The report without what depends on the machine.
fn report(dir: &TestFolder, out: &str) -> Vec<(String, Vec<u8>)> {
    let mut files = dir.files(&format!("{out}/report"));
    files.retain(|(name, _)| !name.starts_with("times."));
    files
}

#[test]
fn a_study_runs_to_its_report_and_a_second_time_does_nothing() {
    let dir = dir();
    let answer = dir.json("study study.toml -o s");
    let counts = ["/trained", "/measured"].map(|count| number(&answer, count));
    assert_eq!(counts, [4.0, 5.0]);
    let page = dir.text("s/report/report.md");
    for text in [
        "# A moment\n\nNothing is learned here.\n",
        "![errors by frames](after.svg)",
        "| bare |",
        "moment.toml; log_every=3; after early",
        "| 400 steps | 406 |",
    ] {
        assert!(page.contains(text), "{text}\n{page}");
    }
    // The training that goes on after another is the one that was never cut; with another
    // configuration it is one from the weights of the other.
    dir.json("train moment.toml --data s/data/tiny -o whole --steps 406");
    let slower = TRAINING.replace("rate = 1e-3", "rate = 1e-5");
    dir.write("slower.toml", slower);
    dir.json("train slower.toml --data s/data/tiny -o slower --steps 6 --from s/trainings/early");
    let weights = |file: &str| {
        let model = Model::from_bytes(&dir.read(file)).unwrap();
        model.weights().to_vec()
    };
    for (alone, within) in [("whole", "late"), ("slower", "slower")] {
        let file = format!("s/trainings/{within}/model.safetensors");
        assert!(weights(&format!("{alone}/model.safetensors")) == weights(&file));
    }
    let before = contents(&dir.path("s"));
    dir.json("study study.toml -o s -j 1");
    assert!(before == contents(&dir.path("s")));
    // An evaluation that failed is tried again.
    let kept = "s/evaluations/bare.json";
    let good = read(&dir, kept);
    let mut spoilt = good.clone();
    spoilt["evaluation"]["runs"][0]["failure"] = "the disk was full".into();
    dir.write(kept, spoilt.to_string());
    dir.json("study study.toml -o s");
    let row = |kept: &Value| kept["evaluation"]["runs"][0].clone();
    assert_eq!(row(&read(&dir, kept)), row(&good));
}

#[test]
fn an_interrupted_study_goes_on_to_the_same_report() {
    let dir = dir();
    dir.json("study study.toml -o whole");
    let mut study = dir.command("study study.toml -o cut");
    let mut study = study
        .stderr(Stdio::null())
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    // While the longest training is under way.
    let begun = dir.path("cut/trainings/late/record.json");
    for _ in 0..6000 {
        if begun.exists() {
            break;
        }
        thread::sleep(Duration::from_millis(10));
    }
    let pid = study.id().to_string();
    Command::new("kill").args(["-INT", &pid]).status().unwrap();
    let code = study.wait().unwrap().code();
    assert!(code == Some(130) || code == Some(0), "{code:?}");
    dir.json("study study.toml -o cut");
    let [whole, cut] = ["whole", "cut"].map(|out| report(&dir, out));
    assert!(whole.len() > 4);
    for (a, b) in whole.iter().zip(&cut) {
        assert!(a == b, "{}", a.0);
    }
    assert_eq!(whole.len(), cut.len());
}

#[test]
fn what_was_made_otherwise_or_has_vanished_is_not_taken_for_the_same() {
    let dir = dir();
    dir.json("study study.toml -o s");
    let model = dir.path("s/trainings/bare/model.safetensors");
    let bytes = std::fs::read(&model).unwrap();
    std::fs::remove_file(&model).unwrap();
    let remedy = "remove the folder | remove the entry";
    refused(
        &dir,
        &format!("\"bare\" | model.safetensors | has vanished | {remedy}"),
    );
    std::fs::write(&model, "another").unwrap();
    refused(&dir, "\"bare\" | another one by now");
    std::fs::write(&model, bytes).unwrap();
    dir.json("study study.toml -o s");
    // A model that was never this study's.
    let entry = "\n[[model]]\nname = \"old\"\nfile = \"old.safetensors\"\n";
    dir.write("study.toml", format!("{STUDY}{entry}"));
    refused(
        &dir,
        "\"old\" | old.safetensors | has vanished | remove the entry",
    );
    std::fs::copy(model, dir.path("old.safetensors")).unwrap();
    let answer = dir.json("study study.toml -o s");
    assert_eq!(number(&answer, "/measured"), 6.0);
    dir.write("study.toml", STUDY.replace("energy=0.0", "energy=0.5"));
    refused(&dir, "\"bare\" | another configuration | remove the folder");
    dir.write("study.toml", STUDY.replace("steps = 6", "steps = 7"));
    refused(&dir, "\"early\" | another configuration");
    // What is measured otherwise is measured again; trainings are kept.
    dir.write("study.toml", STUDY.replace("starts = 3", "starts = 2"));
    let before = dir.read("s/report/errors.csv");
    dir.json("study study.toml -o s");
    assert!(before != dir.read("s/report/errors.csv"));
}

#[test]
fn a_data_set_of_another_preset_is_not_taken_for_the_same() {
    let dir = dir();
    let tiny = tiny_preset();
    dir.write("own.toml", tiny);
    let study = STUDY.replace("\"tiny\" }", "\"own.toml\" }");
    dir.write("study.toml", study);
    dir.json("data generate own.toml -o s/data/tiny");
    for (from, to, word) in [
        ("-0.25", "-0.2", "another configuration"),
        ("\"tiny\"", "\"large\"", "called \"tiny\", not \"large\""),
    ] {
        dir.write("own.toml", tiny.replace(from, to));
        let words = format!("data set \"tiny\" | {word} | remove the folder | another");
        refused(&dir, &words);
        assert!(!dir.path("s/trainings").exists());
    }
    // From the same preset it is taken, whoever made it.
    dir.write("own.toml", tiny);
    let index = dir.read("s/data/tiny/index.json");
    dir.json("study study.toml -o s");
    assert!(index == dir.read("s/data/tiny/index.json"));
}

#[test]
fn a_time_is_kept_to_and_is_not_spent_twice() {
    let dir = dir();
    let late = "budget = { steps = 400 }";
    let long = TRAINING.replace("steps = 6", "steps = 100000000");
    dir.write("moment.toml", long);
    let timed = STUDY.replace(late, "budget = { time = \"1s\" }");
    dir.write("study.toml", &timed);
    dir.json("study study.toml -o s");
    let record = read(&dir, "s/trainings/late/record.json");
    assert!(number(&record, "/seconds") >= 1.0 && number(&record, "/steps_done") > 6.0);
    let before = contents(&dir.path("s"));
    dir.json("study study.toml -o s");
    assert!(before == contents(&dir.path("s")));
    // A training that was made again ends elsewhere, and is another to go on from.
    std::fs::remove_dir_all(dir.path("s/trainings/early")).unwrap();
    dir.write("study.toml", timed.replacen("steps = 6", "steps = 7", 1));
    refused(&dir, "\"late\" | another training to go on from");
}

#[test]
fn what_cannot_be_measured_is_found_before_anything_is_trained() {
    let dir = dir();
    dir.tiny();
    let preset = "tiny = { preset = \"tiny\" }";
    let there = STUDY.replace(preset, "tiny = { folder = \"tiny\" }");
    let entry = "[[train]]\nname = \"early\"";
    let model = format!("[[model]]\nname = \"old\"\nfile = \"old.safetensors\"\n\n{entry}");
    let (early, nobody) = ("\"early\"\nbudget", "\"nobody\"\nbudget");
    for (from, to, word) in [("title", "titel", "titel"), (early, nobody, "nobody")] {
        dir.write("study.toml", STUDY.replacen(from, to, 1));
        dir.refuses(&format!(
            "1 | study study.toml -o s | study.toml | {word}
             1 | info study.toml | study.toml | {word}",
        ));
    }
    dir.write("old.safetensors", "no model");
    for (from, to, words) in [
        (
            "starts = 3",
            "motions = [\"zz\"]",
            "evaluation.motions: motion zz",
        ),
        (
            "[1, 5]",
            "[1, 5000]",
            "evaluation.horizons: 5000 frames fit into no",
        ),
        (entry, model.as_str(), "model \"old\""),
    ] {
        dir.write("study.toml", there.replacen(from, to, 1));
        refused(&dir, &format!("study.toml | {words}"));
        assert!(!dir.path("s/trainings").exists());
    }
    dir.write("study.toml", &there);
    let report = dir.json("info study.toml");
    assert_eq!(report["kind"], "study-file");
    assert_eq!(report["trainings"], 4);
    let lift = "tiny/test/lift.safetensors";
    let mut bytes = dir.read(lift);
    *bytes.last_mut().unwrap() ^= 1;
    dir.write(lift, bytes);
    refused(&dir, "data set \"tiny\" | lift.safetensors");
    assert!(!dir.path("s/trainings").exists());
}
