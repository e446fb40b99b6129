//! `cargo xtask fuzz`: the readers under libFuzzer, which keeps inputs that reach new code and
//! damages them further.
//!
//! The program `guided` of this package is built with counters at every branch, by the stable
//! compiler; it needs a C++ compiler for libFuzzer. Inputs are kept in `target/guided`.
#![allow(
    clippy::print_stdout,
    clippy::print_stderr,
    reason = "a program that talks to people in a terminal"
)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, ExitCode, Stdio};
use std::time::Duration;

use anyhow::{Context, Result, ensure};
use clap::Parser;
use selvedge_trials::TARGETS;

/// Damaged files, texts and messages for every reader, by libFuzzer
#[derive(Parser)]
#[command(bin_name = "cargo xtask fuzz")]
struct Options {
    /// For every target
    #[arg(long = "for", value_name = "SPAN", default_value = "60s", value_parser = selvedge_lab::span::parse)]
    span: Duration,
    /// Only this target (repeat for several)
    #[arg(long)]
    target: Vec<String>,
}

/// Counters at every edge of the code, and the sides of every comparison.
const FLAGS: &str = "-Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters \
    -Cllvm-args=-sanitizer-coverage-pc-table -Cllvm-args=-sanitizer-coverage-trace-compares \
    --cfg fuzzing";
/// Size that an input may have `[bytes]`.
const MOST_BYTES: usize = 1 << 18;

fn main() -> ExitCode {
    match run(&Options::parse()) {
        Ok(true) => ExitCode::SUCCESS,
        Ok(false) => ExitCode::FAILURE,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Runs the targets that were asked for, or all; returns false where something was found.
fn run(options: &Options) -> Result<bool> {
    let names = TARGETS.each_ref().map(|target| target.name);
    let asked = &options.target;
    for name in asked {
        let is_known = names.contains(&name.as_str());
        ensure!(is_known, "there is no target {name:?}");
    }
    let own = std::env::current_exe().context("the path of this program")?;
    let program = own.with_file_name("selvedge");
    ensure!(program.is_file(), "{}: is not there", program.display());
    let fuzzer = build()?;
    let mut holds = true;
    for name in names {
        if asked.is_empty() || asked.iter().any(|other| other == name) {
            println!("== {name}");
            holds &= fuzz(&fuzzer, &program, name, options.span)?;
        }
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
fn fuzz(fuzzer: &Path, program: &Path, name: &str, span: Duration) -> Result<bool> {
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
        .env("SELVEDGE", program)
        .stdout(Stdio::null())
        .status()
        .context("the fuzzer")?;
    Ok(status.success())
}
