//! Every relative link and image of every document leads to a file, and its anchor to a heading.

use std::collections::BTreeMap;

use super::fault::Fault;
use super::markdown;
use crate::tree::{TextFile, Tree};

/// Links that lead nowhere.
pub(super) fn check(tree: &Tree) -> Vec<Fault> {
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
) -> Vec<Fault> {
    let mut found = Vec::new();
    for link in markdown::links(&markdown::page(&file.text)) {
        let path = match link.path {
            "" => Some(file.path.clone()),
            path => resolve(folder_of(&file.path), path),
        };
        let Some(path) = path.filter(|path| tree.contains(path)) else {
            let what = format!("the link to {} leads nowhere", link.path);
            found.push(Fault::new(&file.path, link.line, what));
            continue;
        };
        let (Some(anchor), Some(known)) = (link.anchor, anchors.get(path.as_str())) else {
            continue;
        };
        if !known.iter().any(|heading| heading == anchor) {
            let what = format!("{path} has no heading #{anchor}");
            found.push(Fault::new(&file.path, link.line, what));
        }
    }
    found
}

/// Folder of a path; empty at the root.
pub(super) fn folder_of(path: &str) -> &str {
    path.rsplit_once('/').map_or("", |(folder, _)| folder)
}

/// `target` seen from `folder`, both relative to the root; none when it leads outside.
pub(super) fn resolve(folder: &str, target: &str) -> Option<String> {
    let mut parts: Vec<&str> = folder.split('/').filter(|part| !part.is_empty()).collect();
    for part in target.split('/') {
        match part {
            "" | "." => {}
            ".." => {
                parts.pop()?;
            }
            _ => parts.push(part),
        }
    }
    Some(parts.join("/"))
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
}
