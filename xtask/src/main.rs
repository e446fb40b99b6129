//! The house's own chores: `cargo xtask tidy` checks what no compiler checks (see [`tidy`]),
//! `cargo xtask book` checks the documents against the program (see [`book`]),
//! `cargo xtask ci` runs everything that must hold before a change is taken, `cargo xtask fuzz`,
//! `guided`, `faults`, `kill`, `soak` and `load` the trials that take longer, of the crate
//! `selvedge-trials`, `cargo xtask sanitize` and `miri` tests under nightly's checks,
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
mod rust;
mod tidy;
mod tree;

use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail};

use nightly::Sanitizer;

const HELP: &str = "\
usage: cargo xtask COMMAND

  ci      run every step of .ci/run: tests, format, lints, docs, tidy
  tidy    check dependencies, circles, signatures, sizes, openings, prose, equation labels, marks,
          cards and documents
  book    check README and book: links, summary, quotes, commands, which are parsed and, where
          quick, run; build HTML where mdbook is installed
            --write          bring quotes and the commands reference up to date
            --no-run         parse the quick commands, too, instead of running them
            --program PATH   ask this program instead of building one
  header  check that the header of the library for C is what its sources make, by cbindgen
            --write          write it
  fuzz    damaged files for every reader (--for 10m; see docs/src/contributing/trials.md)
  guided  the same with libFuzzer, which keeps inputs that reach new code
  faults  calls on files, and for memory, that fail under every command
  kill    long commands, or one of their ranks, ended at random times
  soak    steppers and the viewer for a long time
  load    the viewer under many connections
  sanitize address|thread
          tests of what has unsafe code or threads under a sanitizer of nightly Rust; arguments of
          `cargo test` choose others
  miri    tests of the kernels under Miri, likewise
  help    print this text";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        ["ci"] => ci(),
        ["tidy"] => tidy::run(),
        [
            trial @ ("fuzz" | "guided" | "faults" | "kill" | "soak" | "load"),
            options @ ..,
        ] => trials(trial, options),
        ["header"] => header::run(false),
        ["header", "--write"] => header::run(true),
        ["miri", tests @ ..] => nightly::miri(tests),
        ["sanitize", name, tests @ ..] if let Some(one) = Sanitizer::named(name) => one.run(tests),
        ["book", options @ ..] => match book::Options::parse(options) {
            Some(options) => book::run(&options),
            None => {
                eprintln!("{HELP}");
                return ExitCode::from(2);
            }
        },
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

/// Builds the program and the trials, and starts one of them.
fn trials(trial: &str, options: &[&str]) -> Result<()> {
    let root = metadata::workspace_root()?;
    let cargo = |arguments: &[&str]| -> Result<bool> {
        let mut command = Command::new(env!("CARGO"));
        let status = command.args(arguments).current_dir(&root).status();
        Ok(status.context("cannot start cargo")?.success())
    };
    let mut build = vec![
        "build",
        "--quiet",
        "-p",
        "selvedge",
        "-p",
        "selvedge-trials",
    ];
    if options.contains(&"--ranks") {
        build.extend(["--features", "selvedge/mpi"]);
    }
    let is_built = cargo(&build)?;
    let run = ["run", "--quiet", "-p", "selvedge-trials", "--", trial];
    if !is_built || !cargo(&[&run[..], options].concat())? {
        bail!("the trial failed");
    }
    Ok(())
}

fn ci() -> Result<()> {
    let root = metadata::workspace_root()?;
    let script = Path::new(&root).join(".ci/run");
    let status = Command::new("bash")
        .arg(&script)
        .current_dir(&root)
        .status()
        .with_context(|| format!("cannot start bash for {}", script.display()))?;
    if !status.success() {
        bail!("a step of .ci/run failed");
    }
    Ok(())
}
