//! Runs the quick commands of the book, page by page, each page in an empty folder with `assets`
//! and `docs` beside it.
//!
//! A block marked `toml file=NAME` is written to that file where it stands.

use std::fs;
use std::path::Path;
use std::time::Instant;

use anyhow::{Context, Result};

use super::commands::{self, Command};
use super::fault::Fault;
use super::markdown::{self, Block};
use super::places::PAGES;
use super::program::Program;
use crate::tree::{TextFile, Tree};

/// Folder in which pages are tried, relative to the root.
const FOLDER: &str = "target/book/run";
/// Folders of the repository that commands may name.
const BESIDE: [&str; 2] = ["assets", "docs"];
/// Beginning of the attribute that names the file of a block.
const FILE: &str = "file=";

/// Outcome of a run.
#[derive(Clone, Debug, Default)]
pub(super) struct Outcome {
    /// Commands that ran.
    pub(super) count: usize,
    /// Commands that failed, or do not say how long they take.
    pub(super) faults: Vec<Fault>,
}

/// Runs the quick commands of all pages and prints how long each takes.
///
/// # Errors
/// When a folder cannot be made or the program cannot be started.
pub(super) fn run(root: &Path, tree: &Tree, program: &Program) -> Result<Outcome> {
    let mut outcome = Outcome::default();
    let folder = root.join(FOLDER);
    if folder.exists() {
        fs::remove_dir_all(&folder).context("cannot empty the folder of the last run")?;
    }
    for file in tree.texts.iter().filter(|file| is_tried(file)) {
        let folder = folder.join(file.path.replace(['/', '.'], "-"));
        fs::create_dir_all(&folder)?;
        for name in BESIDE {
            beside(&root.join(name), &folder.join(name))?;
        }
        try_page(file, &folder, program, &mut outcome)?;
    }
    Ok(outcome)
}

fn is_tried(file: &TextFile) -> bool {
    let is_page = file.path == "README.md" || file.path.starts_with(PAGES);
    is_page
        && commands::of_page(file)
            .iter()
            .any(|command| command.is_quick)
}

#[cfg(unix)]
fn beside(from: &Path, to: &Path) -> Result<()> {
    std::os::unix::fs::symlink(from, to).with_context(|| format!("cannot make {}", to.display()))
}

#[cfg(not(unix))]
fn beside(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let target = to.join(entry.file_name());
        if entry.file_type()?.is_dir() {
            beside(&entry.path(), &target)?;
        } else {
            fs::copy(entry.path(), target)?;
        }
    }
    Ok(())
}

fn try_page(
    file: &TextFile,
    folder: &Path,
    program: &Program,
    outcome: &mut Outcome,
) -> Result<()> {
    let page = markdown::page(&file.text);
    for block in &page.blocks {
        if let Some(name) = file_of(block) {
            let lines: Vec<&str> = block.lines.iter().map(|line| line.text).collect();
            fs::write(folder.join(name), lines.join("\n") + "\n")?;
        }
        for command in commands::of_block(&file.path, block) {
            if command.is_quick {
                outcome.count += 1;
                outcome
                    .faults
                    .extend(try_command(&command, folder, program)?);
            }
        }
    }
    Ok(())
}

/// Name of the file that a block is.
fn file_of<'a>(block: &Block<'a>) -> Option<&'a str> {
    block.info.iter().find_map(|word| word.strip_prefix(FILE))
}

fn try_command(command: &Command, folder: &Path, program: &Program) -> Result<Option<Fault>> {
    let call = command.words.join(" ");
    let began = Instant::now();
    let output = program.run(folder, &command.words)?;
    let seconds = began.elapsed().as_secs_f64();
    println!(
        "{seconds:7.1} s, said {:>8}: selvedge {call}",
        command.comment
    );
    let what = if !output.status.success() {
        let message = String::from_utf8_lossy(&output.stderr);
        let last = message.lines().rev().find(|line| line.contains("error"));
        format!("selvedge {call} failed: {}", last.unwrap_or_default())
    } else if !is_duration(&command.comment) {
        format!("selvedge {call} does not say how long it takes")
    } else {
        return Ok(None);
    };
    Ok(Some(Fault::new(&command.path, command.line, what)))
}

/// True where a comment begins with a duration, as `at once`, `3 s` or `1.4 s until it moves`.
fn is_duration(comment: &str) -> bool {
    let mut words = comment.split([' ', ',', ':']);
    match (words.next(), words.next()) {
        (Some("at"), Some("once")) => true,
        (Some(number), Some(unit)) => {
            number.parse::<f64>().is_ok() && ["ms", "s", "min", "h"].contains(&unit)
        }
        _ => false,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_duration_is_a_number_with_its_unit() {
        for good in ["at once", "3 s", "1.4 s until it moves", "2 min, once"] {
            assert!(is_duration(good), "{good}");
        }
        for bad in ["", "soon", "3", "3 frames", "at last"] {
            assert!(!is_duration(bad), "{bad}");
        }
    }

    #[test]
    fn pages_with_quick_blocks_are_tried() {
        let file = |path: &str, text: &str| TextFile {
            path: path.to_owned(),
            text: text.to_owned(),
        };
        let quick = "```console quick\nselvedge presets\n```\n";
        assert!(is_tried(&file("docs/src/a.md", quick)));
        assert!(!is_tried(&file("other/a.md", quick)));
        assert!(!is_tried(&file(
            "docs/src/a.md",
            &quick.replace(" quick", "")
        )));
    }

    #[test]
    fn a_block_names_its_file() {
        let page = markdown::page("```toml file=a.toml\nname = 1\n```\n```toml\n```\n");
        assert_eq!(file_of(&page.blocks[0]), Some("a.toml"));
        assert_eq!(file_of(&page.blocks[1]), None);
    }
}
