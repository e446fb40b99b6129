//! Every relative link and image of every document leads to a file, and its anchor to a heading;
//! every path in backticks that means a file of this repository is there.

use std::collections::BTreeMap;

use super::markdown;
use crate::tree::{TextFile, Tree, folder_of, resolve};
use crate::violation::Violation;

/// Beginnings of a path in backticks that means a file of this repository.
const PATHS: [&str; 6] = ["crates/", "xtask/", "docs/", "assets/", "web/", ".ci/"];
/// Remedy for all of them.
const MEND: &str = "mend the link";

/// Links and paths that lead nowhere.
pub(super) fn check(tree: &Tree) -> Vec<Violation> {
    let documents = || tree.texts.iter().filter(|file| file.path.ends_with(".md"));
    let anchors: BTreeMap<&str, Vec<String>> = documents()
        .map(|file| {
            let page = markdown::page(&file.text);
            (file.path.as_str(), markdown::anchors(&page))
        })
        .collect();
    documents()
        .flat_map(|file| check_document(file, tree, &anchors))
        .collect()
}

fn check_document(
    file: &TextFile,
    tree: &Tree,
    anchors: &BTreeMap<&str, Vec<String>>,
) -> Vec<Violation> {
    let mut found = Vec::new();
    let page = markdown::page(&file.text);
    for span in markdown::code_spans(&page) {
        let is_path = PATHS.iter().any(|start| span.text.starts_with(start))
            && !span.text.contains(['*', '<', '{', '…', ' ', ':']);
        if is_path && !tree.contains(span.text.trim_end_matches('/')) {
            let what = format!("there is no {}", span.text);
            found.push(Violation::new(&file.path, span.number, what, MEND));
        }
    }
    for link in markdown::links(&page) {
        let path = match link.path {
            "" => Some(file.path.clone()),
            path => resolve(folder_of(&file.path), path),
        };
        let Some(path) = path.filter(|path| tree.contains(path)) else {
            let what = format!("the link to {} leads nowhere", link.path);
            found.push(Violation::new(&file.path, link.line, what, MEND));
            continue;
        };
        let (Some(anchor), Some(known)) = (link.anchor, anchors.get(path.as_str())) else {
            continue;
        };
        if !known.iter().any(|heading| heading == anchor) {
            let what = format!("{path} has no heading #{anchor}");
            found.push(Violation::new(&file.path, link.line, what, MEND));
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    fn whats(page: &str) -> Vec<String> {
        let files = [("docs/src/a.md", page), ("docs/src/b/c.md", "# One two\n")];
        let found = check(&tree_of(&files));
        found.into_iter().map(|fault| fault.what).collect()
    }

    #[test]
    fn links_and_anchors_that_lead_somewhere_pass() {
        let page = "# Top\n[c](b/c.md) [c](b/c.md#one-two) [here](#top) [web](https://x.y/#z)\n";
        assert!(whats(page).is_empty());
    }

    #[test]
    fn links_and_anchors_that_lead_nowhere_fail() {
        assert_eq!(whats("[c](c.md)"), ["the link to c.md leads nowhere"]);
        assert_eq!(whats("![c](../../../x)").len(), 1);
        let found = whats("[c](b/c.md#three)");
        assert_eq!(found, ["docs/src/b/c.md has no heading #three"]);
        assert_eq!(whats("[c](#three)").len(), 1);
    }

    #[test]
    fn paths_in_backticks_exist() {
        assert!(whats("`docs/src/a.md` `docs/` `docs/*.md` `crates/<name>` `other/x`").is_empty());
        assert_eq!(whats("see `crates/x.rs`"), ["there is no crates/x.rs"]);
    }
}
