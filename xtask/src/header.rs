//! The header of the library for C, made by cbindgen: the file that is kept is what the sources
//! make. cbindgen is a program beside cargo, not a dependency: it would be the heaviest of all.

use std::process::Command;

use anyhow::{Context, Result, bail};

use crate::metadata;

const CRATE: &str = "crates/selvedge-c";
const KEPT: &str = "crates/selvedge-c/include/selvedge.h";
const REMEDY: &str = ".ci/setup installs it";

/// Compares the header that is kept with that of the sources, or writes it.
pub(crate) fn run(write: bool) -> Result<()> {
    let root = metadata::root();
    let folder = root.join(CRATE);
    let output = Command::new("cbindgen")
        .args(["--quiet", "--config"])
        .args([&folder.join("cbindgen.toml"), &folder])
        .output()
        .with_context(|| format!("cannot start cbindgen: {REMEDY}"))?;
    if !output.status.success() {
        bail!("cbindgen: {}", String::from_utf8_lossy(&output.stderr));
    }
    let made = String::from_utf8(output.stdout).context("the header is not UTF-8")?;
    let kept = root.join(KEPT);
    if write {
        return std::fs::write(&kept, made).with_context(|| format!("cannot write {KEPT}"));
    }
    let found = std::fs::read_to_string(&kept).with_context(|| format!("cannot read {KEPT}"))?;
    if found != made {
        bail!("{KEPT} is not what the sources make: cargo xtask header --write");
    }
    Ok(())
}
