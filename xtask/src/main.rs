//! The house's own chores, most of them a start of another program with the right arguments.
//!
//! What holds of the repository is in `tests/repository`: `cargo xtask tidy` and `cargo xtask book`
//! run those tests. The steps of `ci` are listed in one place, `.ci/run`. `nightly` runs what takes
//! longer: the commands of the book and `fuzz` (`.ci/fuzz`).
#![allow(
    clippy::print_stdout,
    reason = "a program that talks to people in a terminal"
)]

use std::path::Path;
use std::process::{Command, ExitCode};

use anyhow::{Context, Result, bail, ensure};

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
  fuzz    damaged files for every reader, by libFuzzer ([SECONDS [TARGET...]]; see
          docs/src/contributing/trials.md)
  help    print this text";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let words: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let outcome = match words.as_slice() {
        ["ci", lists @ ..] => start("bash", &[&[".ci/run"][..], lists].concat()),
        ["tidy"] => test("tidy_"),
        ["fuzz", options @ ..] => start("bash", &[&[".ci/fuzz"][..], options].concat()),
        ["nightly"] => long(),
        ["header"] => header("--verify"),
        ["header", "--write"] => header("--quiet"),
        ["book"] => test("book_"),
        ["book", "--build"] => build_book(),
        ["book", "--write"] => write_book(),
        ["book", "--run"] => run_book(),
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

/// Folder of the workspace.
fn root() -> &'static Path {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).parent();
    root.unwrap_or(Path::new("."))
}

/// Runs a program in the root to its end.
fn start(program: &str, arguments: &[&str]) -> Result<()> {
    let mut command = Command::new(program);
    let status = command.args(arguments).current_dir(root()).status();
    let status =
        status.with_context(|| format!("cannot start {program}: .ci/setup installs it"))?;
    ensure!(status.success(), "{program} failed: {status}");
    Ok(())
}

fn cargo(arguments: &[&str]) -> Result<()> {
    start(env!("CARGO"), arguments)
}

/// Runs the tests of the repository whose names begin so.
fn test(names: &str) -> Result<()> {
    let package = ["test", "--locked", "--quiet", "-p", "xtask"];
    cargo(&[&package[..], &["--test", "repository", names]].concat())
}

/// The documents that git keeps, or would: their paths from the root.
fn documents() -> Result<Vec<String>> {
    let mut git = Command::new("git");
    git.args([
        "ls-files",
        "--cached",
        "--others",
        "--exclude-standard",
        "*.md",
    ]);
    let listed = git.current_dir(root()).output();
    let listed = listed.context("cannot start git")?;
    ensure!(listed.status.success(), "git cannot list the documents");
    let paths = String::from_utf8(listed.stdout)?;
    let is_there = |path: &&str| root().join(path).is_file();
    Ok(paths.lines().filter(is_there).map(str::to_owned).collect())
}

/// Checks all links, by lychee, and makes HTML of the book, by mdbook.
fn build_book() -> Result<()> {
    let documents = documents()?;
    let mut links = vec!["--offline", "--include-fragments", "--no-progress"];
    links.extend(documents.iter().map(String::as_str));
    start("lychee", &links)?;
    start("mdbook", &["build", "docs"])
}

/// Writes the quotes and the commands reference anew: the tests that compare them do so.
fn write_book() -> Result<()> {
    for test in [
        "-p xtask --test repository book_quotes",
        "-p selvedge --bin selvedge the_book_has",
    ] {
        let mut command = Command::new(env!("CARGO"));
        command.args(["test", "--locked", "--quiet"]);
        command.args(test.split(' ')).env("SELVEDGE_WRITE", "1");
        let status = command.current_dir(root()).status()?;
        ensure!(status.success(), "a document could not be written");
    }
    Ok(())
}

/// Builds the program and runs the quick commands of the documents with it.
fn run_book() -> Result<()> {
    cargo(&["build", "--locked", "--quiet", "--package", "selvedge"])?;
    let test =
        "test --locked --quiet -p xtask --test repository quick_commands -- --ignored --nocapture";
    cargo(&test.split(' ').collect::<Vec<_>>())
}

/// The header of the library for C by cbindgen, a program beside cargo, not a dependency: it would
/// be the heaviest of all. It is written, or with `--verify` compared with the one that is kept.
fn header(how: &str) -> Result<()> {
    let folder = "crates/selvedge-c";
    let config = format!("{folder}/cbindgen.toml");
    let kept = format!("{folder}/include/selvedge.h");
    let made = start(
        "cbindgen",
        &["--config", &config, "--output", &kept, how, folder],
    );
    made.context("if the header differs from its sources: cargo xtask header --write")
}

/// Runs what takes longer than a change should wait; all of it, and then says what failed.
fn long() -> Result<()> {
    let mut failed = Vec::new();
    if let Err(error) = run_book() {
        failed.push(format!("book --run: {error:#}"));
    }
    if let Err(error) = start("bash", &[".ci/fuzz"]) {
        failed.push(format!("fuzz: {error:#}"));
    }
    if !failed.is_empty() {
        bail!("{}", failed.join("\n"));
    }
    Ok(())
}
