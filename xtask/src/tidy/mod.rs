//! `cargo xtask tidy`: what the house has promised in ARCHITECTURE.md and no compiler checks.
//!
//! Each check is a pure function from the files ([`Tree`]) or the package graph ([`Graph`]) to a
//! list of [`Violation`]s, one line each: where, what, and what to do about it. A check never stops
//! at its first violation.

mod cards;
mod dependencies;
mod equations;
mod manifests;
mod map;
mod marks;
mod page;
mod sizes;

use std::fmt;
use std::path::Path;

use anyhow::{Result, bail};

use crate::metadata::{self, Graph};
use crate::tree::Tree;

/// A broken promise.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Violation {
    path: String,
    /// Counted from 1; 0 when the file as a whole is meant.
    line: usize,
    what: String,
    remedy: String,
}

impl Violation {
    fn new(path: &str, line: usize, what: impl Into<String>, remedy: impl Into<String>) -> Self {
        Self {
            path: path.to_owned(),
            line,
            what: what.into(),
            remedy: remedy.into(),
        }
    }
}

impl fmt::Display for Violation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            path,
            line,
            what,
            remedy,
        } = self;
        match line {
            0 => write!(f, "{path}: {what}: {remedy}"),
            _ => write!(f, "{path}:{line}: {what}: {remedy}"),
        }
    }
}

/// Runs every check on the workspace of the current directory.
///
/// # Errors
/// When there is any violation, or the workspace cannot be read.
pub(crate) fn run() -> Result<()> {
    let root = metadata::workspace_root()?;
    let tree = Tree::read(Path::new(&root))?;
    let graph = metadata::graph()?;
    for note in sizes::notes(&tree) {
        println!("note: {note}");
    }
    let violations = violations(&tree, &graph);
    for violation in &violations {
        println!("{violation}");
    }
    if !violations.is_empty() {
        bail!("tidy found {} violations", violations.len());
    }
    println!(
        "tidy: {} files and {} members are in order",
        tree.sizes.len(),
        graph.members.len()
    );
    Ok(())
}

fn violations(tree: &Tree, graph: &Graph) -> Vec<Violation> {
    let mut all = dependencies::check(graph);
    all.extend(sizes::check(tree));
    all.extend(manifests::check(tree));
    all.extend(equations::check(tree));
    all.extend(marks::check(tree));
    all.extend(cards::check(tree));
    all.extend(page::check(tree));
    all.extend(map::check(tree, &graph.members));
    all.sort();
    all
}
