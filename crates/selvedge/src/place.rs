//! Where results go: checked before the work begins, so that an hour is not spent on a file that
//! cannot be written.

use std::path::Path;

use anyhow::{Context, bail};

use crate::failure::WrongUsage;

/// Checks that the file `path` can be made: it ends in one of `extensions`, its folder exists, and
/// it is no folder itself.
///
/// # Errors
/// Wrong usage for another extension; otherwise what is in the way.
pub(crate) fn check_file(path: &Path, flag: &str, extensions: &[&str]) -> anyhow::Result<()> {
    let extension = path
        .extension()
        .and_then(|e| e.to_str())
        .unwrap_or_default();
    if !extensions.contains(&extension) {
        let known: Vec<String> = extensions.iter().map(|e| format!(".{e}")).collect();
        let problem = format!(
            "{flag} {}: the name must end in {}",
            path.display(),
            known.join(" or ")
        );
        return Err(WrongUsage::new(problem).into());
    }
    check_new_file(path)
}

/// Checks that the file `path` can be made: its folder exists, and it is no folder itself.
///
/// # Errors
/// What is in the way.
pub(crate) fn check_new_file(path: &Path) -> anyhow::Result<()> {
    check_folder_above(path)?;
    if path.is_dir() {
        bail!("{}: this is a folder: name a file in it", path.display());
    }
    Ok(())
}

/// Checks that the folder `path` can be made with new files in it: the folder above exists, and it
/// does not, or is empty.
///
/// # Errors
/// What is in the way.
pub(crate) fn check_new_folder(path: &Path) -> anyhow::Result<()> {
    check_folder_above(path)?;
    if path.exists() && !path.is_dir() {
        bail!("{}: there is a file of this name", path.display());
    }
    let mut found = std::fs::read_dir(path).into_iter().flatten();
    if found.next().is_some() {
        bail!(
            "{}: there is such a folder already, and it is not empty: choose another name, or remove it",
            path.display()
        );
    }
    Ok(())
}

fn check_folder_above(path: &Path) -> anyhow::Result<()> {
    let folder = match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    if !folder.is_dir() {
        bail!(
            "{}: there is no folder {}: make it first",
            path.display(),
            folder.display()
        );
    }
    Ok(())
}

/// Makes the folder `path` and those above it.
///
/// # Errors
/// What is in the way.
pub(crate) fn make_folder(path: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(path)
        .with_context(|| format!("{}: the folder cannot be made", path.display()))
}
