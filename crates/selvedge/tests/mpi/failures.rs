//! A rank that is killed, and one whose work fails: all others end within seconds and say which it
//! was, and the same command goes on from what they leave to the same bytes.

use std::process::{Command, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::desk::{Desk, OnRanks, must_fail, training};

/// Time that the other ranks have to end.
const PATIENCE: Duration = Duration::from_secs(15);

/// A command that ranks share.
struct Case {
    command: &'static str,
    /// Added where it goes on.
    resume: &'static str,
    /// The file or folder that tells that it is at work; none where that is when both ranks have
    /// met.
    sign: Option<&'static str>,
}

const CASES: [Case; 5] = [
    Case {
        command: "train steps.toml --data many --steps 600 --checkpoint-every 1s -o out",
        resume: "--resume",
        sign: Some("out/checkpoint.safetensors"),
    },
    Case {
        command: "data generate many.toml -o out",
        resume: "",
        sign: Some("out/train"),
    },
    Case {
        command: "study study.toml -o out",
        resume: "",
        sign: Some("out/trainings"),
    },
    Case {
        command: "eval --model model.safetensors --data many --split train --horizons 1,5",
        resume: "",
        sign: None,
    },
    Case {
        command: "eval --model model.safetensors --random 200 --frames 60 --mesh square --density 40",
        resume: "",
        sign: None,
    },
];

/// A desk with all that the commands need.
fn desk() -> Desk {
    let desk = Desk::new();
    desk.write("steps.toml", training());
    desk.write("many.toml", many());
    desk.write("study.toml", crate::STUDY);
    desk.json_on(1, "data generate many.toml -o many");
    desk.json_on(1, "train steps.toml --data many --steps 5 -o run");
    std::fs::copy(
        desk.path("run/model.safetensors"),
        desk.path("model.safetensors"),
    )
    .unwrap();
    desk
}

/// Results of a command, without times: its answer, or the files in `out`, which it takes away.
fn result(desk: &Desk, mut answer: Value) -> (Value, Vec<(String, Vec<u8>)>) {
    let out = desk.path("out");
    if out.exists() {
        let mut files = desk.files("out");
        let timed = ["record.json", "evaluations", "report"];
        files.retain(|(name, _)| !timed.iter().any(|part| name.contains(part)));
        std::fs::remove_dir_all(out).unwrap();
        return (Value::Null, files);
    }
    crate::take_times(&mut answer);
    (answer, Vec::new())
}

#[test]
fn a_killed_rank_ends_all_is_named_and_changes_nothing() {
    let desk = desk();
    for (number, case) in CASES.iter().enumerate() {
        let whole = desk.json_on(1, case.command);
        let expected = result(&desk, whole);
        let victim = 1 - number % 2;
        let said = killed(&desk, case, victim);
        assert!(
            said.contains(&format!("rank {victim} ")),
            "{}: {said}",
            case.command
        );
        let goes_on = desk.path("out/checkpoint.safetensors").exists();
        let resume = if goes_on { case.resume } else { "" };
        let answer = desk.json_on(3, &format!("{} {resume}", case.command));
        assert!(
            result(&desk, answer) == expected,
            "{}: other bytes",
            case.command
        );
    }
}

/// The words of two ranks of a command when one of them was killed in the middle.
fn killed(desk: &Desk, case: &Case, rank: usize) -> String {
    let mut command = desk.on(2, case.command);
    let mut child = command
        .stdout(Stdio::null())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let is_at_work = || match case.sign {
        Some(sign) => desk.path(sign).exists(),
        None => ranks_of(child.id()).into_iter().all(has_met),
    };
    let started = Instant::now();
    while ranks_of(child.id()).len() < 2 || !is_at_work() {
        assert!(
            started.elapsed() < Duration::from_secs(60),
            "{}",
            case.command
        );
        thread::sleep(Duration::from_millis(5));
    }
    let ranks = ranks_of(child.id());
    send("-9", ranks[rank]);
    let killed = Instant::now();
    // mpirun may be gone a moment before the last of them.
    while child.try_wait().unwrap().is_none() || ranks.iter().any(|rank| is_running(*rank)) {
        assert!(
            killed.elapsed() < PATIENCE,
            "{} goes on after a kill",
            case.command
        );
        thread::sleep(Duration::from_millis(10));
    }
    let output = child.wait_with_output().unwrap();
    assert!(!output.status.success(), "{}", case.command);
    String::from_utf8_lossy(&output.stderr).into_owned()
}

#[test]
fn a_rank_whose_work_fails_is_named_and_changes_nothing() {
    let desk = desk();
    // Rank 1 has another folder, with a model and a data set that are damaged.
    let other = desk.path("other");
    std::fs::create_dir(&other).unwrap();
    desk.write("other/model.safetensors", "damaged");
    for name in ["steps.toml", "many.toml", "study.toml"] {
        std::fs::copy(desk.path(name), other.join(name)).unwrap();
    }
    std::fs::create_dir(other.join("many")).unwrap();
    desk.write("other/many/index.json", "{}");
    let scripts = ["exec \"$@\"", "cd other; exec \"$@\""];
    for case in [&CASES[0], &CASES[3], &CASES[4]] {
        let whole = desk.json_on(1, case.command);
        let expected = result(&desk, whole);
        must_fail(&desk.each(scripts, case.command), &["rank 1 has failed: "]);
        assert!(!desk.path("out/model.safetensors").exists());
        let answer = desk.json_on(2, case.command);
        assert!(result(&desk, answer) == expected, "{}", case.command);
    }
}

#[test]
fn work_that_fails_wherever_it_is_done_names_the_rank_and_goes_on() {
    let desk = desk();
    // A folder where a file belongs.
    for (case, obstacle, words) in [
        (
            &CASES[1],
            "out/train/push-15.safetensors",
            "push-15.safetensors",
        ),
        (
            &CASES[2],
            "out/trainings/other/model.safetensors",
            "has failed: training \"other\"",
        ),
    ] {
        let whole = desk.json_on(1, case.command);
        let expected = result(&desk, whole);
        if case.command.starts_with("data generate") {
            // It asks for an empty folder, or for one that it began.
            killed(&desk, case, 0);
            let _ = std::fs::remove_file(desk.path(obstacle));
        }
        std::fs::create_dir_all(desk.path(obstacle)).unwrap();
        desk.fails_on(2, case.command, &[words]);
        std::fs::remove_dir(desk.path(obstacle)).unwrap();
        let answer = desk.json_on(2, case.command);
        assert!(result(&desk, answer) == expected, "{}", case.command);
    }
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

/// Returns true where one of two ranks has the memory of both before it, by which Open MPI sends
/// messages within a machine.
fn has_met(process: u32) -> bool {
    let maps = std::fs::read_to_string(format!("/proc/{process}/maps")).unwrap_or_default();
    maps.matches("/vader_segment").count() >= 2
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

/// The preset `tiny` with many motions.
fn many() -> String {
    let tiny = selvedge_data::shipped_presets()
        .iter()
        .find(|preset| preset.0 == "tiny");
    let mut preset: toml::Table = toml::from_str(tiny.unwrap().1).unwrap();
    let motions = preset["motions"].as_table_mut().unwrap();
    let push = motions.remove("push").unwrap();
    motions.remove("turn");
    let mut names = Vec::new();
    for number in 0..16 {
        let mut motion = push.clone();
        let pace = &mut motion["inline"]["blocks"][1]["translations"][0]["pace"];
        pace["distance"] = toml::Value::Float(0.1 + 0.01 * f64::from(number));
        let name = format!("push-{number}");
        motions.insert(name.clone(), motion);
        names.push(toml::Value::String(name));
    }
    preset["train"] = toml::Value::Array(names);
    toml::to_string(&preset).unwrap()
}

#[test]
fn a_press_of_ctrl_c_ends_all_ranks_with_whole_files() {
    let desk = Desk::new();
    desk.write("steps.toml", training());
    desk.json_on(1, "data generate tiny -o tiny");
    let train = "train steps.toml --data tiny -o out --steps 1000000";
    let mut child = desk.on(2, train).stdout(Stdio::null()).spawn().unwrap();
    let started = Instant::now();
    while ranks_of(child.id()).len() < 2 || !desk.path("out/log.jsonl").exists() {
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
    let report = desk.json_on(3, resume);
    assert_eq!(report["ranks"], 3);
}
