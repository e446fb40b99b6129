//! The same bytes for any number of threads, and from one version to the next: hashes of a data
//! set, a training, a rollout and a simulation, kept by the instructions that the kernels use.
//!
//! `SELVEDGE_GOLDENS=write cargo test -p selvedge --test cli goldens` keeps those of this machine.
//! They may change with the C library, too, whose sines and cosines are in them.

use std::path::Path;

use crate::common::{Desk, PUSH, TRAINING, contents};

const KEPT: &str = include_str!("../goldens.txt");

/// The instructions that the kernels choose on this machine.
fn instructions() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    {
        if std::arch::is_x86_feature_detected!("avx512f") {
            return "x86_64-avx512";
        }
        if std::arch::is_x86_feature_detected!("avx2") {
            return "x86_64-avx2";
        }
    }
    std::env::consts::ARCH
}

/// The hash of a file, or of all files in a folder with their names.
fn hash(path: &Path) -> String {
    let mut hasher = blake3::Hasher::new();
    match path.is_dir() {
        false => drop(hasher.update(&std::fs::read(path).unwrap())),
        true => {
            for (inner, bytes) in contents(path) {
                let name = inner
                    .strip_prefix(path)
                    .unwrap()
                    .to_string_lossy()
                    .into_owned();
                hasher.update(name.as_bytes());
                hasher.update(&bytes);
            }
        }
    }
    hasher.finalize().to_hex()[..32].to_owned()
}

/// Makes everything on so many threads. Returns names and hashes.
fn make(threads: usize) -> Vec<(&'static str, String)> {
    let desk = Desk::new();
    desk.write("push.toml", PUSH);
    desk.write("steps.toml", TRAINING.replace("steps = 6", "steps = 50"));
    let run = |arguments: &str| {
        let mut command = desk.command(arguments);
        let output = command
            .env("RAYON_NUM_THREADS", threads.to_string())
            .output();
        let output = output.unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.success(), "{arguments}: {said}");
    };
    run(&format!(
        "dataset generate tiny --out tiny --threads {threads}"
    ));
    run("train steps.toml --data tiny --out run");
    run("simulate push.toml --out truth.safetensors");
    run("rollout push.toml --model run/model.safetensors --out rollout --no-clip --frames 20");
    let all = [
        ("data set", "tiny"),
        ("simulation", "truth.safetensors"),
        ("training of 50 steps", "run"),
        ("rollout", "rollout/rollout.safetensors"),
    ];
    all.map(|(name, path)| (name, hash(&desk.path(path))))
        .to_vec()
}

#[test]
fn results_are_those_that_are_kept_for_any_number_of_threads() {
    let found = make(1);
    for threads in [2, 3] {
        assert_eq!(make(threads), found, "{threads} threads");
    }
    let own = instructions();
    let line = |(name, hash): &(&str, String)| format!("{own} | {name} | {hash}");
    if std::env::var_os("SELVEDGE_GOLDENS").is_some_and(|word| word == "write") {
        let others = KEPT.lines().filter(|kept| !kept.starts_with(own));
        let mut text: Vec<String> = others.map(str::to_owned).collect();
        text.extend(found.iter().map(line));
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/goldens.txt");
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
