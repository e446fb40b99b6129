//! The version that `selvedge --version` says: that of the package, and the commit it was built
//! from where that is known.

use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs};

fn main() {
    let version = env::var("CARGO_PKG_VERSION").unwrap_or_default();
    let folder = PathBuf::from(env::var("CARGO_MANIFEST_DIR").unwrap_or_default());
    let said = match of_repository(&folder).or_else(|| of_package(&folder)) {
        Some(commit) => format!("{version} ({commit})"),
        None => version,
    };
    println!("cargo::rustc-env=SELVEDGE_VERSION={said}");
    println!("cargo::rerun-if-changed=build.rs");
}

/// The commit of this repository: the first digits, and the date.
fn of_repository(folder: &Path) -> Option<String> {
    // A repository that only contains this one's files says nothing about them.
    let root = folder.join("../..").canonicalize().ok()?;
    let top = PathBuf::from(git(folder, &["rev-parse", "--show-toplevel"])?);
    if top.canonicalize().ok()? != root {
        return None;
    }
    let own = git(folder, &["rev-parse", "--absolute-git-dir"])?;
    // Changes with every commit and every change of branch.
    let log = Path::new(&own).join("logs/HEAD");
    if log.exists() {
        println!("cargo::rerun-if-changed={}", log.display());
    }
    git(
        folder,
        &["log", "-1", "--format=%h, %cs", "--abbrev=9", "HEAD"],
    )
}

fn git(folder: &Path, arguments: &[&str]) -> Option<String> {
    let output = Command::new("git")
        .args(arguments)
        .current_dir(folder)
        .output()
        .ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    let text = text.trim();
    (output.status.success() && !text.is_empty()).then(|| text.to_owned())
}

/// The commit that cargo writes into a package.
fn of_package(folder: &Path) -> Option<String> {
    let text = fs::read_to_string(folder.join(".cargo_vcs_info.json")).ok()?;
    let (_, rest) = text.split_once("\"sha1\"")?;
    let commit = rest.split('"').nth(1)?;
    commit.get(..9).map(str::to_owned)
}
