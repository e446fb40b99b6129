//! Folders for results, made before the work begins and locked until it ends.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use selvedge_data::remove_parts;
use thiserror::Error;

use crate::folder_lock::{FolderLock, LockFailure};

/// A folder that cannot be made or written to.
#[derive(Debug, Error)]
#[error("{}: {problem}", path.display())]
pub struct FolderError {
    path: PathBuf,
    #[source]
    problem: FolderProblem,
}

#[derive(Debug, Error)]
enum FolderProblem {
    #[error("the folder cannot be made: {0}")]
    Make(io::Error),
    #[error("the folder cannot be locked: {0}")]
    Lock(io::Error),
    #[error(
        "another run writes to this folder ({owner}): wait until it has ended, or choose another folder"
    )]
    Held { owner: String },
    #[error("what a killed run left there cannot be removed: {0}")]
    Leftovers(io::Error),
}

/// Makes the folder `path` and those above it.
///
/// # Errors
/// An obstacle, such as a file of that name.
pub fn make_folder(path: &Path) -> Result<(), FolderError> {
    fs::create_dir_all(path).map_err(|source| FolderError {
        path: path.to_owned(),
        problem: FolderProblem::Make(source),
    })
}

/// A folder for results, locked against other runs. Folders made for it are removed on drop if
/// they are empty.
#[must_use]
pub struct ClaimedFolder {
    lock: Option<FolderLock>,
    /// The innermost first.
    made: Vec<PathBuf>,
}

impl Drop for ClaimedFolder {
    fn drop(&mut self) {
        // Its file is in the folder.
        drop(self.lock.take());
        // Only empty folders go.
        let _ = self.made.iter().try_for_each(fs::remove_dir);
    }
}

/// Makes the folder `path` and those above it, locks it, and removes what a killed run left in it
/// and in the folders of its data; see [`ClaimedFolder`] for their removal.
///
/// # Errors
/// As for [`make_folder`]; also another run that writes there, with its process and machine.
pub fn claim_folder(path: &Path) -> Result<ClaimedFolder, FolderError> {
    let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let made = path.ancestors().take_while(missing).map(Path::to_owned);
    let mut claimed = ClaimedFolder {
        lock: None,
        made: made.collect(),
    };
    make_folder(path)?;
    let failed = |problem| FolderError {
        path: path.to_owned(),
        problem,
    };
    claimed.lock = match FolderLock::take(path) {
        Ok(lock) => Some(lock),
        Err(LockFailure::Held(owner)) => return Err(failed(FolderProblem::Held { owner })),
        Err(LockFailure::Io(error)) => return Err(failed(FolderProblem::Lock(error))),
    };
    for inner in ["", "train", "test", "evaluations"] {
        let folder = path.join(inner);
        if folder.is_dir() {
            let removed = remove_parts(&folder);
            let removed = removed.map_err(|error| failed(FolderProblem::Leftovers(error)))?;
            if !removed.is_empty() {
                let (count, folder) = (removed.len(), folder.display());
                tracing::info!("{folder}: removed {count} parts of files that a killed run left");
            }
        }
    }
    Ok(claimed)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_claimed_once_at_a_time_and_freed_of_leftovers() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("run");
        fs::create_dir_all(path.join("train")).unwrap();
        for name in [".a.x.part", "train/.b.y.part", "kept"] {
            fs::write(path.join(name), "half").unwrap();
        }
        let claimed = claim_folder(&path).unwrap();
        assert!(!path.join(".a.x.part").exists() && !path.join("train/.b.y.part").exists());
        assert!(path.join("kept").exists());
        let error = claim_folder(&path).err().unwrap().to_string();
        let owner = format!("process {}", std::process::id());
        for word in ["another run writes", &owner, "choose another folder"] {
            assert!(error.contains(word), "{error}");
        }
        drop(claimed);
        drop(claim_folder(&path).unwrap());
    }

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
