//! Folders for results, made before the work begins and locked until it ends, of one kind each.

use std::fmt;
use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use selvedge_data::remove_parts;
use selvedge_train::files;

/// The kind of a folder of results.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FolderKind {
    /// Trajectories to learn from, and their index.
    DataSet,
    /// One training.
    Training,
    /// The report of an evaluation.
    Evaluation,
    /// The run of a model on a scene.
    Rollout,
    /// A fit.
    Fit,
}

/// The folder of an evaluation with its converged runs.
pub const REFERENCES: &str = "references";
/// The table of the report of an evaluation.
pub const ERRORS: &str = "errors.csv";
/// The trajectory of a rollout.
pub const ROLLOUT: &str = "rollout.safetensors";
/// The numbers of a fit.
pub const FITTED: &str = "fit.json";

impl FolderKind {
    const ALL: [Self; 5] = [
        Self::DataSet,
        Self::Training,
        Self::Evaluation,
        Self::Rollout,
        Self::Fit,
    ];

    /// Files and folders that only a folder of this kind has, and of which it has at least one.
    fn marks(self) -> &'static [&'static str] {
        match self {
            Self::DataSet => &["index.json", "index.partial.json"],
            Self::Training => &[files::LOG, files::CHECKPOINT],
            Self::Evaluation => &[ERRORS, REFERENCES],
            Self::Rollout => &[ROLLOUT],
            Self::Fit => &[FITTED],
        }
    }

    /// Folders inside one of this kind that its run writes into and that nothing else claims.
    fn inner(self) -> &'static [&'static str] {
        match self {
            Self::DataSet => &["train", "test"],
            Self::Evaluation => &[REFERENCES],
            Self::Training | Self::Rollout | Self::Fit => &[],
        }
    }

    /// The mark of this kind that `folder` has; none where it is of another kind, or absent.
    fn mark_in(self, folder: &Path) -> Option<&'static str> {
        let marks = self.marks().iter().copied();
        marks.into_iter().find(|name| folder.join(name).exists())
    }

    /// The first kind that `folder` is of.
    pub fn of(folder: &Path) -> Option<Self> {
        let mut all = Self::ALL.into_iter();
        all.find(|kind| kind.mark_in(folder).is_some())
    }
}

impl fmt::Display for FolderKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::DataSet => "a data set",
            Self::Training => "a training",
            Self::Evaluation => "the report of an evaluation",
            Self::Rollout => "a rollout",
            Self::Fit => "a fit",
        })
    }
}

/// Makes the folder `path` and those above it.
pub fn make_folder(path: &Path) -> Result<()> {
    match fs::create_dir_all(path) {
        Ok(()) => Ok(()),
        Err(_) if path.is_file() => bail!(
            "{}: a file is there, where a folder was to be: choose another name",
            path.display()
        ),
        Err(error) => {
            Err(error).with_context(|| format!("{}: the folder cannot be made", path.display()))
        }
    }
}

