//! Builds the book as HTML with `mdbook`, where that is installed.
//!
//! Pages link to files of the repository that are no part of the book. The copy that is built gets
//! these files beside its pages, as texts, and its links lead there.

use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, Result, bail};

use super::markdown;
use super::places::{PAGES, SUMMARY};
use crate::tree::{TextFile, Tree, folder_of, resolve};

/// Folder of the copy, relative to the root.
const COPY: &str = "target/book/source";
/// Folder of the pages that are built, relative to the root.
const BUILT: &str = "target/book/html";
/// Folder in the copy's pages with the repository's files.
const REPOSITORY: &str = "repository";

/// Builds the book; none where `mdbook` is not installed.
///
/// # Errors
/// When files cannot be written, or `mdbook` fails.
pub(super) fn build(root: &Path, tree: &Tree) -> Result<Option<PathBuf>> {
    if !is_installed()? {
        return Ok(None);
    }
    let copy = root.join(COPY);
    if copy.exists() {
        fs::remove_dir_all(&copy).context("cannot empty the folder of the last copy")?;
    }
    copy_book(root, tree, &copy)?;
    let built = root.join(BUILT);
    let output = Command::new("mdbook")
        .arg("build")
        .arg(&copy)
        .arg("--dest-dir")
        .arg(&built)
        .output()
        .context("cannot start mdbook")?;
    if !output.status.success() {
        bail!("mdbook failed: {}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(Some(built))
}

fn is_installed() -> Result<bool> {
    match Command::new("mdbook").arg("--version").output() {
        Ok(output) => Ok(output.status.success()),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error).context("cannot start mdbook"),
    }
}

fn copy_book(root: &Path, tree: &Tree, copy: &Path) -> Result<()> {
    for path in tree.sizes.keys().filter(|path| path.starts_with("docs/")) {
        let target = copy.join(path.trim_start_matches("docs/"));
        make_folder_of(&target)?;
        let is_page = path.ends_with(".md") && path != SUMMARY;
        let page = tree.text(path).filter(|_| is_page);
        match page {
            Some(page) => fs::write(&target, redirected(page))?,
            None => {
                fs::copy(root.join(path), &target)?;
            }
        }
        for outside in page.map(outside_of).unwrap_or_default() {
            let target = copy.join("src").join(REPOSITORY).join(copy_of(&outside));
            make_folder_of(&target)?;
            fs::write(target, shown(tree, &outside))?;
        }
    }
    Ok(())
}

fn make_folder_of(file: &Path) -> Result<()> {
    let folder = file.parent().context("a file without a folder")?;
    fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))
}

/// Files and folders outside of the book that a page links to.
fn outside_of(page: &TextFile) -> Vec<String> {
    let folder = folder_of(&page.path);
    let found = markdown::links(&markdown::page(&page.text));
    let paths = found.iter().filter(|link| !link.path.is_empty());
    paths
        .filter_map(|link| resolve(folder, link.path))
        .filter(|path| !path.starts_with(PAGES))
        .collect()
}

/// Name of the copy of a file; without `.md`, which mdBook takes for a page.
fn copy_of(path: &str) -> String {
    format!("{}.txt", path.replace(".md", "-md"))
}

/// A page whose links to files outside of the book lead to their copies, and those to a folder's
/// `README.md` to the page that mdBook makes of it.
fn redirected(page: &TextFile) -> String {
    let folder = folder_of(&page.path);
    let up = "../".repeat(folder.matches('/').count().saturating_sub(1));
    let mut text = page.text.clone();
    for link in markdown::links(&markdown::page(&page.text)) {
        let resolved = resolve(folder, link.path);
        let Some(path) = resolved.filter(|_| !link.path.is_empty()) else {
            continue;
        };
        let target = match link.path.strip_suffix("README.md") {
            _ if !path.starts_with(PAGES) => format!("{up}{REPOSITORY}/{}", copy_of(&path)),
            Some(before) => format!("{before}index.md"),
            None => continue,
        };
        for end in [')', '#'] {
            text = text.replace(
                &format!("]({}{end}", link.path),
                &format!("]({target}{end}"),
            );
        }
    }
    text
}

/// The text of a file, or the names of a folder's files.
fn shown(tree: &Tree, path: &str) -> String {
    if let Some(file) = tree.text(path) {
        return file.text.clone();
    }
    let folder = format!("{path}/");
    let names = tree.sizes.keys().filter(|name| name.starts_with(&folder));
    names.map(|name| format!("{name}\n")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tree::tree_of;

    #[test]
    fn links_out_of_the_book_lead_to_copies() {
        let page = TextFile {
            path: "docs/src/a/b.md".to_owned(),
            text: "[x](../../../X.md) [c](../c.md#d) [e](#e)\n".to_owned(),
        };
        assert_eq!(outside_of(&page), ["X.md"]);
        let expected = "[x](../repository/X-md.txt) [c](../c.md#d) [e](#e)\n";
        assert_eq!(redirected(&page), expected);
    }

    #[test]
    fn links_within_the_book_stay() {
        let page = TextFile {
            path: "docs/src/b.md".to_owned(),
            text: "[e](#e) [c](c.md) [r](n/README.md#x)\n".to_owned(),
        };
        let expected = "[e](#e) [c](c.md) [r](n/index.md#x)\n";
        assert_eq!(redirected(&page), expected);
    }

    #[test]
    fn a_folder_is_shown_as_its_files() {
        let tree = tree_of(&[("a/b.toml", "x"), ("a/c.toml", "y"), ("ab", "z")]);
        assert_eq!(shown(&tree, "a"), "a/b.toml\na/c.toml\n");
        assert_eq!(shown(&tree, "a/b.toml"), "x");
    }
}
