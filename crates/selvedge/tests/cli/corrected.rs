//! Models that correct physics from the command line: taught, resumed, run and inspected.

use crate::common::{Desk, PUSH, names_in, number};

/// A training of a moment.
const CORRECTION: &str = r#"
name = "correction"
seed = 1
steps = 3
log_every = 1
learning_rate = { kind = "constant", rate = 1e-3 }
batch = { samples = 2 }

[teacher]
scenes = ["tiny"]
substeps = 3

[samples]
cloths = 2
statistics = 8
kept = 16
lead = 3

[model]
encoder = { kind = "mlp" }
latent = 8
blocks = 0
base = { substeps = 1 }
"#;

#[test]
fn a_correction_is_taught_resumed_run_and_inspected() {
    let desk = Desk::new();
    desk.write("correction.toml", CORRECTION);
    let report = desk.json("train correction.toml -o run");
    assert_eq!(number(&report, "/steps_done"), 3.0);
    assert!(number(&report, "/samples") >= 8.0);
    assert!(number(&report, "/loss") > 0.0);
    let names = [
        "checkpoint.safetensors",
        "config.toml",
        "log.jsonl",
        "model.safetensors",
    ];
    assert_eq!(names_in(&desk.path("run")), names);
    desk.fails("train correction.toml -o run", 1, &["run", "--resume"]);
    let before = desk.read("run/model.safetensors");
    let report = desk.json("train correction.toml -o run --resume --steps 5");
    assert_eq!(number(&report, "/steps_done"), 5.0);
    assert!(before != desk.read("run/model.safetensors"));
    assert_eq!(desk.json("info run/model.safetensors")["kind"], "model");
    for what in ["correction.toml", "run"] {
        let said = desk.run(&format!("info {what}"));
        assert_eq!(said.code, Some(0), "{what}: {}", said.err);
        assert!(said.out.contains("correction"), "{}", said.out);
    }
    desk.write("push.toml", PUSH);
    let rollout = "run --compare push.toml --model run/model.safetensors -o out --frames 4";
    let report = desk.json(&format!("{rollout} --no-clip"));
    assert_eq!(number(&report, "/frames"), 5.0);
    assert!(number(&report, "/comparison/position_rmse") < 0.05);
}

#[test]
fn what_belongs_to_a_data_set_is_refused() {
    let desk = Desk::new();
    desk.write("correction.toml", CORRECTION);
    for (option, words) in [
        ("--data tiny", "--data is of a training on a data set"),
        ("--from other", "--from is of a training on a data set"),
        ("--micro-batch 2", "--micro-batch is of a training"),
    ] {
        let call = format!("train correction.toml -o run {option}");
        desk.fails(&call, 1, &["correction.toml", words, "leave it out"]);
    }
    let call = "train correction.toml -o run --set teacher.scenes=[\"nowhere\"]";
    desk.fails(call, 1, &["teacher.scenes", "nowhere"]);
    desk.fails("train first -o run", 1, &["--data"]);
    assert!(!desk.path("run").exists());
}
