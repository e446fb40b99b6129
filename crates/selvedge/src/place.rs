//! Where results go: checked before the work begins, so that an hour is not spent on a file that
//! cannot be written.

use std::path::{Path, PathBuf};

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
    if path.is_dir() {
        bail!("{}: this is a folder: name a file in it", path.display());
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

/// A folder for results. What of it was made here goes away again if nothing is put into it.
#[must_use]
pub(crate) struct ClaimedFolder {
    /// The innermost first.
    made: Vec<PathBuf>,
}

impl Drop for ClaimedFolder {
    fn drop(&mut self) {
        // Only empty folders go.
        let _ = self.made.iter().try_for_each(std::fs::remove_dir);
    }
}

/// Makes the folder `path` and those above it, for as long as there is something in it.
///
/// # Errors
/// What is in the way.
pub(crate) fn claim_folder(path: &Path) -> anyhow::Result<ClaimedFolder> {
    let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let made = path.ancestors().take_while(missing).map(Path::to_owned);
    let claimed = ClaimedFolder {
        made: made.collect(),
    };
    make_folder(path)?;
    Ok(claimed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_made_goes_if_it_is_empty_and_what_was_there_stays() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("a/b/c");
        drop(claim_folder(&inner).unwrap());
        assert!(!folder.path().join("a").exists());
        assert!(folder.path().is_dir());
        std::fs::create_dir(folder.path().join("a")).unwrap();
        let claimed = claim_folder(&inner).unwrap();
        std::fs::write(folder.path().join("a/b/file"), "").unwrap();
        drop(claimed);
        assert!(!inner.exists());
        assert!(folder.path().join("a/b/file").is_file());
        drop(claim_folder(&folder.path().join("a")).unwrap());
        assert!(folder.path().join("a").is_dir());
        // A file in the way: what was made before it goes, too.
        assert!(claim_folder(&folder.path().join("a/b/file/c")).is_err());
    }
}
