//! Folders for results, made before the work begins.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;

/// Makes the folder `path` and those above it.
///
/// # Errors
/// What is in the way.
pub fn make_folder(path: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(path)
        .with_context(|| format!("{}: the folder cannot be made", path.display()))
}

/// A folder for results. What of it was made here goes away again if nothing is put into it.
#[must_use]
pub struct ClaimedFolder {
    /// The innermost first.
    made: Vec<PathBuf>,
}

impl Drop for ClaimedFolder {
    fn drop(&mut self) {
        // Only empty folders go.
        let _ = self.made.iter().try_for_each(fs::remove_dir);
    }
}

/// Makes the folder `path` and those above it, for as long as there is something in it.
///
/// # Errors
/// What is in the way.
pub fn claim_folder(path: &Path) -> anyhow::Result<ClaimedFolder> {
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
        fs::create_dir(folder.path().join("a")).unwrap();
        let claimed = claim_folder(&inner).unwrap();
        fs::write(folder.path().join("a/b/file"), "").unwrap();
        drop(claimed);
        assert!(!inner.exists());
        assert!(folder.path().join("a/b/file").is_file());
        drop(claim_folder(&folder.path().join("a")).unwrap());
        assert!(folder.path().join("a").is_dir());
        // A file in the way: what was made before it goes, too.
        assert!(claim_folder(&folder.path().join("a/b/file/c")).is_err());
    }
}
