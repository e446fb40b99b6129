//! `study`: from trainings to a report, gone on with where it stopped, refused where it cannot.

use std::process::{Command, Stdio};
use std::thread;
use std::time::Duration;

use crate::common::{Desk, TRAINING, contents, number, tiny_preset};
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

fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("moment.toml", TRAINING);
    desk.write("study.toml", STUDY);
    desk
}

/// Making the study must fail with all of `words`, between ` | `.
fn refused(desk: &Desk, words: &str) {
    let words: Vec<&str> = words.split(" | ").collect();
    desk.fails("study study.toml -o s", 1, &words);
}

/// The JSON object in a file.
fn read(desk: &Desk, file: &str) -> Value {
    serde_json::from_slice(&desk.read(file)).unwrap()
}

/// The report without what depends on the machine.
fn report(desk: &Desk, out: &str) -> Vec<(String, Vec<u8>)> {
    let mut files = desk.files(&format!("{out}/report"));
    files.retain(|(name, _)| !name.starts_with("times."));
    files
}

#[test]
fn a_study_runs_to_its_report_and_a_second_time_does_nothing() {
    let desk = desk();
    let answer = desk.json("study study.toml -o s");
    let counts = ["/trained", "/measured"].map(|count| number(&answer, count));
    assert_eq!(counts, [4.0, 5.0]);
    let page = desk.text("s/report/report.md");
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
    desk.json("train moment.toml --data s/data/tiny -o whole --steps 406");
    let slower = TRAINING.replace("rate = 1e-3", "rate = 1e-5");
    desk.write("slower.toml", slower);
    desk.json("train slower.toml --data s/data/tiny -o slower --steps 6 --from s/trainings/early");
    let weights = |file: &str| {
        let model = Model::from_bytes(&desk.read(file)).unwrap();
        model.weights().to_vec()
    };
    for (alone, within) in [("whole", "late"), ("slower", "slower")] {
        let file = format!("s/trainings/{within}/model.safetensors");
        assert!(weights(&format!("{alone}/model.safetensors")) == weights(&file));
    }
    let before = contents(&desk.path("s"));
    desk.json("study study.toml -o s -j 1");
    assert!(before == contents(&desk.path("s")));
    // An evaluation that failed is tried again.
    let kept = "s/evaluations/bare.json";
    let good = read(&desk, kept);
    let mut spoilt = good.clone();
    spoilt["evaluation"]["runs"][0]["failure"] = "the disk was full".into();
    desk.write(kept, spoilt.to_string());
    desk.json("study study.toml -o s");
    let row = |kept: &Value| kept["evaluation"]["runs"][0].clone();
    assert_eq!(row(&read(&desk, kept)), row(&good));
}

#[test]
fn an_interrupted_study_goes_on_to_the_same_report() {
    let desk = desk();
    desk.json("study study.toml -o whole");
    let mut study = desk.command("study study.toml -o cut");
    let mut study = study
        .stderr(Stdio::null())
        .stdout(Stdio::null())
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
    assert!(code == Some(130) || code == Some(0), "{code:?}");
    desk.json("study study.toml -o cut");
    let [whole, cut] = ["whole", "cut"].map(|out| report(&desk, out));
    assert!(whole.len() > 4);
    for (a, b) in whole.iter().zip(&cut) {
        assert!(a == b, "{}", a.0);
    }
    assert_eq!(whole.len(), cut.len());
}

#[test]
fn what_was_made_otherwise_or_has_vanished_is_not_taken_for_the_same() {
    let desk = desk();
    desk.json("study study.toml -o s");
    let model = desk.path("s/trainings/bare/model.safetensors");
    let bytes = std::fs::read(&model).unwrap();
    std::fs::remove_file(&model).unwrap();
    let remedy = "remove the folder | remove the entry";
    refused(
        &desk,
        &format!("\"bare\" | model.safetensors | has vanished | {remedy}"),
    );
    std::fs::write(&model, "another").unwrap();
    refused(&desk, "\"bare\" | another one by now");
    std::fs::write(&model, bytes).unwrap();
    desk.json("study study.toml -o s");
    // A model that was never this study's.
    let entry = "\n[[model]]\nname = \"old\"\nfile = \"old.safetensors\"\n";
    desk.write("study.toml", format!("{STUDY}{entry}"));
    refused(
        &desk,
        "\"old\" | old.safetensors | has vanished | remove the entry",
    );
    std::fs::copy(model, desk.path("old.safetensors")).unwrap();
    let answer = desk.json("study study.toml -o s");
    assert_eq!(number(&answer, "/measured"), 6.0);
    desk.write("study.toml", STUDY.replace("energy=0.0", "energy=0.5"));
    refused(
        &desk,
        "\"bare\" | another configuration | remove the folder",
    );
    desk.write("study.toml", STUDY.replace("steps = 6", "steps = 7"));
    refused(&desk, "\"early\" | another configuration");
    // What is measured otherwise is measured again; trainings are kept.
    desk.write("study.toml", STUDY.replace("starts = 3", "starts = 2"));
    let before = desk.read("s/report/errors.csv");
    desk.json("study study.toml -o s");
    assert!(before != desk.read("s/report/errors.csv"));
}

