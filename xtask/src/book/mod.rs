//! `cargo xtask book`: checks the README and the book under `docs/src`, and builds the book as HTML
//! where `mdbook` is installed.
//!
//! Links and their anchors lead somewhere, every page is in the summary, quoted examples are their
//! files, the commands reference is what the program says of itself, every command is understood by
//! the program, and the quick ones run. With `--write` quotes and reference are brought up to date.

mod commands;
mod fault;
mod html;
mod links;
mod markdown;
mod places;
mod program;
mod quick;
mod quotes;
mod summary;

use std::env;
use std::path::{Path, PathBuf};

use anyhow::{Result, bail};

use self::fault::Fault;
use self::places::{PAGES, REFERENCE};
use self::program::Program;
use crate::metadata;
use crate::tree::Tree;

/// Options of the command.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Options {
    /// Quotes and reference are written anew.
    write: bool,
    /// Quick commands are parsed like the others, and not run.
    no_run: bool,
    /// Program to ask; without one it is built.
    program: Option<PathBuf>,
}

impl Options {
    /// Reads the words after `book`; none where one of them is not understood.
    pub(crate) fn parse(words: &[&str]) -> Option<Self> {
        let mut options = Self::default();
        let mut words = words.iter();
        while let Some(word) = words.next() {
            match *word {
                "--write" => options.write = true,
                "--no-run" => options.no_run = true,
                "--program" => options.program = Some(PathBuf::from(words.next()?)),
                _ => return None,
            }
        }
        Some(options)
    }
}

/// Checks the book and builds it.
///
/// # Errors
/// When the repository cannot be read, the program cannot be built, or there are faults; these are
/// printed before.
pub(crate) fn run(options: &Options) -> Result<()> {
    let root = PathBuf::from(metadata::workspace_root()?);
    let program = match &options.program {
        Some(path) => Program::at(&env::current_dir()?.join(path)),
        None => Program::build(&root)?,
    };
    if options.write {
        quotes::write(&root, &Tree::read(&root)?)?;
        std::fs::write(root.join(REFERENCE), program.reference()?)?;
    }
    let tree = Tree::read(&root)?;
    let mut faults = links::check(&tree);
    faults.extend(summary::check(&tree));
    faults.extend(quotes::check(&tree));
    faults.extend(check_reference(&tree, &program)?);
    let commands = commands::of(&tree);
    let parsed = commands.iter().filter(|command| !command.is_quick).count();
    faults.extend(commands::check(&commands, &program)?);
    println!("book: {} commands are understood", commands.len());
    if options.no_run {
        println!("book: none was run");
    } else {
        let outcome = quick::run(&root, &tree, &program)?;
        println!(
            "book: {} commands ran, {parsed} were only parsed",
            outcome.count
        );
        faults.extend(outcome.faults);
    }
    match html::build(&root, &tree)? {
        Some(folder) => println!("book: built in {}", folder.display()),
        None => println!("book: mdbook is not installed, so no HTML was built"),
    }
    report(&faults, &root)
}

fn report(faults: &[Fault], root: &Path) -> Result<()> {
    for fault in faults {
        println!("{fault}");
    }
    match faults.len() {
        0 => {
            println!("book: {} is in order", root.join(PAGES).display());
            Ok(())
        }
        count => bail!("the book has {count} faults"),
    }
}

fn check_reference(tree: &Tree, program: &Program) -> Result<Vec<Fault>> {
    let written = tree.text(REFERENCE).map(|page| page.text.as_str());
    if written == Some(program.reference()?.as_str()) {
        return Ok(Vec::new());
    }
    let what = "is not what the program says of itself: cargo xtask book --write";
    Ok(vec![Fault::new(REFERENCE, 0, what)])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options_are_read_and_others_refused() {
        assert_eq!(Options::parse(&[]), Some(Options::default()));
        let all = Options::parse(&["--write", "--no-run", "--program", "x"]);
        assert_eq!(
            all,
            Some(Options {
                write: true,
                no_run: true,
                program: Some(PathBuf::from("x")),
            })
        );
        assert_eq!(Options::parse(&["--wrote"]), None);
        assert_eq!(Options::parse(&["--program"]), None);
    }
}
