//! `cargo xtask book`: checks the documents and builds the book under `docs/src` as HTML where
//! `mdbook` is installed.
//!
//! Links and their anchors lead somewhere, every page is in the summary, and quoted examples are
//! their files. Commands are parsed by a test of the program (`documents` in `crates/selvedge`).

mod html;
mod links;
mod markdown;
mod places;
mod quick;
mod quotes;
mod summary;

use std::path::PathBuf;
use std::process::Command;

use anyhow::{Result, bail};

use crate::metadata;
use crate::tree::Tree;

/// Checks the book and builds it.
///
/// # Errors
/// When the repository cannot be read, or there are faults; these are printed before.
pub(crate) fn check() -> Result<()> {
    let root = PathBuf::from(metadata::workspace_root()?);
    let tree = Tree::read(&root)?;
    let mut faults = links::check(&tree);
    faults.extend(summary::check(&tree));
    faults.extend(quotes::check(&tree));
    for fault in &faults {
        println!("{fault}");
    }
    if !faults.is_empty() {
        bail!("the documents have {} faults", faults.len());
    }
    match html::build(&root, &tree)? {
        Some(folder) => println!("book: in order, built in {}", folder.display()),
        None => println!("book: in order; mdbook is not installed, so no HTML was built"),
    }
    Ok(())
}

/// Writes the quotes and the commands reference anew.
///
/// # Errors
/// When a page cannot be read or written, or the program cannot be built.
pub(crate) fn write() -> Result<()> {
    let root = PathBuf::from(metadata::workspace_root()?);
    quotes::write(&root, &Tree::read(&root)?)?;
    let mut test = Command::new(env!("CARGO"));
    test.args([
        "test",
        "--quiet",
        "-p",
        "selvedge",
        "--bin",
        "selvedge",
        "the_book_has",
    ]);
    if !test
        .env("SELVEDGE_WRITE", "1")
        .current_dir(&root)
        .status()?
        .success()
    {
        bail!("the commands reference could not be written");
    }
    Ok(())
}

/// Runs the quick commands of README and book.
///
/// # Errors
/// When the program cannot be built, or a command fails.
pub(crate) fn run() -> Result<()> {
    let root = PathBuf::from(metadata::workspace_root()?);
    quick::run(&root, &Tree::read(&root)?)
}
