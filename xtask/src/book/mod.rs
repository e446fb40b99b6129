//! `cargo xtask book`: checks the documents, their links by `lychee` where it is installed, and
//! builds the book under `docs/src` as HTML where `mdbook` is installed.
//!
//! Every page is in the summary, and quoted examples are their files. Commands are parsed by a test
//! of the program (`documents` in `crates/selvedge`).

mod markdown;
mod quick;
mod quotes;
mod summary;

use std::io::ErrorKind;
use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::metadata;
use crate::tree::Tree;

/// Folder of the book's pages.
const PAGES: &str = "docs/src/";

/// Checks the book and builds it.
pub(crate) fn check() -> Result<()> {
    let tree = Tree::read(metadata::root())?;
    let mut faults = summary::check(&tree);
    faults.extend(quotes::check(&tree));
    for fault in &faults {
        println!("{fault}");
    }
    if !faults.is_empty() {
        bail!("the documents have {} faults", faults.len());
    }
    println!("book: summary and quotes are in order");
    let mut links = vec!["--offline", "--include-fragments", "--no-progress"];
    let paths = tree.texts.iter().map(|file| file.path.as_str());
    links.extend(paths.filter(|path| path.ends_with(".md")));
    with_tool("lychee", &links)?;
    with_tool("mdbook", &["build", "docs"])
}

/// Runs a tool where it is installed, and says so where it is not.
fn with_tool(name: &str, arguments: &[&str]) -> Result<()> {
    let mut tool = Command::new(name);
    match tool.args(arguments).current_dir(metadata::root()).status() {
        Ok(status) if status.success() => Ok(()),
        Ok(status) => bail!("{name} failed: {status}"),
        Err(error) if error.kind() == ErrorKind::NotFound => {
            println!("book: {name} is not installed, and was left out");
            Ok(())
        }
        Err(error) => Err(error).with_context(|| format!("cannot start {name}")),
    }
}

/// Writes the quotes and the commands reference anew.
pub(crate) fn write() -> Result<()> {
    let root = metadata::root();
    quotes::write(root, &Tree::read(root)?)?;
    let mut test = Command::new(env!("CARGO"));
    test.args("test --quiet -p selvedge --bin selvedge the_book_has".split(' '));
    let test = test.env("SELVEDGE_WRITE", "1").current_dir(root).status()?;
    ensure!(
        test.success(),
        "the commands reference could not be written"
    );
    Ok(())
}

/// Runs the quick commands of README and book.
pub(crate) fn run() -> Result<()> {
    let root = metadata::root();
    quick::run(root, &Tree::read(root)?)
}
