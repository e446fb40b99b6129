//! Every Rust file is short enough to be read in one go and opens with a paragraph that says what
//! it is.

use super::violation::Violation;
use crate::tree::{TextFile, Tree};

/// No file is longer than this (in lines).
const HARD_LIMIT: usize = 600;

/// The aim of files (in lines). Longer ones are noted.
const AIM: usize = 400;

/// Files that are too long, or that do not open with a `//!` paragraph.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let mut found = Vec::new();
    for file in rust_files(tree) {
        let lines = file.text.lines().count();
        if lines > HARD_LIMIT {
            let what = format!("{lines} lines, more than {HARD_LIMIT}");
            found.push(Violation::new(&file.path, 0, what, "split it by concept"));
        }
        if !opens_with_paragraph(&file.text) {
            found.push(Violation::new(
                &file.path,
                1,
                "no opening paragraph",
                "begin with a `//! ` paragraph: what it is, its equation or paper, its \
                 conventions, what it does not do",
            ));
        }
    }
    found
}

/// Files that are longer than they aim to be but allowed.
pub(crate) fn notes(tree: &Tree) -> Vec<String> {
    rust_files(tree)
        .map(|file| (&file.path, file.text.lines().count()))
        .filter(|(_, lines)| (AIM + 1..=HARD_LIMIT).contains(lines))
        .map(|(path, lines)| format!("{path} has {lines} lines (the aim is {AIM})"))
        .collect()
}

fn rust_files(tree: &Tree) -> impl Iterator<Item = &TextFile> {
    tree.texts.iter().filter(|file| file.path.ends_with(".rs"))
}

fn opens_with_paragraph(text: &str) -> bool {
    let first = text.lines().next().unwrap_or_default();
    let opening = first.strip_prefix("//! ");
    opening.is_some_and(|words| words.split_whitespace().count() >= 2)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    fn file_of(lines: usize) -> String {
        format!("//! A file.\n{}", "\n".repeat(lines - 1))
    }

    #[test]
    fn the_hard_limit_is_inclusive() {
        let at_limit = file_of(HARD_LIMIT);
        assert!(check(&tree_of(&[("a.rs", &at_limit)])).is_empty());
        let above = file_of(HARD_LIMIT + 1);
        let found = check(&tree_of(&[("a.rs", &above), ("a.txt", &above)]));
        assert_eq!(found.len(), 1);
        assert_eq!(found[0].what, "601 lines, more than 600");
    }

    #[test]
    fn a_file_above_the_aim_is_noted_only() {
        let tree = tree_of(&[("a.rs", &file_of(AIM)), ("b.rs", &file_of(AIM + 1))]);
        assert!(check(&tree).is_empty());
        assert_eq!(notes(&tree), ["b.rs has 401 lines (the aim is 400)"]);
    }

    #[test]
    fn a_file_needs_an_opening_paragraph() {
        for bad in [
            "",
            "use a;\n//! Late.",
            "// A comment.",
            "//!\n//! Late.",
            "//! x",
        ] {
            let found = check(&tree_of(&[("a.rs", bad)]));
            assert_eq!(found.len(), 1, "{bad:?}");
            assert_eq!(found[0].what, "no opening paragraph");
        }
    }
}
