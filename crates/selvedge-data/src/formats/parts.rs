//! Parts of files and folders under way: hidden, beside their place. A writer that is killed leaves
//! its part behind.

use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use tempfile::{Builder, NamedTempFile, TempDir};

const ENDING: &str = ".part";

/// Makes the part of the file `target` in `folder`.
pub(super) fn file_beside(target: &Path, folder: &Path) -> io::Result<NamedTempFile> {
    // What an ordinary new file asks for; the umask takes its bits away.
    made(target, 0o666, |builder| builder.tempfile_in(folder))
}

/// Makes the part of the folder `target` in `folder`, removed on drop unless it is kept.
pub(super) fn folder_beside(target: &Path, folder: &Path) -> io::Result<TempDir> {
    made(target, 0o777, |builder| builder.tempdir_in(folder))
}

/// Makes a part of `target` with this mode.
fn made<T>(
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::atomic::tests::names_in;

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
}
