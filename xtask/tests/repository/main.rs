//! What holds of the repository and no compiler checks: the promises of ARCHITECTURE.md (`cargo
//! xtask tidy`), and that the documents are whole (`cargo xtask book`).
//!
//! Each check is a function from the files ([`Tree`]) or the package graph ([`graph::Graph`]) to a
//! list of [`Violation`]s, one line each: where, what, and the remedy. No check stops at its first
//! violation.
#![allow(
    clippy::unwrap_used,
    reason = "a test that cannot be set up fails there"
)]

mod cards;
mod dependencies;
mod equations;
mod graph;
mod markdown;
mod quick;
mod quotes;
mod summary;
mod tree;
mod violation;

use std::path::Path;

use crate::tree::Tree;
use crate::violation::Violation;

/// Folder of the book's pages.
const PAGES: &str = "docs/src/";

/// Variable that has quotes written anew (`cargo xtask book --write`).
const WRITE: &str = "SELVEDGE_WRITE";

/// Folder of the workspace.
fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR")).parent().unwrap()
}

fn files() -> Tree {
    Tree::read(root()).unwrap()
}

/// Fails where there is a violation, with a line for each.
fn hold(mut violations: Vec<Violation>) {
    violations.sort();
    let lines: Vec<String> = violations.iter().map(Violation::to_string).collect();
    assert!(lines.is_empty(), "\n{}\n", lines.join("\n"));
}

#[test]
fn tidy_dependencies_lead_where_they_may() {
    hold(dependencies::check(&graph::graph().unwrap()));
}

#[test]
fn tidy_equations_have_their_sections() {
    hold(equations::check(&files()));
}

#[test]
fn tidy_models_have_their_cards() {
    hold(cards::check(&files()));
}

#[test]
fn book_has_every_page_in_its_summary() {
    hold(summary::check(&files()));
}

#[test]
fn book_quotes_what_the_files_say() {
    if std::env::var_os(WRITE).is_some() {
        quotes::write(root(), &files()).unwrap();
    }
    hold(quotes::check(&files()));
}

/// A tree of (path, text) pairs.
fn tree_of(files: &[(&str, &str)]) -> Tree {
    Tree {
        texts: files
            .iter()
            .map(|&(path, text)| tree::TextFile {
                path: path.to_owned(),
                text: text.to_owned(),
            })
            .collect(),
        sizes: files
            .iter()
            .map(|&(path, text)| (path.to_owned(), text.len() as u64))
            .collect(),
    }
}
