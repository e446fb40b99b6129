//! Every page of the book stands in its summary, once.

use crate::PAGES;
use crate::tree::Tree;
use crate::violation::Violation;

/// List of the book's pages, in their order.
const SUMMARY: &str = "docs/src/SUMMARY.md";
/// Remedy.
const LIST: &str = "list it there once";

/// Pages that the summary lacks or has twice.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let Some(summary) = tree.text(SUMMARY) else {
        return vec![Violation::new(SUMMARY, 0, "is missing", "write it")];
    };
    let mut found = Vec::new();
    for file in &tree.texts {
        let page = file.path.strip_prefix(PAGES);
        let Some(page) = page.filter(|page| page.ends_with(".md") && file.path != SUMMARY) else {
            continue;
        };
        let what = match summary.text.matches(&format!("]({page})")).count() {
            1 => continue,
            0 => "is not in the summary",
            _ => "is in the summary twice",
        };
        found.push(Violation::new(&file.path, 0, what, LIST));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_of;

    #[test]
    fn every_page_is_in_the_summary_once() {
        let whats = |summary: &str| -> Vec<String> {
            let files = [
                (SUMMARY, summary),
                ("docs/src/x/a.md", ""),
                ("README.md", ""),
            ];
            let found = check(&tree_of(&files));
            found.into_iter().map(|fault| fault.what).collect()
        };
        assert!(whats("- [A](x/a.md)\n").is_empty());
        assert_eq!(whats("# Summary\n"), ["is not in the summary"]);
        assert_eq!(
            whats("[A](x/a.md)\n- [A](x/a.md)\n"),
            ["is in the summary twice"]
        );
        assert_eq!(check(&tree_of(&[])).len(), 1);
    }
}
