//! A rank that is killed, and one whose work fails: all others end within seconds and say which it
//! was, and the same command goes on from what they leave to the same bytes.

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use crate::folder::{OnRanks, TestFolder, must_fail, training};

/// Time that the other ranks have to end.
const PATIENCE: Duration = Duration::from_secs(15);

/// A training that ranks share.
const TRAIN: &str = "train steps.toml --data tiny --steps 600 --checkpoint-every 1s -o out";

/// A folder with a training and its data.
fn dir() -> TestFolder {
    let dir = TestFolder::new();
    dir.write("steps.toml", training());
    dir.json_on(1, "data generate tiny -o tiny");
    dir
}

/// The files in `out`, which it takes away.
fn result(dir: &TestFolder) -> Vec<(String, Vec<u8>)> {
    let files = dir.files("out");
    std::fs::remove_dir_all(dir.path("out")).unwrap();
    files
}

#[test]
fn a_killed_rank_ends_all_is_named_and_changes_nothing() {
    let dir = dir();
    dir.json_on(1, TRAIN);
    let expected = result(&dir);
    for victim in [0, 1] {
        let said = killed(&dir, victim);
        assert!(said.contains(&format!("rank {victim} ")), "{said}");
        dir.json_on(3, &format!("{TRAIN} --resume"));
        assert!(result(&dir) == expected, "other bytes");
    }
}

/// The words of two ranks that train when one of them was killed in the middle.
fn killed(dir: &TestFolder, rank: usize) -> String {
    let mut command = dir.on(2, TRAIN);
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let started = Instant::now();
    while ranks_of(child.id()).len() < 2 || !dir.path("out/checkpoint.safetensors").exists() {
        assert!(started.elapsed() < Duration::from_secs(60));
        thread::sleep(Duration::from_millis(5));
    }
    let ranks = ranks_of(child.id());
    send("-9", ranks[rank]);
    let killed = Instant::now();
    // mpirun may be gone a moment before the last of them.
    while child.try_wait().unwrap().is_none() || ranks.iter().any(|rank| is_running(*rank)) {
        assert!(killed.elapsed() < PATIENCE, "goes on after a kill");
        thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().unwrap();
    assert!(!output.status.success());
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_rank_whose_work_fails_is_named_and_changes_nothing() {
    let dir = dir();
    dir.json_on(1, TRAIN);
    let expected = result(&dir);
    // Rank 1 has another folder, with a data set that is damaged.
    let other = dir.path("other");
    std::fs::create_dir_all(other.join("tiny")).unwrap();
    std::fs::copy(dir.path("steps.toml"), other.join("steps.toml")).unwrap();
    dir.write("other/tiny/index.json", "{}");
    let scripts = ["exec \"$@\"", "cd other; exec \"$@\""];
    must_fail(&dir.each(scripts, TRAIN), &["rank 1 has failed: "]);
    assert!(!dir.path("out/model.safetensors").exists());
    dir.json_on(2, TRAIN);
    assert!(result(&dir) == expected);
}

/// The processes of the ranks that `mpirun` has started, in their order.
fn ranks_of(mpirun: u32) -> Vec<u32> {
    let children = Command::new("pgrep")
        .args(["-P", &mpirun.to_string(), "-x", "selvedge"])
        .output()
        .unwrap();
    let children = String::from_utf8(children.stdout).unwrap();
    let mut found: Vec<u32> = children.lines().map(|line| line.parse().unwrap()).collect();
    found.sort_unstable();
    found
}

fn is_running(process: u32) -> bool {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat"));
    stat.is_ok_and(|stat| !stat.contains(") Z"))
}

fn send(signal: &str, process: u32) {
    let kill = Command::new("kill")
        .args([signal, &process.to_string()])
        .status();
    assert!(kill.unwrap().success());
}

#[test]
fn a_press_of_ctrl_c_ends_all_ranks_with_whole_files() {
    let dir = dir();
    let train = "train steps.toml --data tiny -o out --steps 1000000";
    let mut child = dir.on(2, train).stdout(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    while ranks_of(child.id()).len() < 2 || !dir.path("out/log.jsonl").exists() {
        assert!(started.elapsed() < Duration::from_secs(60));
        thread::sleep(Duration::from_millis(20));
    }
    // To the ranks, as a batch system does; mpirun has its own short patience.
    for rank in ranks_of(child.id()) {
        send("-TERM", rank);
    }
    let pressed = Instant::now();
    while child.try_wait().unwrap().is_none() {
        assert!(pressed.elapsed() < PATIENCE);
        thread::sleep(Duration::from_millis(10));
    }
    let resume = "train steps.toml --data tiny -o out --resume --for 1s --steps 1000000";
    let report = dir.json_on(3, resume);
    assert_eq!(report["ranks"], 3);
}
