//! Writing files so that a reader sees either the old file or the whole new one.
//!
//! The bytes go to a temporary file in the same folder, are flushed and synced, and the file is
//! then renamed. A process that is killed leaves its part. A failure (a full disk, an error of the
//! caller) leaves what was there before and nothing else. New files get the usual permissions of the
//! process (its umask), not those of a private temporary file; a file that takes the place of
//! another gets its permissions. A symbolic link is written through, even where its file does not
//! exist yet; devices and folders are refused.

use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};

use tempfile::{Builder, NamedTempFile};
use thiserror::Error;

/// A file that could not be written; whatever was at its path is still there.
#[derive(Debug, Error)]
#[error("{}: could not {action}: {source}", path.display())]
pub struct WriteError {
    /// The file that was to be written.
    pub path: PathBuf,
    /// The action that failed.
    pub action: &'static str,
    /// The cause.
    #[source]
    pub source: io::Error,
}

impl WriteError {
    /// The failure of `action` on the file at `path`, for `map_err`.
    pub(crate) fn when(path: &Path, action: &'static str) -> impl Fn(io::Error) -> Self {
        move |source| Self {
            path: path.to_owned(),
            action,
            source,
        }
    }
}

/// How the names of parts end: hidden files and folders beside their place. A writer that is killed
/// leaves its part behind.
const ENDING: &str = ".part";

/// Files and folders under way.
static UNDER_WAY: AtomicUsize = AtomicUsize::new(0);

/// Returns true while a file or a folder is being written: a process that ends now leaves what was
/// there before, and a `.part` beside it.
pub fn is_writing() -> bool {
    UNDER_WAY.load(Ordering::SeqCst) > 0
}

/// One file or folder under way, until this is dropped.
struct Writing(());

impl Writing {
    fn begin() -> Self {
        UNDER_WAY.fetch_add(1, Ordering::SeqCst);
        Self(())
    }
}

impl Drop for Writing {
    fn drop(&mut self) {
        UNDER_WAY.fetch_sub(1, Ordering::SeqCst);
    }
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
    let fail = WriteError::when(path, "write it");
    replace(path, |part| {
        let mut writer = BufWriter::with_capacity(1 << 18, part.as_file());
        let written = write(&mut writer).and_then(|()| writer.flush());
        written.map_err(fail)
    })
}

/// Makes the folder `path` with all that `fill` puts into the folder that it is given, or nothing:
/// the folder is filled beside its place and renamed. An empty folder may be there already.
///
/// # Errors
/// The error of `fill`, or [`WriteError`] when the folder above does not exist, or something other
/// than an empty folder is there.
pub fn write_folder_atomically<E: From<WriteError>>(
    path: &Path,
    fill: impl FnOnce(&Path) -> Result<(), E>,
) -> Result<(), E> {
    let fail = |action| WriteError::when(path, action);
    let _writing = Writing::begin();
    let is_there = is_empty_folder(path).map_err(fail("make the folder"))?;
    let part = part_of(path, 0o777, |builder| builder.tempdir_in(folder_of(path)));
    let part = part.map_err(fail("make a folder beside it"))?;
    fill(part.path())?;
    if is_there {
        fs::remove_dir(path).map_err(fail("put the folder in its place"))?;
    }
    fs::rename(part.path(), path).map_err(fail("rename the finished folder"))?;
    // Nothing is there any more to be removed.
    let _ = part.keep();
    sync_folder(folder_of(path));
    Ok(())
}

/// Returns true where an empty folder is there, false where nothing is.
///
/// # Errors
/// Anything else there, and what the system says.
pub fn is_empty_folder(path: &Path) -> io::Result<bool> {
    if path.file_name().is_none() {
        return Err(io::Error::other("the path names no folder"));
    }
    match fs::symlink_metadata(path) {
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(false),
        Err(error) => Err(error),
        Ok(found) if !found.is_dir() => Err(io::Error::other("there is a file of this name")),
        Ok(_) if fs::read_dir(path)?.next().is_some() => Err(io::Error::other(
            "there is such a folder already, and it is not empty: choose another name, or remove it",
        )),
        Ok(_) => Ok(true),
    }
}

/// Writes `path` with `write`, which is given a path beside it to write to, all or nothing: for
/// programs that write files themselves.
///
/// # Errors
/// The error of `write`, or [`WriteError`] as [`write_atomically`].
pub fn write_beside<E: From<WriteError>>(
    path: &Path,
    write: impl FnOnce(&Path) -> Result<(), E>,
) -> Result<(), E> {
    replace(path, |part| write(part.path()))
}

