//! The program `selvedge`, as the checks ask it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use anyhow::{Context, Result, bail};

/// A built program.
#[derive(Clone, Debug)]
pub(super) struct Program {
    path: PathBuf,
}

/// Answer to the question whether words are a command.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) enum Understood {
    /// They are a command.
    Yes,
    /// They begin a command, which lacks something.
    InPart,
    /// They are none; the first line of the program's message.
    No(String),
}

impl Program {
    /// Takes the program at `path`.
    pub(super) fn at(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
        }
    }

    /// Builds the program in the workspace at `root`.
    ///
    /// # Errors
    /// When cargo cannot build it.
    pub(super) fn build(root: &Path) -> Result<Self> {
        let status = Command::new(env!("CARGO"))
            .args(["build", "--quiet", "--package", "selvedge"])
            .current_dir(root)
            .status()
            .context("cannot start cargo build")?;
        if !status.success() {
            bail!("the program could not be built");
        }
        let name = format!("selvedge{}", std::env::consts::EXE_SUFFIX);
        let folder = crate::metadata::target_folder(root)?.join("debug");
        Ok(Self::at(&folder.join(name)))
    }

    /// Runs the program in `folder`.
    ///
    /// # Errors
    /// When it cannot be started.
    pub(super) fn run(&self, folder: &Path, words: &[String]) -> Result<Output> {
        Command::new(&self.path)
            .args(words)
            .current_dir(folder)
            .output()
            .with_context(|| format!("cannot start {}", self.path.display()))
    }

    /// The page that the program writes of its commands.
    ///
    /// # Errors
    /// When it cannot be started or fails.
    pub(super) fn reference(&self) -> Result<String> {
        let output = self.run(Path::new("."), &["reference".to_owned()])?;
        if !output.status.success() {
            bail!("{} reference failed", self.path.display());
        }
        String::from_utf8(output.stdout).context("the commands reference is no text")
    }

    /// Asks whether `words`, without the program's name, are a command.
    ///
    /// # Errors
    /// When the program cannot be started.
    pub(super) fn understands(&self, words: &[String]) -> Result<Understood> {
        let mut asked = vec!["reference".to_owned(), "--".to_owned()];
        asked.extend_from_slice(words);
        let output = self.run(Path::new("."), &asked)?;
        if output.status.success() {
            return Ok(Understood::Yes);
        }
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        Ok(understood(&message))
    }
}

/// Reads the message of a refusal.
fn understood(message: &str) -> Understood {
    let lacking = [
        "required arguments were not provided",
        "subcommand is required",
    ];
    match message.lines().next() {
        Some(line) if lacking.iter().any(|text| line.contains(text)) => Understood::InPart,
        line => Understood::No(line.unwrap_or_default().to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn refusals_are_told_apart() {
        let lacks = "error: the following required arguments were not provided:\n  --out <FILE>";
        assert_eq!(understood(lacks), Understood::InPart);
        let lacks = "error: a subcommand is required";
        assert_eq!(understood(lacks), Understood::InPart);
        let wrong = "error: unexpected argument '--frame' found\n\nUsage";
        let first = "error: unexpected argument '--frame' found".to_owned();
        assert_eq!(understood(wrong), Understood::No(first));
    }
}
