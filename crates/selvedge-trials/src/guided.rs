//! The readers under libFuzzer: inputs that reach new code are kept and damaged further.
//!
//! The program `guided` of this package is built with counters at every branch, by the stable
//! compiler; it needs a C++ compiler for libFuzzer. Inputs are kept in `target/guided`.

use std::fs;
use std::io::{BufRead, BufReader};
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

/// Numbers of one target.
#[derive(Default)]
struct Tally {
    inputs: u64,
    kept: u64,
    /// Edges that the examples reach, and that all kept inputs reach.
    edges: [u64; 2],
}

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
    println!("| target | inputs | kept | edges at first | edges | held |");
    println!("|---|---|---|---|---|---|");
    let mut holds = true;
    for name in names.into_iter().filter(|name| is_wanted(name, targets)) {
        let (tally, is_fine) = fuzz_one(&fuzzer, name, span)?;
        let [first, last] = tally.edges;
        let held = if is_fine { "all" } else { "see above" };
        let (inputs, kept) = (tally.inputs, tally.kept);
        println!("| {name} | {inputs} | {kept} | {first} | {last} | {held} |");
        holds &= is_fine;
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

/// Runs one target for `span`. Returns false with its numbers where it ended early.
fn fuzz_one(fuzzer: &Path, name: &str, span: Duration) -> Result<(Tally, bool)> {
    let folder = Path::new("target/guided");
    let [kept, examples, findings] =
        ["kept", "examples", "findings"].map(|part| folder.join(part).join(name));
    for made in [&kept, &examples, &findings] {
        fs::create_dir_all(made).with_context(|| made.display().to_string())?;
    }
    let mut child = Command::new(fuzzer)
        .args([&kept, &examples])
        .arg(format!("-max_total_time={}", span.as_secs().max(1)))
        .arg(format!("-max_len={MOST_BYTES}"))
        .arg(format!("-artifact_prefix={}/", findings.display()))
        .args(["-timeout=20", "-rss_limit_mb=3000", "-use_value_profile=1"])
        .env("SELVEDGE_TARGET", name)
        .env("SELVEDGE_EXAMPLES", &examples)
        .env("SELVEDGE", Program::find()?.path())
        .stderr(Stdio::piped())
        .stdout(Stdio::null())
        .spawn()
        .context("the fuzzer")?;
    let mut tally = Tally::default();
    let said = child.stderr.take().context("what the fuzzer says")?;
    let mut last: Vec<String> = Vec::new();
    for line in BufReader::new(said).lines() {
        let line = line?;
        tally.follow(&line);
        last.push(line);
        if last.len() > 60 {
            last.remove(0);
        }
    }
    let is_fine = child.wait()?.success();
    if !is_fine {
        println!("{}", last.join("\n"));
    }
    Ok((tally, is_fine))
}

impl Tally {
    /// Takes the numbers of a line as `#1024 NEW cov: 120 ft: 200 corp: 30/2kb`.
    fn follow(&mut self, line: &str) {
        let mut words = line.split_whitespace();
        let Some(inputs) = words
            .next()
            .and_then(|word| word.strip_prefix('#')?.parse().ok())
        else {
            return;
        };
        let is_first = words.next() == Some("INITED");
        let after = |name: &str| {
            let mut words = line.split_whitespace().skip_while(|word| *word != name);
            let number = words.nth(1)?.split('/').next()?;
            number.parse().ok()
        };
        self.inputs = inputs;
        self.kept = after("corp:").unwrap_or(self.kept);
        self.edges[1] = after("cov:").unwrap_or(self.edges[1]);
        if is_first {
            self.edges[0] = self.edges[1];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_of_libfuzzer_are_understood() {
        let mut tally = Tally::default();
        for line in [
            "INFO: Seed: 1",
            "#3\tINITED cov: 83 ft: 84 corp: 2/10b exec/s: 0 rss: 27Mb",
            "#1024\tNEW    cov: 120 ft: 200 corp: 30/2Kb lim: 4096 exec/s: 0",
            "#2000\tDONE   cov: 121 ft: 210 corp: 31/2Kb lim: 4096 exec/s: 900",
        ] {
            tally.follow(line);
        }
        assert_eq!(
            (tally.inputs, tally.kept, tally.edges),
            (2000, 31, [83, 121])
        );
    }
}
