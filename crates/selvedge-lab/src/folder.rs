//! Folders for results, made before the work begins.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// A folder that cannot be made.
#[derive(Debug, Error)]
#[error("{}: the folder cannot be made: {source}", path.display())]
pub struct FolderError {
    path: PathBuf,
    source: io::Error,
}

/// Makes the folder `path` and those above it.
///
/// # Errors
/// An obstacle, such as a file of that name.
pub fn make_folder(path: &Path) -> Result<(), FolderError> {
    fs::create_dir_all(path).map_err(|source| FolderError {
        path: path.to_owned(),
        source,
    })
}

/// A folder for results. Folders made for it are removed on drop if they are empty.
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

/// Makes the folder `path` and those above it; see [`ClaimedFolder`] for their removal.
///
/// # Errors
/// As for [`make_folder`].
pub fn claim_folder(path: &Path) -> Result<ClaimedFolder, FolderError> {
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
