//! Folders for results, made before the work begins and locked until it ends.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use selvedge_data::remove_parts;
use thiserror::Error;

use crate::folder_kind::FolderKind;
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
    #[error("a file is there, where a folder was to be: choose another name")]
    File,
    #[error("the folder cannot be locked: {0}")]
    Lock(io::Error),
    #[error(
        "another run writes to this folder ({owner}): wait until it has ended, or choose another folder"
    )]
    Held { owner: String },
    #[error("what a killed run left there cannot be removed: {0}")]
    Leftovers(io::Error),
    #[error(
        "the folder holds {kind} ({mark}), which this would mix with other files: choose another folder"
    )]
    Other {
        kind: FolderKind,
        mark: &'static str,
    },
}

/// Makes the folder `path` and those above it.
pub fn make_folder(path: &Path) -> Result<(), FolderError> {
    let problem = match fs::create_dir_all(path) {
        Ok(()) => return Ok(()),
        Err(_) if path.is_file() => FolderProblem::File,
        Err(source) => FolderProblem::Make(source),
    };
    Err(FolderError {
        path: path.to_owned(),
        problem,
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

/// Checks that `path` holds no results, or only those of kind `own`.
pub fn check_kind(path: &Path, own: Option<FolderKind>) -> Result<(), FolderError> {
    let others = FolderKind::ALL.into_iter();
    for kind in others.filter(|kind| Some(*kind) != own) {
        if let Some(mark) = kind.mark_in(path) {
            return Err(FolderError {
                path: path.to_owned(),
                problem: FolderProblem::Other { kind, mark },
            });
        }
    }
    Ok(())
}

/// Makes the folder `path` for results of this kind and those above it, locks it, and removes what
/// a killed run left in it and in its inner folders; see [`ClaimedFolder`] for their removal.
///
/// # Errors
/// As for [`make_folder`] and [`check_kind`]; also another run that writes there, with its process
/// and machine.
pub fn claim_folder(path: &Path, kind: FolderKind) -> Result<ClaimedFolder, FolderError> {
    check_kind(path, Some(kind))?;
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
    for inner in [""].iter().chain(kind.inner()) {
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
        let claimed = claim_folder(&path, FolderKind::DataSet).unwrap();
        assert!(!path.join(".a.x.part").exists() && !path.join("train/.b.y.part").exists());
        assert!(path.join("kept").exists());
        let error = claim_folder(&path, FolderKind::DataSet)
            .err()
            .unwrap()
            .to_string();
        let owner = format!("process {}", std::process::id());
        for word in ["another run writes", &owner, "choose another folder"] {
            assert!(error.contains(word), "{error}");
        }
        drop(claimed);
        drop(claim_folder(&path, FolderKind::DataSet).unwrap());
    }

    #[test]
    fn every_inner_folder_of_a_kind_is_freed_of_leftovers() {
        for kind in FolderKind::ALL {
            let folder = tempfile::tempdir().unwrap();
            let parts = kind.inner().iter().map(|inner| {
                let inner = folder.path().join(inner);
                fs::create_dir(&inner).unwrap();
                let part = inner.join(".a.x.part");
                fs::write(&part, "half").unwrap();
                part
            });
            let parts: Vec<PathBuf> = parts.collect();
            drop(claim_folder(folder.path(), kind).unwrap());
            assert!(!parts.iter().any(|part| part.exists()), "{kind}");
        }
    }

    #[test]
    fn what_was_made_goes_if_it_is_empty_and_what_was_there_stays() {
        let folder = tempfile::tempdir().unwrap();
        let inner = folder.path().join("a/b/c");
        drop(claim_folder(&inner, FolderKind::DataSet).unwrap());
        assert!(!folder.path().join("a").exists());
        assert!(folder.path().is_dir());
        fs::create_dir(folder.path().join("a")).unwrap();
        let claimed = claim_folder(&inner, FolderKind::DataSet).unwrap();
        fs::write(folder.path().join("a/b/file"), "").unwrap();
        drop(claimed);
        assert!(!inner.exists());
        assert!(folder.path().join("a/b/file").is_file());
        drop(claim_folder(&folder.path().join("a"), FolderKind::DataSet).unwrap());
        assert!(folder.path().join("a").is_dir());
        // A file in the way: what was made before it goes, too.
        assert!(claim_folder(&folder.path().join("a/b/file/c"), FolderKind::DataSet).is_err());
    }

    #[test]
    fn a_folder_that_holds_results_of_another_kind_is_refused_and_stays_as_it_is() {
        let folder = tempfile::tempdir().unwrap();
        for kind in FolderKind::ALL {
            for mark in kind.marks() {
                let path = folder.path().join(format!("{kind} {mark}"));
                fs::create_dir(&path).unwrap();
                fs::write(path.join(mark), "kept").unwrap();
                assert_eq!(FolderKind::of(&path), Some(kind));
                drop(claim_folder(&path, kind).unwrap());
                let others = FolderKind::ALL.into_iter().filter(|other| *other != kind);
                for other in others {
                    let error = claim_folder(&path, other).err().unwrap().to_string();
                    let held = format!("the folder holds {kind} ({mark})");
                    assert!(error.contains(&held), "{error}");
                    assert!(error.contains("choose another folder"), "{error}");
                }
                assert!(check_kind(&path, None).is_err());
                assert_eq!(fs::read_dir(&path).unwrap().count(), 1);
            }
        }
        let empty = folder.path().join("empty");
        check_kind(&empty, None).unwrap();
        assert_eq!(FolderKind::of(&empty), None);
    }
}
