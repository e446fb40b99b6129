//! Quoted examples are their files: the block after `<!-- quote PATH -->` is the text of the file
//! at PATH, relative to the root.

use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

use crate::PAGES;
use crate::tree::Tree;
use crate::violation::Violation;

const OPENING: &str = "<!-- quote ";
const CLOSING: &str = " -->";

/// Quotes that are not their files.
pub(crate) fn check(tree: &Tree) -> Vec<Violation> {
    let mut found = Vec::new();
    for page in pages(tree) {
        let (text, faults) = quoted(&page.path, &page.text, tree);
        if faults.is_empty() && text != page.text {
            let what = "a quote is not its file";
            found.push(Violation::new(
                &page.path,
                0,
                what,
                "cargo xtask book --write",
            ));
        }
        found.extend(faults);
    }
    found
}

/// Writes the pages anew whose quotes are not their files.
pub(crate) fn write(root: &Path, tree: &Tree) -> Result<()> {
    for page in pages(tree) {
        let (text, _) = quoted(&page.path, &page.text, tree);
        if text != page.text {
            let path = root.join(&page.path);
            fs::write(&path, text).with_context(|| format!("cannot write {}", path.display()))?;
        }
    }
    Ok(())
}

fn pages(tree: &Tree) -> impl Iterator<Item = &crate::tree::TextFile> {
    let pages = tree.texts.iter();
    pages.filter(|file| file.path.starts_with(PAGES) && file.path.ends_with(".md"))
}

/// A page's text with every quote taken from its file, and the quotes whose file is missing.
fn quoted(path: &str, text: &str, tree: &Tree) -> (String, Vec<Violation>) {
    let mut out = String::new();
    let mut faults = Vec::new();
    let mut lines = text.lines().enumerate().peekable();
    while let Some((index, line)) = lines.next() {
        out.push_str(line);
        out.push('\n');
        let Some(name) = quote_of(line) else {
            continue;
        };
        let Some(file) = tree.text(name) else {
            let what = format!("there is no {name}");
            faults.push(Violation::new(path, index + 1, what, "mend the quote"));
            continue;
        };
        while lines.next_if(|(_, line)| line.is_empty()).is_some() {}
        if lines.next_if(|(_, line)| line.starts_with("```")).is_some() {
            while lines.next_if(|(_, line)| *line != "```").is_some() {}
            lines.next();
        }
        let language = match name.rsplit_once('.') {
            Some((_, "rs")) => "rust",
            Some((_, ending)) => ending,
            None => "",
        };
        out.push_str(&format!("\n```{language}\n{}\n```\n", file.text.trim_end()));
    }
    (out, faults)
}

fn quote_of(line: &str) -> Option<&str> {
    line.strip_prefix(OPENING)?.strip_suffix(CLOSING)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree_of;

    fn whats(page: &str) -> Vec<String> {
        let files = [("docs/src/a.md", page), ("x/y.rs", "fn main() {}\n")];
        let found = check(&tree_of(&files));
        found.into_iter().map(|fault| fault.what).collect()
    }

    const GOOD: &str = "# A\n\n<!-- quote x/y.rs -->\n\n```rust\nfn main() {}\n```\n\nend\n";

    #[test]
    fn a_quote_that_is_its_file_passes() {
        assert!(whats(GOOD).is_empty());
        assert!(whats("# no quotes\n\n```rust\nlet x;\n```\n").is_empty());
    }

    #[test]
    fn a_quote_that_differs_fails_and_is_mended() {
        let bad = GOOD.replace("main", "other");
        assert_eq!(whats(&bad).len(), 1);
        let tree = tree_of(&[("docs/src/a.md", &bad), ("x/y.rs", "fn main() {}\n")]);
        assert_eq!(quoted("docs/src/a.md", &bad, &tree).0, GOOD);
        let bare = "# A\n\n<!-- quote x/y.rs -->\n\nend\n";
        assert_eq!(
            quoted("docs/src/a.md", bare, &tree).0,
            GOOD.replace("\n\nend", "\nend")
        );
    }

    #[test]
    fn a_quote_of_a_missing_file_fails() {
        assert_eq!(whats("<!-- quote z.rs -->\n"), ["there is no z.rs"]);
    }
}
