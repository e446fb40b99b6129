//! The program on several ranks, started by `mpirun` as people start it: the bytes of one rank,
//! failures that name their rank, and kills.
//!
//! `cargo test -p selvedge --features mpi --test mpi` needs an MPI with `mpirun`.

// A test that cannot be set up fails where it is set up.
#![allow(clippy::unwrap_used)]

#[path = "../cli/common/mod.rs"]
#[allow(dead_code, reason = "tests of one rank use more of it")]
mod common;
mod desk;
mod failures;

use serde_json::Value;

use crate::desk::{Desk, OnRanks, training};

/// Files that decide how a training goes on, and what it gave.
const FILES: [&str; 3] = ["checkpoint.safetensors", "model.safetensors", "log.jsonl"];

fn trained(desk: &Desk, folder: &str) -> Vec<Vec<u8>> {
    let read = |name| std::fs::read(desk.path(folder).join(name)).unwrap();
    FILES.into_iter().map(read).collect()
}

#[test]
fn a_training_of_200_steps_has_the_same_bytes_on_1_to_4_ranks() {
    let desk = Desk::new();
    desk.write("steps.toml", training());
    desk.json_on(1, "data generate tiny -o tiny");
    let train = "train steps.toml --data tiny --out";
    desk.json_on(1, &format!("{train} one --steps 200"));
    let expected = trained(&desk, "one");
    for (first, then) in [(1, 2), (2, 3), (3, 4), (4, 1)] {
        let out = format!("run-{first}-{then}");
        desk.json_on(first, &format!("{train} {out} --steps 83"));
        let report = desk.json_on(then, &format!("{train} {out} --steps 200 --resume"));
        assert_eq!(report["ranks"], then);
        assert!(
            trained(&desk, &out) == expected,
            "{first} ranks, then {then}"
        );
    }
}

#[test]
fn a_data_set_has_the_same_bytes_and_goes_on() {
    let desk = Desk::new();
    desk.json_on(1, "data generate tiny -o one");
    for ranks in [2, 3] {
        let out = format!("on-{ranks}");
        let generate = format!("data generate tiny -o {out}");
        let report = desk.json_on(ranks, &generate);
        assert_eq!(report["trajectories_missing"], 0);
        assert!(desk.files(&out) == desk.files("one"));
        std::fs::remove_file(desk.path(&out).join("train/turn.safetensors")).unwrap();
        let report = desk.json_on(ranks, &generate);
        assert_eq!(
            (&report["trajectories_kept"], &report["frames_made"]),
            (&2.into(), &61.into())
        );
        assert!(desk.files(&out) == desk.files("one"));
    }
    let part = desk.json_on(2, "data generate tiny -o part --shard 2/2");
    assert_eq!(part["part"], "2/2");
}

/// Takes from an answer what depends on the clock.
fn take_times(answer: &mut Value) {
    for key in ["timings", "ms_per_frame", "means", "meshes", "seconds"] {
        answer.as_object_mut().unwrap().remove(key);
    }
}

#[test]
fn evaluations_and_stress_tests_say_the_same() {
    let desk = Desk::new();
    desk.write("steps.toml", training());
    desk.json_on(1, "data generate tiny -o tiny");
    desk.json_on(1, "train steps.toml --data tiny -o run --steps 5");
    let model = "--model run/model.safetensors";
    let evaluate = format!("eval {model} --data tiny --split train --horizons 1,5");
    let stress = format!("eval {model} --random 6 --frames 40 --mesh square --density 40");
    let without_times = |mut answer: Value| {
        take_times(&mut answer);
        answer
    };
    for command in [evaluate, stress] {
        let one = without_times(desk.json_on(1, &command));
        for ranks in [2, 3] {
            assert_eq!(
                without_times(desk.json_on(ranks, &command)),
                one,
                "{ranks}: {command}"
            );
        }
    }
}

#[test]
fn a_study_trains_the_same_models() {
    let desk = Desk::new();
    desk.write("steps.toml", training());
    desk.write("study.toml", STUDY);
    for ranks in [1, 3] {
        let report = desk.json_on(ranks, &format!("study study.toml -o on-{ranks}"));
        assert_eq!(
            (&report["trained"], &report["measured"]),
            (&3.into(), &4.into())
        );
        // Once more: all of it is kept.
        desk.json_on(ranks, &format!("study study.toml -o on-{ranks}"));
    }
    for name in ["one", "other", "later"] {
        let file = format!("trainings/{name}/model.safetensors");
        let read = |out: &str| std::fs::read(desk.path(out).join(&file)).unwrap();
        assert!(read("on-1") == read("on-3"), "{name}");
    }
    assert!(desk.files("on-1/data") == desk.files("on-3/data"));
    assert!(desk.path("on-3/report/report.md").is_file());
}

/// Three trainings, one of which goes on from another.
const STUDY: &str = r#"
title = "Three of a kind"
budget = { steps = 20 }

[data]
tiny = { preset = "tiny" }

[evaluation]
horizons = [1]
baselines = ["rigid"]

[[train]]
name = "one"
config = "steps.toml"

[[train]]
name = "other"
config = "steps.toml"
set = ["seed=2"]

[[train]]
name = "later"
config = "steps.toml"
after = "one"
"#;

#[test]
fn what_cannot_be_shared_is_said() {
    let desk = Desk::new();
    desk.write("steps.toml", training());
    desk.json_on(1, "data generate tiny -o tiny");
    desk.fails_on(2, "list configs", &["one rank", "without mpirun"]);
    let train = "train steps.toml --data tiny -o run";
    let words = [
        "work to 4 of 5 ranks",
        "rank 4 would have none",
        "larger learning rate",
    ];
    desk.fails_on(5, train, &words);
    // The paper's models have one sample a step.
    let words = [
        "work to 1 of 3 ranks",
        "ranks 1 to 2 would have none",
        "--set batch.samples=3",
    ];
    desk.fails_on(3, "train rp-gru10 --data tiny -o run", &words);
    desk.fails_on(2, "train corrected -o corrected", &["one rank"]);
    desk.fails_on(2, "train steps.toml --data none -o run", &["none"]);
    desk.fails_on(2, "data generate tiny -o steps.toml/x", &["steps.toml"]);
}
