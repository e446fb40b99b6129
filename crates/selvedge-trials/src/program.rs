//! The program under trial: built beside this one, run in a folder, without the user's cache; and
//! copies of the folders that it works on.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, Result, bail};

/// The program `selvedge` that stands beside this one.
#[derive(Clone, Debug)]
pub(crate) struct Program(PathBuf);

impl Program {
    /// The program of the variable `SELVEDGE`, or the one beside this program.
    pub(crate) fn find() -> Result<Self> {
        let path = match std::env::var_os("SELVEDGE") {
            Some(path) => std::path::absolute(path).context("SELVEDGE")?,
            None => {
                let own = std::env::current_exe().context("the path of this program")?;
                own.with_file_name("selvedge")
            }
        };
        if !path.is_file() {
            bail!(
                "{}: there is no such program; build it with cargo build -p selvedge",
                path.display()
            );
        }
        Ok(Self(path))
    }

    /// The program at `path`.
    pub(crate) fn at(path: &Path) -> Self {
        Self(path.to_owned())
    }

    pub(crate) fn path(&self) -> &Path {
        &self.0
    }

    /// The program with `arguments`, split at spaces, in `folder`. It says nothing.
    pub(crate) fn command(&self, folder: &Path, arguments: &str) -> Command {
        let mut command = Command::new(&self.0);
        command
            .args(arguments.split_whitespace())
            .current_dir(folder)
            .env("SELVEDGE_CACHE", "off")
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        command
    }

    /// Runs the program, which must succeed.
    pub(crate) fn run(&self, folder: &Path, arguments: &str) -> Result<()> {
        let output = self
            .command(folder, arguments)
            .stderr(Stdio::piped())
            .output()
            .with_context(|| format!("selvedge {arguments}"))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            bail!("selvedge {arguments}: {}: {said}", output.status);
        }
        Ok(())
    }
}

/// Copies the folder `from` and all in it to `to`, which is made.
pub(crate) fn copy_folder(from: &Path, to: &Path) -> Result<()> {
    fs::create_dir(to).with_context(|| to.display().to_string())?;
    for entry in fs::read_dir(from).with_context(|| from.display().to_string())? {
        let path = entry?.path();
        let place = to.join(path.file_name().unwrap_or_default());
        if path.is_dir() {
            copy_folder(&path, &place)?;
        } else {
            fs::copy(&path, &place)?;
        }
    }
    Ok(())
}
