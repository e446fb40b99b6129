//! The repository's files as the checks see them: the text of every text file and the size of
//! every file, with paths relative to the root and `/` between their parts. Git lists them.

use std::collections::{BTreeMap, BTreeSet};
use std::fs;
use std::path::Path;
use std::process::Command;

use anyhow::{Context, Result, ensure};

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
    /// Reads the files under `root` that git keeps, or would.
    pub(crate) fn read(root: &Path) -> Result<Self> {
        let mut git = Command::new("git");
        git.args([
            "ls-files",
            "-z",
            "--cached",
            "--others",
            "--exclude-standard",
        ]);
        let listed = git.current_dir(root).output().context("cannot start git")?;
        ensure!(
            listed.status.success(),
            "git cannot list the files of {}",
            root.display()
        );
        let mut tree = Self::default();
        let paths: BTreeSet<&str> = str::from_utf8(&listed.stdout)?
            .split_terminator('\0')
            .collect();
        for path in paths {
            tree.read_file(&root.join(path), path.to_owned())?;
        }
        Ok(tree)
    }

    fn read_file(&mut self, file: &Path, path: String) -> Result<()> {
        let Ok(about) = fs::metadata(file) else {
            // Removed, but not from git yet.
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
