//! The same bytes for any number of threads, and from one version to the next: hashes of a data
//! set, a training, a rollout and a simulation, kept by the instructions that the kernels use.
//!
//! `SELVEDGE_GOLDENS=write cargo test -p selvedge --test cli goldens` keeps those of this machine.
//!
//! Those of other instructions come from an emulator: `SELVEDGE_THROUGH="qemu-x86_64 -cpu Haswell"`
//! runs the program through it, and `SELVEDGE_INSTRUCTIONS=x86_64-avx2` names what it has
//! (`-cpu Nehalem` is `x86_64-plain`).

use std::path::Path;
use std::process::Command;

use crate::common::{TRAINING, TestFolder, contents};

const KEPT: &str = include_str!("../goldens.txt");

/// The instructions that the kernels choose on this machine, or in the emulator.
fn instructions() -> String {
    let named = std::env::var("SELVEDGE_INSTRUCTIONS");
    named.unwrap_or_else(|_| detected().to_owned())
}

fn detected() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            return "x86_64-avx512";
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            return "x86_64-avx2";
        }
        "x86_64-plain"
    }
    #[cfg(not(target_arch = "x86_64"))]
    std::env::consts::ARCH
}

/// The hash of a file, or of all files in a folder with their names.
fn hash(path: &Path) -> String {
    let mut hasher = blake3::Hasher::new();
    if path.is_dir() {
        for (inner, bytes) in contents(path) {
            let name = inner
                .strip_prefix(path)
                .unwrap()
                .to_string_lossy()
                .into_owned();
            hasher.update(name.as_bytes());
            hasher.update(&bytes);
        }
    } else {
        hasher.update(&std::fs::read(path).unwrap());
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

/// The same call through the emulator, where one is named.
fn through_emulator(command: Command) -> Command {
    let Ok(emulator) = std::env::var("SELVEDGE_THROUGH") else {
        return command;
    };
    let mut words = emulator.split_whitespace();
    let mut emulated = Command::new(words.next().unwrap());
    emulated.args(words).arg(command.get_program());
    emulated.args(command.get_args());
    for (name, value) in command.get_envs() {
        match value {
            Some(value) => emulated.env(name, value),
            None => emulated.env_remove(name),
        };
    }
    if let Some(folder) = command.get_current_dir() {
        emulated.current_dir(folder);
    }
    emulated
}

/// Makes everything on so many threads. Returns names and hashes.
fn make(threads: usize) -> Vec<(&'static str, String)> {
    let dir = TestFolder::with_push();
    dir.write("steps.toml", TRAINING.replace("steps = 6", "steps = 50"));
    let run = |arguments: &str| {
        let mut command = through_emulator(dir.command(arguments));
        let output = command
            .env("RAYON_NUM_THREADS", threads.to_string())
            .output();
        let output = output.unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments}: {said}");
    };
    run(&format!("data generate tiny -o tiny -j {threads}"));
    run("train steps.toml --data tiny -o run");
    run("run push.toml -o truth.safetensors");
    run("run --compare push.toml --model run/model.safetensors -o rollout --no-clip --frames 20");
    let all = [
        ("data set", "tiny"),
        ("simulation", "truth.safetensors"),
        ("training of 50 steps", "run"),
        ("rollout", "rollout/rollout.safetensors"),
    ];
    all.map(|(name, path)| (name, hash(&dir.path(path))))
        .to_vec()
}

#[test]
fn results_are_those_that_are_kept_for_any_number_of_threads() {
    let found = make(1);
    assert_eq!(make(3), found, "3 threads");
    let own = instructions();
    let own = own.as_str();
    let line = |(name, hash): &(&str, String)| format!("{own} | {name} | {hash}");
    if std::env::var_os("SELVEDGE_GOLDENS").is_some_and(|word| word == "write") {
        let mine = format!("{own} |");
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/goldens.txt");
        // As it is now: several may be written one after another.
        let kept = std::fs::read_to_string(&path).unwrap();
        let others = kept.lines().filter(|line| !line.starts_with(&mine));
        let mut text: Vec<String> = others.map(str::to_owned).collect();
        text.extend(found.iter().map(line));
        std::fs::write(path, text.join("\n") + "\n").unwrap();
        return;
    }
    for result in &found {
        let start = format!("{own} | {} | ", result.0);
        // Of other instructions nothing is kept until somebody with such a machine writes it.
        if let Some(kept) = KEPT.lines().find(|kept| kept.starts_with(&start)) {
            assert_eq!(kept, line(result));
        }
    }
}
