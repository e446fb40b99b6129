//! Writing files so that a reader sees either the old file or the whole new one.
//!
//! The bytes go to a temporary file in the same folder, are flushed and synced, and the file is
//! then renamed. A failure (a full disk, an error of the caller) leaves what was there before and
//! nothing else. New files get the usual permissions of the process (its umask), not those of a
//! private temporary file. A symbolic link is written through; devices and folders are refused.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile};
use thiserror::Error;

/// Why a file could not be written; whatever was at its path is still there.
#[derive(Debug, Error)]
#[error("{}: could not {action}: {source}", path.display())]
pub struct WriteError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// What failed.
    pub action: &'static str,
    /// Why.
    #[source]
    pub source: io::Error,
}

/// Writes `path` with `write`, all or nothing.
///
/// # Errors
/// [`WriteError`] when the folder does not exist, the disk is full, `write` fails, or `path` is
/// something else than a file.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    let fail = |action| {
        move |source| WriteError {
            path: path.to_owned(),
            action,
            source,
        }
    };
    let target = target_of(path).map_err(fail("write there"))?;
    let folder = folder_of(&target);
    let temporary = create_beside(&target, folder).map_err(fail("create a file in its folder"))?;
    write_and_sync(temporary.as_file(), write).map_err(fail("write it"))?;
    temporary
        .persist(&target)
        .map_err(|error| fail("rename the finished file")(error.error))?;
    sync_folder(folder);
    Ok(())
}

/// The file to replace: `path`, or what it links to.
fn target_of(path: &Path) -> io::Result<PathBuf> {
    if path.file_name().is_none() {
        return Err(io::Error::other("the path names no file"));
    }
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(io::Error::other("it is a folder, not a file")),
        Ok(found) if !found.is_file() => Err(io::Error::other("it is not a regular file")),
        Ok(_) => fs::canonicalize(path),
        Err(_) => Ok(path.to_owned()),
    }
}

fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

fn create_beside(target: &Path, folder: &Path) -> io::Result<NamedTempFile> {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let prefix = format!(".{name}.");
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(".part");
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What an ordinary new file asks for; the umask takes its bits away.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    builder.tempfile_in(folder)
}

fn write_and_sync(
    file: &File,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut writer = BufWriter::with_capacity(1 << 18, file);
    write(&mut writer)?;
    writer.flush()?;
    drop(writer);
    file.sync_all()
}

/// Makes the rename itself survive a power cut where folders can be synced. The file is already
/// complete, so that a file system which cannot do this is no failure.
fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names_in(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().to_string_lossy().into_owned())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn replaces_a_file_and_leaves_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        write_atomically(&path, |w| w.write_all(b"new")).unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names_in(folder.path()), ["a.txt"]);
    }

    #[test]
    fn a_failure_keeps_the_old_file_and_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        let error = write_atomically(&path, |w| {
            w.write_all(&[0; 1 << 20])?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        })
        .unwrap_err();
        assert!(error.to_string().contains("a.txt"), "{error}");
        assert_eq!(fs::read(&path).unwrap(), b"old");
        assert_eq!(names_in(folder.path()), ["a.txt"]);
    }

    #[test]
    fn refuses_folders_missing_folders_and_devices() {
        let folder = tempfile::tempdir().unwrap();
        let missing = folder.path().join("no/such/a.txt");
        for path in [folder.path(), &missing, Path::new(".."), Path::new("")] {
            assert!(write_atomically(path, |_| Ok(())).is_err(), "{path:?}");
        }
        #[cfg(unix)]
        assert!(write_atomically(Path::new("/dev/null"), |_| Ok(())).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn has_the_permissions_of_an_ordinary_file_and_writes_through_links() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let [ordinary, ours, link] = ["ordinary", "ours", "link"].map(|n| folder.path().join(n));
        fs::write(&ordinary, "").unwrap();
        write_atomically(&ours, |_| Ok(())).unwrap();
        let mode = |path: &Path| fs::metadata(path).unwrap().permissions().mode();
        assert_eq!(mode(&ours), mode(&ordinary));
        std::os::unix::fs::symlink(&ours, &link).unwrap();
        write_atomically(&link, |w| w.write_all(b"through")).unwrap();
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(fs::read(&ours).unwrap(), b"through");
    }
}
