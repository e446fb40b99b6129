//! `cargo xtask tidy`: the promises of ARCHITECTURE.md that no compiler checks.
//!
//! Each check is a function from the files ([`Tree`]) or the package graph ([`Graph`]) to a list of
//! [`Violation`]s, one line each: where, what, and the remedy. No check stops at its first
//! violation.

mod cards;
mod dependencies;
mod equations;

use anyhow::{Result, bail};

use crate::metadata::{self, Graph};
use crate::tree::Tree;
use crate::violation::Violation;

/// Runs every check on the workspace of the current directory.
pub(crate) fn run() -> Result<()> {
    let tree = Tree::read(metadata::root())?;
    let graph = metadata::graph()?;
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
    all.extend(equations::check(tree));
    all.extend(cards::check(tree));
    all.sort();
    all
}