#[test]
fn a_data_set_of_another_preset_is_not_taken_for_the_same() {
    let desk = desk();
    let tiny = tiny_preset();
    desk.write("own.toml", tiny);
    let study = STUDY.replace("\"tiny\" }", "\"own.toml\" }");
    desk.write("study.toml", study);
    desk.json("data generate own.toml -o s/data/tiny");
    for (from, to, word) in [
        ("-0.25", "-0.2", "another configuration"),
        ("\"tiny\"", "\"large\"", "called \"tiny\", not \"large\""),
    ] {
        desk.write("own.toml", tiny.replace(from, to));
        let words = format!("data set \"tiny\" | {word} | remove the folder | another");
        refused(&desk, &words);
        assert!(!desk.path("s/trainings").exists());
    }
    // From the same preset it is taken, whoever made it.
    desk.write("own.toml", tiny);
    let index = desk.read("s/data/tiny/index.json");
    desk.json("study study.toml -o s");
    assert!(index == desk.read("s/data/tiny/index.json"));
}

#[test]
fn a_time_is_kept_to_and_is_not_spent_twice() {
    let desk = desk();
    let late = "budget = { steps = 400 }";
    let long = TRAINING.replace("steps = 6", "steps = 100000000");
    desk.write("moment.toml", long);
    let timed = STUDY.replace(late, "budget = { time = \"1s\" }");
    desk.write("study.toml", &timed);
    desk.json("study study.toml -o s");
    let record = read(&desk, "s/trainings/late/record.json");
    assert!(number(&record, "/seconds") >= 1.0 && number(&record, "/steps_done") > 6.0);
    let before = contents(&desk.path("s"));
    desk.json("study study.toml -o s");
    assert!(before == contents(&desk.path("s")));
    // A training that was made again ends elsewhere, and is another to go on from.
    std::fs::remove_dir_all(desk.path("s/trainings/early")).unwrap();
    desk.write("study.toml", timed.replacen("steps = 6", "steps = 7", 1));
    refused(&desk, "\"late\" | another training to go on from");
}

#[test]
fn what_cannot_be_measured_is_found_before_anything_is_trained() {
    let desk = desk();
    desk.tiny();
    let preset = "tiny = { preset = \"tiny\" }";
    let there = STUDY.replace(preset, "tiny = { folder = \"tiny\" }");
    let entry = "[[train]]\nname = \"early\"";
    let model = format!("[[model]]\nname = \"old\"\nfile = \"old.safetensors\"\n\n{entry}");
    let (early, nobody) = ("\"early\"\nbudget", "\"nobody\"\nbudget");
    for (from, to, word) in [("title", "titel", "titel"), (early, nobody, "nobody")] {
        desk.write("study.toml", STUDY.replacen(from, to, 1));
        desk.refuses(&format!(
            "1 | study study.toml -o s | study.toml | {word}
             1 | info study.toml | study.toml | {word}",
        ));
    }
    desk.write("old.safetensors", "no model");
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
        desk.write("study.toml", there.replacen(from, to, 1));
        refused(&desk, &format!("study.toml | {words}"));
        assert!(!desk.path("s/trainings").exists());
    }
    desk.write("study.toml", &there);
    let report = desk.json("info study.toml");
    assert_eq!(report["kind"], "study-file");
    assert_eq!(report["trainings"], 4);
    let lift = "tiny/test/lift.safetensors";
    let mut bytes = desk.read(lift);
    *bytes.last_mut().unwrap() ^= 1;
    desk.write(lift, bytes);
    refused(&desk, "data set \"tiny\" | lift.safetensors");
    assert!(!desk.path("s/trainings").exists());
}