/// Replaces the file at `path` by the part beside it that `write` fills.
fn replace<E: From<WriteError>>(
    path: &Path,
    write: impl FnOnce(&NamedTempFile) -> Result<(), E>,
) -> Result<(), E> {
    let fail = |action| WriteError::when(path, action);
    let keep = "keep the permissions of the file that is there";
    let _writing = Writing::begin();
    let (target, permissions) = target_of(path).map_err(fail("write there"))?;
    let folder = folder_of(&target);
    // What an ordinary new file asks for; the umask takes its bits away.
    let part = part_of(&target, 0o666, |builder| builder.tempfile_in(folder));
    let part = part.map_err(fail("create a file in its folder"))?;
    #[cfg(unix)]
    if let Some(permissions) = &permissions {
        use std::os::unix::fs::PermissionsExt;
        // Before the first byte, so that nobody can read what the old file kept private; but
        // whoever writes may have to open it first.
        let open = fs::Permissions::from_mode(permissions.mode() | 0o200);
        part.as_file().set_permissions(open).map_err(fail(keep))?;
    }
    write(&part)?;
    // Opened anew: it may be another file than the one that was made.
    let written = File::options().write(true).open(part.path());
    let written = written.map_err(fail("open the finished file"))?;
    if let Some(permissions) = permissions {
        written.set_permissions(permissions).map_err(fail(keep))?;
    }
    written.sync_all().map_err(fail("write it"))?;
    part.persist(&target)
        .map_err(|error| fail("rename the finished file")(error.error))?;
    sync_folder(folder);
    Ok(())
}

/// The file to replace, `path` or what it links to in the end, which need not exist; and the
/// permissions of what is there now.
///
/// # Errors
/// What is no regular file, links that lead round in a circle, and what else the system says.
pub fn target_of(path: &Path) -> io::Result<(PathBuf, Option<fs::Permissions>)> {
    if path.file_name().is_none() {
        return Err(io::Error::other("the path names no file"));
    }
    match fs::metadata(path) {
        Ok(found) if found.is_dir() => Err(io::Error::other("it is a folder, not a file")),
        Ok(found) if !found.is_file() => Err(io::Error::other("it is not a regular file")),
        Ok(found) => Ok((fs::canonicalize(path)?, Some(found.permissions()))),
        Err(error) if error.kind() != io::ErrorKind::NotFound => Err(error),
        Err(_) => match fs::read_link(path) {
            Ok(link) => target_of(&folder_of(path).join(link)),
            Err(_) => Ok((path.to_owned(), None)),
        },
    }
}

/// The folder that `path` is in.
pub fn folder_of(path: &Path) -> &Path {
    match path.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    }
}

/// Makes the rename itself survive a power cut where folders can be synced. The file is already
/// complete, so that a file system which cannot do this is no failure.
fn sync_folder(folder: &Path) {
    if let Ok(folder) = File::open(folder) {
        let _ = folder.sync_all();
    }
}

/// Makes a part of `target` with this mode.
fn part_of<T>(
    target: &Path,
    mode: u32,
    make: impl FnOnce(&Builder<'_, '_>) -> io::Result<T>,
) -> io::Result<T> {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    let prefix = format!(".{name}.");
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(ENDING);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(mode));
    }
    #[cfg(not(unix))]
    let _ = mode;
    make(&builder)
}

