//! Parts of files and folders: hidden, beside their place, and left behind by a writer that was
//! killed.
//!
//! A writer holds a lock on its part, as far as the system has locks on open files that others may
//! write (Unix). A part of which nobody holds a lock and that nobody has touched for a while is a
//! leftover, and goes when a file or folder of its name is written again.

use std::ffi::OsStr;
use std::fs::{self, File};
use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use tempfile::{Builder, NamedTempFile, TempDir};

const ENDING: &str = ".part";
/// Time in which a writer that has just made its part has locked it.
const GRACE: Duration = Duration::from_secs(5);

/// A folder under way, removed on drop unless it is kept.
pub(super) struct PartFolder {
    pub(super) folder: TempDir,
    /// Holds the lock.
    _open: Option<File>,
}

/// Makes the part of the file `target` in `folder`, locked, and removes those that are left over.
pub(super) fn file_beside(target: &Path, folder: &Path) -> io::Result<NamedTempFile> {
    remove_leftovers(target, folder);
    let prefix = prefix_of(target);
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(ENDING);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        // What an ordinary new file asks for; the umask takes its bits away.
        builder.permissions(fs::Permissions::from_mode(0o666));
    }
    let made = builder.tempfile_in(folder)?;
    lock(made.as_file());
    Ok(made)
}

/// Makes the part of the folder `target` in `folder`, locked, and removes those that are left over.
pub(super) fn folder_beside(target: &Path, folder: &Path) -> io::Result<PartFolder> {
    remove_leftovers(target, folder);
    let prefix = prefix_of(target);
    let mut builder = Builder::new();
    builder.prefix(&prefix).suffix(ENDING);
    #[cfg(unix)]
    {
        use std::os::unix::fs::PermissionsExt;
        builder.permissions(fs::Permissions::from_mode(0o777));
    }
    let made = builder.tempdir_in(folder)?;
    let open = File::open(made.path()).ok().inspect(lock);
    Ok(PartFolder {
        folder: made,
        _open: open,
    })
}

/// Removes what writers that were killed left in `folder`: hidden files and folders that end in
/// `.part`. Nobody may be writing there now. Returns what was removed.
///
/// # Errors
/// A folder that cannot be read, or a leftover that cannot be removed.
pub fn remove_parts(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let parts = parts_in(folder)?;
    parts.iter().try_for_each(|part| remove(part))?;
    Ok(parts)
}

/// Parts of files and folders in `folder`.
fn parts_in(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut parts = Vec::new();
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let name = entry.file_name();
        let name = name.to_string_lossy();
        if name.starts_with('.') && name.ends_with(ENDING) {
            parts.push(entry.path());
        }
    }
    Ok(parts)
}

fn remove(part: &Path) -> io::Result<()> {
    match fs::symlink_metadata(part)?.is_dir() {
        true => fs::remove_dir_all(part),
        false => fs::remove_file(part),
    }
}

/// Beginning of the names of parts of `target`.
fn prefix_of(target: &Path) -> String {
    let name = target.file_name().unwrap_or_default().to_string_lossy();
    format!(".{name}.")
}

/// Locks a part. Where this cannot be done the part is only left alone for less long.
fn lock(part: &File) {
    if cfg!(unix) {
        let _ = part.try_lock();
    }
}

/// Removes what killed writers of `target` left, as far as that can be told and done.
fn remove_leftovers(target: &Path, folder: &Path) {
    if !cfg!(unix) {
        return;
    }
    let prefix = prefix_of(target);
    for part in parts_in(folder).unwrap_or_default() {
        if is_of(&part, &prefix) && is_left_over(&part) {
            // What cannot be removed stays, and does no harm.
            let _ = remove(&part);
        }
    }
}

/// Returns true for `.NAME.` with a word of letters and digits and the ending after it.
fn is_of(part: &Path, prefix: &str) -> bool {
    let name = part.file_name().map(OsStr::to_string_lossy);
    let name = name.unwrap_or_default();
    let word = name
        .strip_prefix(prefix)
        .and_then(|rest| rest.strip_suffix(ENDING));
    word.is_some_and(|word| !word.is_empty() && word.chars().all(char::is_alphanumeric))
}

/// Returns true for a part that nobody has touched for a while and nobody holds.
fn is_left_over(part: &Path) -> bool {
    let age = fs::symlink_metadata(part)
        .and_then(|data| data.modified())
        .map(|time| time.elapsed().unwrap_or_default());
    age.is_ok_and(|age| age > GRACE) && File::open(part).is_ok_and(|open| open.try_lock().is_ok())
}

#[cfg(test)]
mod tests {
    use std::time::SystemTime;

    use super::*;
    use crate::formats::atomic::tests::names_in;

    /// As if a minute had gone by since.
    fn age(path: &Path) {
        let before = SystemTime::now() - Duration::from_secs(60);
        File::open(path).unwrap().set_modified(before).unwrap();
    }

    #[test]
    fn what_a_killed_writer_left_is_removed_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        fs::write(at("a.txt"), "kept").unwrap();
        fs::write(at("b.part"), "kept: not hidden").unwrap();
        fs::write(at(".c"), "kept: no part").unwrap();
        // As a writer leaves it that is killed before it renames.
        let beside = file_beside(&at("a.txt"), folder.path()).unwrap();
        let (_, left) = beside.keep().unwrap();
        fs::create_dir(at(".frames.x.part")).unwrap();
        fs::write(at(".frames.x.part/0001.obj"), "half").unwrap();
        let removed = remove_parts(folder.path()).unwrap();
        assert!(removed.contains(&left) && removed.len() == 2, "{removed:?}");
        assert_eq!(names_in(folder.path()), [".c", "a.txt", "b.part"]);
        assert!(remove_parts(&at("missing")).is_err());
    }

    #[cfg(unix)]
    #[test]
    fn writing_again_removes_parts_of_the_same_name_that_nobody_holds() {
        let folder = tempfile::tempdir().unwrap();
        let at = |name: &str| folder.path().join(name);
        let (left, young, others) = (".a.usda.x.part", ".a.usda.y.part", ".b.usda.x.part");
        for name in [left, young, others, ".a.usda.copy.1.part"] {
            fs::write(at(name), "half").unwrap();
        }
        fs::create_dir(at(".frames.z.part")).unwrap();
        fs::write(at(".frames.z.part/1.obj"), "half").unwrap();
        // Of a writer that is at work, by another open file than that of the search.
        let held = file_beside(&at("c.usda"), &folder.path().join(".")).unwrap();
        let kept = held.path().file_name().unwrap().to_str().unwrap();
        for name in [left, others, ".a.usda.copy.1.part", ".frames.z.part", kept] {
            age(&at(name));
        }
        let made = file_beside(&at("a.usda"), folder.path()).unwrap();
        drop(made);
        let frames = folder_beside(&at("frames"), folder.path()).unwrap();
        drop(frames);
        drop(file_beside(&at("c.usda"), folder.path()).unwrap());
        let mut expected = [young, others, ".a.usda.copy.1.part", kept];
        expected.sort_unstable();
        assert_eq!(names_in(folder.path()), expected);
    }
}