/// A folder for results, locked against other runs. Folders made for it are removed on drop if
/// they are empty.
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
pub fn check_kind(path: &Path, own: Option<FolderKind>) -> Result<()> {
    let others = FolderKind::ALL.into_iter();
    for kind in others.filter(|kind| Some(*kind) != own) {
        if let Some(mark) = kind.mark_in(path) {
            bail!(
                "{}: the folder holds {kind} ({mark}), which this would mix with other files: choose another folder",
                path.display()
            );
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
pub fn claim_folder(path: &Path, kind: FolderKind) -> Result<ClaimedFolder> {
    check_kind(path, Some(kind))?;
    let missing = |folder: &&Path| !folder.as_os_str().is_empty() && !folder.exists();
    let made = path.ancestors().take_while(missing).map(Path::to_owned);
    let mut claimed = ClaimedFolder {
        lock: None,
        made: made.collect(),
    };
    make_folder(path)?;
    claimed.lock = Some(FolderLock::take(path).with_context(|| path.display().to_string())?);
    for inner in [""].iter().chain(kind.inner()) {
        let folder = path.join(inner);
        if folder.is_dir() {
            let removed = remove_parts(&folder).with_context(|| {
                let path = path.display();
                format!("{path}: what a killed run left there cannot be removed")
            })?;
            if !removed.is_empty() {
                let (count, folder) = (removed.len(), folder.display());
                tracing::info!("{folder}: removed {count} parts of files that a killed run left");
            }
        }
    }
    Ok(claimed)
}

/// Name of the file in a folder that is locked.
const LOCK_FILE: &str = ".selvedge.lock";

/// Attempts, while others take and remove the file.
const ATTEMPTS: usize = 20;

/// A lock on a folder that is written to over time, so that two runs do not mix in it. It is held
/// until it is dropped.
///
/// The lock is the system's, on the file `.selvedge.lock` in the folder, which names its owner. A
/// process that ends lets it go, however it ends: what a killed run left is taken over. Where a
/// file system has no locks, nothing keeps two runs apart.
#[derive(Debug)]
struct FolderLock {
    path: PathBuf,
    _file: File,
}

impl FolderLock {
    /// Locks `folder`, which must exist.
    fn take(folder: &Path) -> Result<Self> {
        const FAILED: &str = "the folder cannot be locked";
        let path = folder.join(LOCK_FILE);
        for _ in 0..ATTEMPTS {
            let mut options = File::options();
            options.read(true).write(true).create(true).truncate(false);
            let mut file = options.open(&path).context(FAILED)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => bail!(
                    "another run writes to this folder ({}): wait until it has ended, or choose another folder",
                    owner(&mut file)
                ),
                // A file system without locks.
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            // Whoever held it may have removed the file meanwhile: then this lock is on nothing.
            if is_same(&file, &path) {
                let signed = sign(&mut file);
                // Dropped where it could not be signed, so that no file is left behind.
                let lock = Self { path, _file: file };
                return signed.map(|()| lock).context(FAILED);
            }
        }
        Err(anyhow!("it was locked and let go by others all the time")).context(FAILED)
    }
}

impl Drop for FolderLock {
    fn drop(&mut self) {
        // While it is still locked, so that nobody is locked on a file that is gone.
        let _ = fs::remove_file(&self.path);
    }
}

/// The owner, as the file names it.
fn owner(file: &mut File) -> String {
    let mut text = String::new();
    let read = file.rewind();
    let read = read.and_then(|()| file.take(200).read_to_string(&mut text));
    match (read, text.trim()) {
        (Ok(_), "") | (Err(_), _) => "a process that has not signed yet".to_owned(),
        (Ok(_), owner) => owner.to_owned(),
    }
}

fn sign(file: &mut File) -> io::Result<()> {
    file.set_len(0)?;
    file.rewind()?;
    writeln!(file, "process {} on {}", std::process::id(), host())
}

/// The name of this machine.
fn host() -> String {
    let kernel = fs::read_to_string("/proc/sys/kernel/hostname").ok();
    let named = kernel.or_else(|| std::env::var("COMPUTERNAME").ok());
    match named.as_deref().map(str::trim) {
        None | Some("") => "this machine".to_owned(),
        Some(name) => name.to_owned(),
    }
}

#[cfg(unix)]
fn is_same(file: &File, path: &Path) -> bool {
    use std::os::unix::fs::MetadataExt;
    match (file.metadata(), fs::metadata(path)) {
        (Ok(ours), Ok(there)) => (ours.dev(), ours.ino()) == (there.dev(), there.ino()),
        _ => false,
    }
}

#[cfg(not(unix))]
fn is_same(_: &File, path: &Path) -> bool {
    path.exists()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_is_claimed_once_at_a_time() {
        let folder = tempfile::tempdir().unwrap();
        let claim = || claim_folder(folder.path(), FolderKind::DataSet);
        let claimed = claim().unwrap();
        let error = format!("{:#}", claim().err().unwrap());
        let owner = format!("process {} on {}", std::process::id(), host());
        for word in ["another run writes", &owner, "choose another folder"] {
            assert!(error.contains(word), "{error}");
        }
        drop(claimed);
        drop(claim().unwrap());
    }

    #[test]
    fn a_folder_of_any_kind_is_freed_of_leftovers() {
        for kind in FolderKind::ALL {
            let folder = tempfile::tempdir().unwrap();
            fs::write(folder.path().join("kept"), "whole").unwrap();
            let parts = [""].iter().chain(kind.inner()).map(|inner| {
                let inner = folder.path().join(inner);
                fs::create_dir_all(&inner).unwrap();
                let part = inner.join(".a.x.part");
                fs::write(&part, "half").unwrap();
                part
            });
            let parts: Vec<PathBuf> = parts.collect();
            drop(claim_folder(folder.path(), kind).unwrap());
            assert!(!parts.iter().any(|part| part.exists()), "{kind}");
            assert!(folder.path().join("kept").exists());
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

    #[test]
    fn what_a_process_that_has_ended_left_is_taken_over() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join(LOCK_FILE);
        // No process has this number on Linux.
        let ended = format!("process 4194999 on {}", host());
        fs::write(&path, &ended).unwrap();
        let lock = FolderLock::take(folder.path()).unwrap();
        let text = fs::read_to_string(&path).unwrap();
        assert!(text.contains(&std::process::id().to_string()), "{text}");
        drop(lock);
    }

    #[test]
    fn of_many_threads_only_one_holds_it_at_a_time() {
        use std::sync::atomic::{AtomicUsize, Ordering};
        let folder = tempfile::tempdir().unwrap();
        let (held, taken) = (AtomicUsize::new(0), AtomicUsize::new(0));
        std::thread::scope(|scope| {
            for _ in 0..4 {
                scope.spawn(|| {
                    for _ in 0..100 {
                        if let Ok(lock) = FolderLock::take(folder.path()) {
                            assert_eq!(held.fetch_add(1, Ordering::SeqCst), 0);
                            taken.fetch_add(1, Ordering::SeqCst);
                            held.fetch_sub(1, Ordering::SeqCst);
                            drop(lock);
                        }
                    }
                });
            }
        });
        assert!(taken.into_inner() > 0);
    }
}
