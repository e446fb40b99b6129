//! The house's own chores: `cargo xtask tidy` checks what no compiler checks (see [`tidy`]),
//! `cargo xtask book` checks the documents against the program (see [`book`]),
//! `cargo xtask ci` runs everything that must hold before a change is taken, `cargo xtask nightly`
//! what takes longer: the commands of the book, and `fuzz` (the crate `selvedge-trials`), which is a
//! command, too, `cargo xtask sanitize` and `miri` tests under nightly's checks,
//! `cargo xtask header` makes the header of the library for C (see [`header`]).
//!
//! The steps of `ci` are listed in one place, `.ci/run`, which this program only starts.
#![allow(
    clippy::print_stdout,
    reason = "a program that talks to people in a terminal"
)]

mod book;
mod header;
mod metadata;
mod nightly;
mod tidy;
mod tree;
mod violation;

use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail, ensure};

use nightly::Sanitizer;

const HELP: &str = "\
usage: cargo xtask COMMAND

  ci      run .ci/run: format, tidy, lints, tests (with `all` or names of lists: those)
  nightly the quick commands of the book, and `fuzz`, for an hour
  tidy    check dependencies, equation labels and cards of models
  book    check summary and quotes of the documents
            --build   check all links, and make HTML (needs lychee and mdbook: .ci/setup)
            --write   bring quotes and the commands reference up to date
            --run     run the quick commands
  header  check that the header of the library for C is what its sources make, by cbindgen
            --write          write it
  fuzz    damaged files for every reader, by libFuzzer (--for 10m; see
          docs/src/contributing/trials.md)
  sanitize address|thread
          tests of what has unsafe code or threads under a sanitizer of nightly Rust; arguments of
          `cargo test` choose others
  miri    tests of the kernels under Miri, likewise
  help    print this text";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        ["ci", lists @ ..] => ci(lists),
        ["tidy"] => tidy::run(),
        ["fuzz", options @ ..] => fuzz(options),
        ["nightly"] => long(),
        ["header"] => header::run(false),
        ["header", "--write"] => header::run(true),
        ["miri", tests @ ..] => nightly::miri(tests),
        ["sanitize", name, tests @ ..] if let Some(one) = Sanitizer::named(name) => one.run(tests),
        ["book"] => book::check(),
        ["book", "--build"] => book::build(),
        ["book", "--write"] => book::write(),
        ["book", "--run"] => book::run(),
        ["help" | "--help" | "-h"] => {
            println!("{HELP}");
            Ok(())
        }
        _ => {
            eprintln!("{HELP}");
            return ExitCode::from(2);
        }
    };
    match outcome {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// Builds the program and the fuzzer's, and starts it.
fn fuzz(options: &[&str]) -> Result<()> {
    let cargo = |arguments: &[&str]| -> Result<bool> {
        let mut command = Command::new(env!("CARGO"));
        let status = command
            .args(arguments)
            .current_dir(metadata::root())
            .status();
        Ok(status.context("cannot start cargo")?.success())
    };
    let packages = ["-p", "selvedge", "-p", "selvedge-trials"];
    let is_built = cargo(&[&["build", "--locked", "--quiet"], &packages[..]].concat())?;
    let run = ["run", "--locked", "--quiet", "-p", "selvedge-trials", "--"];
    if !is_built || !cargo(&[&run[..], options].concat())? {
        bail!("something was found");
    }
    Ok(())
}

/// Runs what takes longer than a change should wait; all of it, and then says what failed.
fn long() -> Result<()> {
    let mut failed = Vec::new();
    if let Err(error) = book::run() {
        failed.push(format!("book --run: {error:#}"));
    }
    if let Err(error) = fuzz(&["--for", "60s"]) {
        failed.push(format!("fuzz: {error:#}"));
    }
    if !failed.is_empty() {
        bail!("{}", failed.join("\n"));
    }
    Ok(())
}

fn ci(lists: &[&str]) -> Result<()> {
    let mut bash = Command::new("bash");
    bash.arg(".ci/run").args(lists);
    let status = bash.current_dir(metadata::root()).status();
    let status = status.context("cannot start bash for .ci/run")?;
    ensure!(status.success(), "a step of .ci/run failed");
    Ok(())
}
