//! `cargo xtask book`: checks the documents; with `--build` also all links, by lychee, and the book under
//! `docs/src`, which mdbook makes HTML of.
//!
//! Every page is in the summary, and quoted examples are their files. Commands are parsed by a test
//! of the program (`documents` in `crates/selvedge`).

mod markdown;
mod quick;
mod quotes;
mod summary;

use std::process::Command;

use anyhow::{Context, Result, bail, ensure};

use crate::metadata;
use crate::tree::Tree;

/// Folder of the book's pages.
const PAGES: &str = "docs/src/";

/// Checks what needs no tool.
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
    Ok(())
}

/// Checks all links, and builds the book.
pub(crate) fn build() -> Result<()> {
    let tree = Tree::read(metadata::root())?;
    let mut links = vec!["--offline", "--include-fragments", "--no-progress"];
    let paths = tree.texts.iter().map(|file| file.path.as_str());
    links.extend(paths.filter(|path| path.ends_with(".md")));
    with_tool("lychee", &links)?;
    with_tool("mdbook", &["build", "docs"])
}

fn with_tool(name: &str, arguments: &[&str]) -> Result<()> {
    let mut tool = Command::new(name);
    let status = tool.args(arguments).current_dir(metadata::root()).status();
    let status = status.with_context(|| format!("cannot start {name}: .ci/setup installs it"))?;
    ensure!(status.success(), "{name} failed: {status}");
    Ok(())
}

/// Writes the quotes and the commands reference anew.
pub(crate) fn write() -> Result<()> {
    let root = metadata::root();
    quotes::write(root, &Tree::read(root)?)?;
    let mut test = Command::new(env!("CARGO"));
    test.args("test --locked --quiet -p selvedge --bin selvedge the_book_has".split(' '));
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