/// Removes what writers that were killed left in `folder`: hidden files and folders that end in
/// `.part`. Nobody may be writing there now. Returns what was removed.
///
/// # Errors
/// A folder that cannot be read, or a leftover that cannot be removed.
pub fn remove_parts(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut removed = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(ENDING) {
            if entry.file_type()?.is_dir() {
                fs::remove_dir_all(entry.path())?
            } else {
                fs::remove_file(entry.path())?
            }
            removed.push(entry.path());
        }
    }
    Ok(removed)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_help::says;

    /// The names of what is in a folder, in order.
    fn names_in(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).unwrap();
        let names = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.collect();
        names.sort();
        names
    }

    /// The permissions of what is at a path.
    #[cfg(unix)]
    fn mode(path: &Path) -> u32 {
        use std::os::unix::fs::PermissionsExt;
        fs::metadata(path).unwrap().permissions().mode() & 0o7777
    }

    #[cfg(unix)]
    fn is_link(path: &Path) -> bool {
        fs::symlink_metadata(path).unwrap().is_symlink()
    }

    #[test]
    fn a_file_is_replaced_and_a_failure_keeps_it_and_names_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        write_atomically(&path, |w| w.write_all(b"new")).unwrap();
        let error = write_atomically(&path, |w| {
            w.write_all(&[0; 1 << 20])?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        says(error.unwrap_err(), &["a.txt"]);
        assert_eq!(fs::read(&path).unwrap(), b"new");
        assert_eq!(names_in(folder.path()), ["a.txt"]);
    }

    #[test]
    fn a_folder_is_whole_or_absent_and_never_takes_the_place_of_another() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("frames");
        let fill = |part: &Path| -> Result<(), WriteError> {
            fs::write(part.join("a"), "a").unwrap();
            write_atomically(&part.join("missing/b"), |_| Ok(()))
        };
        assert!(write_folder_atomically(&path, fill).is_err());
        assert_eq!(names_in(folder.path()), Vec::<String>::new());
        let fill = |part: &Path| -> Result<(), WriteError> {
            write_atomically(&part.join("a"), |w| w.write_all(b"a"))
        };
        fs::create_dir(&path).unwrap();
        write_folder_atomically(&path, fill).unwrap();
        assert_eq!(names_in(folder.path()), ["frames"]);
        assert_eq!(names_in(&path), ["a"]);
        let again = write_folder_atomically(&path, fill);
        says(again.unwrap_err(), &["not empty"]);
        let file = path.join("a");
        assert!(write_folder_atomically(&file, fill).is_err());
        assert_eq!(fs::read(&file).unwrap(), b"a");
        #[cfg(unix)]
        {
            let ordinary = folder.path().join("ordinary");
            fs::create_dir(&ordinary).unwrap();
            assert_eq!(mode(&ordinary), mode(&path));
        }
    }

    #[test]
    fn what_another_program_writes_is_whole_or_absent() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.bin");
        write_beside(&path, |part| -> Result<(), WriteError> {
            fs::write(part, "theirs").unwrap();
            Ok(())
        })
        .unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"theirs");
        let failed = write_beside(&path, |part| {
            fs::write(part, "half").unwrap();
            write_atomically(&folder.path().join("no/such"), |_| Ok(()))
        });
        assert!(failed.is_err());
        assert_eq!(fs::read(&path).unwrap(), b"theirs");
        assert_eq!(names_in(folder.path()), ["a.bin"]);
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
        let folder = tempfile::tempdir().unwrap();
        let [ordinary, ours, link] = ["ordinary", "ours", "link"].map(|n| folder.path().join(n));
        fs::write(&ordinary, "").unwrap();
        write_atomically(&ours, |_| Ok(())).unwrap();
        assert_eq!(mode(&ours), mode(&ordinary));
        std::os::unix::fs::symlink(&ours, &link).unwrap();
        write_atomically(&link, |w| w.write_all(b"through")).unwrap();
        assert!(is_link(&link));
        assert_eq!(fs::read(&ours).unwrap(), b"through");
    }

    #[cfg(unix)]
    #[test]
    fn a_link_to_no_file_yet_makes_the_file_and_stays_a_link() {
        use std::os::unix::fs::symlink;
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::create_dir(at("inner")).unwrap();
        // Relative to the folder of each link, not to where the program runs.
        symlink("inner/second", at("first")).unwrap();
        symlink("../file", at("inner/second")).unwrap();
        write_atomically(&at("first"), |w| w.write_all(b"new")).unwrap();
        assert!(is_link(&at("first")) && is_link(&at("inner/second")));
        assert_eq!(fs::read(at("file")).unwrap(), b"new");
        symlink("round", at("round")).unwrap();
        let error = write_atomically(&at("round"), |_| Ok(()));
        says(error.unwrap_err(), &["symbolic links"]);
        assert!(is_link(&at("round")));
    }

    #[cfg(unix)]
    #[test]
    fn a_replaced_file_keeps_its_permissions() {
        use std::os::unix::fs::PermissionsExt;
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        fs::write(&path, "old").unwrap();
        for kept in [0o600, 0o664, 0o755, 0o440] {
            fs::set_permissions(&path, fs::Permissions::from_mode(kept)).unwrap();
            write_atomically(&path, |w| w.write_all(b"new")).unwrap();
            assert_eq!(mode(&path), kept, "{kept:o}");
            write_beside(&path, |part| -> Result<(), WriteError> {
                assert_eq!(mode(part), kept | 0o200, "{kept:o}");
                fs::write(part, "theirs").unwrap();
                Ok(())
            })
            .unwrap();
            assert_eq!(fs::read(&path).unwrap(), b"theirs");
            assert_eq!(mode(&path), kept, "{kept:o}");
        }
    }

    #[test]
    fn what_a_killed_writer_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.txt"), "kept").unwrap();
        fs::write(at("b.part"), "kept: not hidden").unwrap();
        fs::write(at(".c"), "kept: no part").unwrap();
        // As a writer leaves it that is killed before it renames.
        let beside = part_of(&at("a.txt"), 0o666, |b| b.tempfile_in(folder.path())).unwrap();
        let (_, left) = beside.keep().unwrap();
        fs::create_dir(at(".frames.x.part")).unwrap();
        fs::write(at(".frames.x.part/0001.obj"), "half").unwrap();
        let removed = remove_parts(folder.path()).unwrap();
        assert!(removed.contains(&left) && removed.len() == 2, "{removed:?}");
        assert_eq!(names_in(folder.path()), [".c", "a.txt", "b.part"]);
        assert!(remove_parts(&at("missing")).is_err());
    }
}
