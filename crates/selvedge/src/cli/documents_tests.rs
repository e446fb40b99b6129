//! README and book against the command line: every command that they show is understood, and the
//! commands reference is what the program says of itself.

use std::fs;
use std::path::{Path, PathBuf};

use clap::error::ErrorKind;
use clap::{Command, CommandFactory, Parser};

use super::Cli;

/// Variable that has the commands reference written anew (`cargo xtask book --write`).
const WRITE: &str = "SELVEDGE_WRITE";

#[test]
fn the_book_has_every_command_as_it_is() {
    let path = root().join("docs/src/reference/commands.md");
    let page = reference();
    if std::env::var_os(WRITE).is_some() {
        fs::write(&path, &page).unwrap();
    }
    let is_same = fs::read_to_string(&path).unwrap() == page;
    assert!(is_same, "{}: cargo xtask book --write", path.display());
}

#[test]
fn every_command_of_readme_and_book_is_understood() {
    let mut pages = vec![root().join("README.md")];
    collect(&root().join("docs/src"), &mut pages);
    let (mut count, mut faults) = (0, Vec::new());
    for path in &pages {
        for call in calls(&fs::read_to_string(path).unwrap()) {
            count += 1;
            if let Some(why) = refusal(&call) {
                faults.push(format!("{}: {}: {why}", path.display(), call.text));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
    assert!(count > 100, "only {count} commands were found");
}

/// The commands reference: what `--help` says of the program and of each command.
fn reference() -> String {
    let mut program = Cli::command().term_width(100);
    program.build();
    let mut page = "# Commands\n\nThis page is made by `cargo xtask book --write` from what \
        `selvedge --help` says; do not\nedit it. Every command takes the options of the first \
        section.\n"
        .to_owned();
    add_help(&mut page, &program);
    page
}

/// Adds the help of a command and of those below it; global options stand at the program.
fn add_help(page: &mut String, command: &Command) {
    let name = command.get_bin_name().unwrap_or("selvedge");
    let is_program = name == "selvedge";
    let mut own = command.clone().mut_args(|arg| {
        let is_elsewhere =
            matches!(arg.get_id().as_str(), "help" | "version") || arg.is_global_set();
        arg.hide(is_elsewhere && !is_program)
    });
    let help = own.render_long_help().to_string();
    let lines = help.lines().map(|line| format!("{}\n", line.trim_end()));
    page.push_str(&format!("\n## `{name}`\n\n```text\n"));
    page.extend(lines);
    page.push_str("```\n");
    for below in command.get_subcommands() {
        if !below.is_hide_set() && below.get_name() != "help" {
            add_help(page, below);
        }
    }
}

/// A command of a page, without the program's name.
struct Call {
    text: String,
    /// False in a sentence, which may name a part of a command.
    is_whole: bool,
}

/// The commands of a page: those of its console blocks and those in backticks.
fn calls(page: &str) -> Vec<Call> {
    let mut found = Vec::new();
    let mut block: Option<bool> = None;
    let mut joined = String::new();
    for line in page.lines() {
        let line = line.trim();
        if let Some(info) = line.strip_prefix("```") {
            let language = info.split_whitespace().next();
            let is_console = matches!(language, Some("console" | "sh"));
            block = block.is_none().then_some(is_console);
        } else if block == Some(true) {
            joined.push_str(line);
            if joined.ends_with('\\') {
                joined.pop();
                continue;
            }
            found.extend(call(&joined, true));
            joined.clear();
        } else if block.is_none() {
            // A span that goes on in the next line is left out.
            let parts: Vec<&str> = line.split('`').collect();
            let closed = parts.iter().take(parts.len() - 1);
            let spans = closed.skip(1).step_by(2);
            found.extend(spans.filter_map(|span| call(span, false)));
        }
    }
    found
}

/// The command in `text`; none in a pattern such as `selvedge export <FILE>`.
fn call(text: &str, is_whole: bool) -> Option<Call> {
    let starts = ["selvedge ", "cargo run --release -- "];
    let rest = starts.iter().find_map(|start| text.strip_prefix(start))?;
    let rest = rest.split(" #").next().unwrap_or_default().trim();
    let is_pattern = rest.contains(['<', '[', '…']);
    (!is_pattern).then(|| Call {
        text: rest.to_owned(),
        is_whole,
    })
}

/// The program's message where it does not understand a command.
fn refusal(call: &Call) -> Option<String> {
    let words = shlex::split(&call.text).unwrap_or_default();
    let error = Cli::try_parse_from(std::iter::once("selvedge".to_owned()).chain(words)).err()?;
    let is_partial = matches!(
        error.kind(),
        ErrorKind::MissingRequiredArgument | ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand
    );
    let is_fine = !error.use_stderr() || is_partial && !call.is_whole;
    (!is_fine).then(|| error.to_string())
}

/// Adds the pages of the book below `folder`.
fn collect(folder: &Path, pages: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(&path, pages);
        } else if path.extension().is_some_and(|ending| ending == "md") {
            pages.push(path);
        }
    }
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}
