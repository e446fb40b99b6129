//! The repository's files as the checks see them: the text of every text file and the size of
//! every file, with paths relative to the root and `/` between their parts.
//!
//! What `.gitignore` names is left out. Only its plain patterns are understood (`/name` at the
//! root, `name` anywhere), which is all that this repository uses.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};

/// A file that people read.
#[derive(Clone, Debug)]
pub(crate) struct TextFile {
    /// Relative to the root.
    pub(crate) path: String,
    pub(crate) text: String,
}

/// All files of a repository, in the order of their paths.
#[derive(Clone, Debug, Default)]
pub(crate) struct Tree {
    pub(crate) texts: Vec<TextFile>,
    /// Bytes of every file, the text files too.
    pub(crate) sizes: BTreeMap<String, u64>,
}

/// Files larger than this are data, whatever they contain (in bytes).
const LARGEST_TEXT: u64 = 1 << 20;

impl Tree {
    /// Reads the files under `root`.
    pub(crate) fn read(root: &Path) -> Result<Self> {
        let ignore = fs::read_to_string(root.join(".gitignore")).unwrap_or_default();
        let mut tree = Self::default();
        tree.read_folder(root, "", &ignore)?;
        tree.texts.sort_by(|a, b| a.path.cmp(&b.path));
        Ok(tree)
    }

    fn read_folder(&mut self, folder: &Path, prefix: &str, ignore: &str) -> Result<()> {
        let entries = fs::read_dir(folder)
            .with_context(|| format!("cannot read the folder {}", folder.display()))?;
        for entry in entries {
            let entry = entry?;
            let name = entry.file_name().to_string_lossy().into_owned();
            let path = format!("{prefix}{name}");
            if name == ".git" || is_ignored(&path, ignore) {
                continue;
            }
            if entry.file_type()?.is_dir() {
                self.read_folder(&entry.path(), &format!("{path}/"), ignore)?;
            } else {
                self.read_file(&entry.path(), path)?;
            }
        }
        Ok(())
    }

    fn read_file(&mut self, file: &Path, path: String) -> Result<()> {
        let Ok(about) = fs::metadata(file) else {
            // Written beside and renamed while we looked, by somebody else's tool.
            return Ok(());
        };
        self.sizes.insert(path.clone(), about.len());
        if about.len() <= LARGEST_TEXT {
            let bytes =
                fs::read(file).with_context(|| format!("cannot read {}", file.display()))?;
            if let Ok(text) = String::from_utf8(bytes)
                && !text.contains('\0')
            {
                self.texts.push(TextFile { path, text });
            }
        }
        Ok(())
    }

    /// The text file at `path`.
    pub(crate) fn text(&self, path: &str) -> Option<&TextFile> {
        self.texts.iter().find(|file| file.path == path)
    }
}

/// Builds a tree from (path, text) pairs.
#[cfg(test)]
pub(crate) fn tree_of(files: &[(&str, &str)]) -> Tree {
    Tree {
        texts: files
            .iter()
            .map(|&(path, text)| TextFile {
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

fn is_ignored(path: &str, ignore: &str) -> bool {
    let patterns = ignore.lines().map(str::trim);
    patterns
        .filter(|line| !line.is_empty() && !line.starts_with('#'))
        .map(|line| line.trim_end_matches('/'))
        .any(|pattern| match pattern.strip_prefix('/') {
            Some(rooted) => path == rooted,
            None => path.rsplit('/').next() == Some(pattern),
        })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rooted_pattern_ignores_only_at_the_root() {
        assert!(is_ignored("target", "/target\n"));
        assert!(!is_ignored("crates/target", "/target\n"));
        assert!(is_ignored("web/node_modules", "node_modules/\n"));
        assert!(!is_ignored("target", "# target\n\n"));
    }
}
