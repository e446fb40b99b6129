//! The program on several ranks, started by `mpirun` as people start it: the bytes of one rank,
//! failures that name their rank, and kills.
//!
//! `cargo test -p selvedge --features mpi --test mpi` needs an MPI with `mpirun`.

// A test that cannot be set up fails where it is set up.
#![allow(clippy::unwrap_used)]

#[path = "../cli/common/mod.rs"]
#[allow(dead_code, reason = "tests of one rank use more of it")]
mod common;
mod failures;
mod folder;

use crate::folder::{OnRanks, TestFolder, training};

/// Files that decide how a training goes on, and what it gave.
const FILES: [&str; 3] = ["checkpoint.safetensors", "model.safetensors", "log.jsonl"];

fn trained(dir: &TestFolder, folder: &str) -> Vec<Vec<u8>> {
    let read = |name| std::fs::read(dir.path(folder).join(name)).unwrap();
    FILES.into_iter().map(read).collect()
}

#[test]
fn a_training_of_200_steps_has_the_same_bytes_on_1_to_4_ranks() {
    let dir = TestFolder::new();
    dir.write("steps.toml", training());
    dir.json_on(1, "data generate tiny -o tiny");
    let train = "train steps.toml --data tiny -o";
    dir.json_on(1, &format!("{train} one --steps 200"));
    let expected = trained(&dir, "one");
    for (first, then) in [(1, 2), (2, 3), (3, 4), (4, 1)] {
        let out = format!("run-{first}-{then}");
        dir.json_on(first, &format!("{train} {out} --steps 83"));
        let report = dir.json_on(then, &format!("{train} {out} --steps 200 --resume"));
        assert_eq!(report["ranks"], then);
        assert!(
            trained(&dir, &out) == expected,
            "{first} ranks, then {then}"
        );
    }
}

#[test]
fn what_cannot_be_shared_is_said() {
    let dir = TestFolder::new();
    dir.write("steps.toml", training());
    dir.json_on(1, "data generate tiny -o tiny");
    for command in [
        "list configs",
        "data generate tiny -o shared",
        "eval --model run/model.safetensors --data tiny -o shared",
    ] {
        dir.fails_on(2, command, &["one rank", "without mpirun", "--shard"]);
    }
    assert!(!dir.path("shared").exists());
    let train = "train steps.toml --data tiny -o run";
    let words = [
        "work to 4 of 5 ranks",
        "rank 4 would have none",
        "larger learning rate",
    ];
    dir.fails_on(5, train, &words);
    // The paper's models have one sample a step.
    let words = [
        "work to 1 of 3 ranks",
        "ranks 1 to 2 would have none",
        "--set batch.samples=3",
    ];
    dir.fails_on(3, "train rp-gru10 --data tiny -o run", &words);
    dir.fails_on(2, "train steps.toml --data none -o run", &["none"]);
}
