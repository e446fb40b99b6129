//! A lock on a folder that is written to over time, so that two runs do not mix in it.
//!
//! The lock is the system's, on the file `.selvedge.lock` in the folder, which names its owner. A
//! process that ends lets it go, however it ends: what a killed run left is taken over. Where a
//! file system has no locks, nothing keeps two runs apart.

use std::fs::{self, File, TryLockError};
use std::io::{self, Read, Seek, Write};
use std::path::{Path, PathBuf};

/// Name of the file in a folder that is locked.
pub const LOCK_FILE: &str = ".selvedge.lock";

/// Attempts, while others take and remove the file.
const ATTEMPTS: usize = 20;

/// A lock that is held until it is dropped.
#[derive(Debug)]
#[must_use]
pub struct FolderLock {
    path: PathBuf,
    _file: File,
}

/// Reason why a folder could not be locked.
#[derive(Debug)]
pub(crate) enum LockFailure {
    /// Another run writes there: its process and machine.
    Held(String),
    Io(io::Error),
}

impl FolderLock {
    /// Locks `folder`, which must exist.
    pub(crate) fn take(folder: &Path) -> Result<Self, LockFailure> {
        let path = folder.join(LOCK_FILE);
        for _ in 0..ATTEMPTS {
            let mut options = File::options();
            options.read(true).write(true).create(true).truncate(false);
            let mut file = options.open(&path).map_err(LockFailure::Io)?;
            match file.try_lock() {
                Err(TryLockError::WouldBlock) => {
                    return Err(LockFailure::Held(owner(&mut file)));
                }
                // A file system without locks.
                Ok(()) | Err(TryLockError::Error(_)) => {}
            }
            // Whoever held it may have removed the file meanwhile: then this lock is on nothing.
            if is_same(&file, &path) {
                let signed = sign(&mut file);
                // Dropped where it could not be signed, so that no file is left behind.
                let lock = Self { path, _file: file };
                return signed.map(|()| lock).map_err(LockFailure::Io);
            }
        }
        let busy = io::Error::other("it was locked and let go by others all the time");
        Err(LockFailure::Io(busy))
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
    let read = file
        .rewind()
        .and_then(|()| file.take(200).read_to_string(&mut text));
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
    fn one_holds_it_and_the_others_are_told_who() {
        let folder = tempfile::tempdir().unwrap();
        let lock = FolderLock::take(folder.path()).unwrap();
        let Err(LockFailure::Held(owner)) = FolderLock::take(folder.path()) else {
            panic!("locked twice");
        };
        let expected = format!("process {} on {}", std::process::id(), host());
        assert_eq!(owner, expected);
        drop(lock);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        drop(FolderLock::take(folder.path()).unwrap());
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
