//! The readers under libFuzzer: inputs that reach new code are kept and damaged further.
//!
//! The program `guided` of this package is built with counters at every branch, by the stable
//! compiler; it needs a C++ compiler for libFuzzer. Inputs are kept in `target/guided`.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, ensure};

use crate::fuzz;
use crate::is_wanted;
use crate::program::Program;

/// Counters at every edge of the code, and the sides of every comparison.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares \
    --cfg fuzzing";
/// Size that an input may have `[bytes]`.
const MOST_BYTES: usize = 1 << 18;

/// Runs the targets of these names, or all, each for `span`; returns false where something was
/// found.
pub(crate) fn run(span: Duration, targets: &[String]) -> Result<bool> {
    let names = fuzz::names();
    for name in targets {
        ensure!(
            names.contains(&name.as_str()),
            "there is no target {name:?}"
        );
    }
    Program::find()?;
    let fuzzer = build()?;
    let mut holds = true;
    for name in names.into_iter().filter(|name| is_wanted(name, targets)) {
        println!("== {name}");
        holds &= fuzz_one(&fuzzer, name, span)?;
    }
    Ok(holds)
}

/// Builds the fuzzer and returns its path.
fn build() -> Result<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let folder = root.join("target/guided");
    let output = Command::new("rustc").arg("-vV").output();
    let output = output.context("rustc, which says what machine this is")?;
    let text = String::from_utf8_lossy(&output.stdout);
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    let host = host.context("rustc does not say its host")?;
    // With a target the flags are not those of build scripts.
    let status = Command::new("cargo")
        .args(["build", "--quiet", "-p", "selvedge-trials"])
        .args(["--bin", "guided", "--features", "guided"])
        .args(["--target", host, "--target-dir"])
        .arg(&folder)
        .env("RUSTFLAGS", FLAGS)
        .current_dir(&root)
        .status()
        .context("cannot start cargo")?;
    ensure!(status.success(), "the fuzzer could not be built");
    Ok(folder.join(host).join("debug/guided"))
}

/// Runs one target for `span`, with libFuzzer's own words. Returns false where it ended early.
fn fuzz_one(fuzzer: &Path, name: &str, span: Duration) -> Result<bool> {
    let folder = Path::new("target/guided");
    let [kept, examples, findings] =
        ["kept", "examples", "findings"].map(|part| folder.join(part).join(name));
    for made in [&kept, &examples, &findings] {
        fs::create_dir_all(made).with_context(|| made.display().to_string())?;
    }
    let status = Command::new(fuzzer)
        .args([&kept, &examples])
        .arg(format!("-max_total_time={}", span.as_secs().max(1)))
        .arg(format!("-max_len={MOST_BYTES}"))
        .arg(format!("-artifact_prefix={}/", findings.display()))
        .args(["-timeout=20", "-rss_limit_mb=3000", "-use_value_profile=1"])
        .args(["-verbosity=0", "-print_final_stats=1"])
        .env("SELVEDGE_TARGET", name)
        .env("SELVEDGE_EXAMPLES", &examples)
        .env("SELVEDGE", Program::find()?.path())
        .stdout(Stdio::null())
        .status()
        .context("the fuzzer")?;
    Ok(status.success())
}
