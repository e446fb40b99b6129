//! Places of results: checked before the work begins, so that an hour is not spent on a file that
//! cannot be written; and files of bytes.

use std::ffi::OsStr;
use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::{anyhow, bail};
use selvedge_data::{ending_of, folder_of, is_empty_folder, target_of, write_atomically};

use crate::failure::wrong;

/// Checks that the file `path` can be made: it ends in one of `extensions`, its folder exists, and
/// it is no folder itself.
///
/// # Errors
/// Wrong usage for another extension; otherwise what is in the way.
pub(crate) fn check_file(path: &Path, flag: &str, extensions: &[&str]) -> anyhow::Result<()> {
    if !extensions.contains(&ending_of(path).as_str()) {
        let known: Vec<String> = extensions.iter().map(|e| format!(".{e}")).collect();
        let problem = format!(
            "{flag} {}: the name must end in {}",
            path.display(),
            known.join(" or ")
        );
        return Err(wrong(problem));
    }
    check_new_file(path)
}

/// Checks that the file `path` can be made: its folder exists, and it is no folder itself.
pub(crate) fn check_new_file(path: &Path) -> anyhow::Result<()> {
    check_folder_above(path)?;
    if path.is_dir() {
        bail!("{}: this is a folder: name a file in it", path.display());
    }
    Ok(())
}

/// Says, before the work begins, that a file which was not named takes the place of an earlier one.
pub(crate) fn tell_of_former(named: Option<&Path>, path: &Path) {
    if named.is_none() && path.exists() {
        let path = path.display();
        tracing::warn!("{path} is replaced at the end: --output names another file");
    }
}

/// Checks that the folder `path` can be made with new files in it: the folder above exists, and it
/// does not, or is empty.
pub(crate) fn check_new_folder(path: &Path) -> anyhow::Result<()> {
    check_folder_above(path)?;
    let found = is_empty_folder(path);
    found.map_err(|error| anyhow!("{}: {error}", path.display()))?;
    Ok(())
}

fn check_folder_above(path: &Path) -> anyhow::Result<()> {
    let folder = folder_of(path);
    if !folder.is_dir() {
        bail!(
            "{}: there is no folder {}: make it first",
            path.display(),
            folder.display()
        );
    }
    Ok(())
}

/// Checks that no two of `files`, each with its flag, are one and the same, however they are
/// written: what is written last would be all that is left.
///
/// # Errors
/// Wrong usage that names both flags.
pub(crate) fn check_distinct(files: &[(&str, &Path)]) -> anyhow::Result<()> {
    let places: Vec<PathBuf> = files.iter().map(|(_, path)| place_of(path)).collect();
    for (k, (flag, path)) in files.iter().enumerate() {
        if let Some(other) = places[..k].iter().position(|place| *place == places[k]) {
            let problem = format!(
                "{} and {flag} are the same file, {}: give each a name of its own",
                files[other].0,
                path.display()
            );
            return Err(wrong(problem));
        }
    }
    Ok(())
}

/// Checks that none of `outputs`, each with its flag, is another one of them or takes the place of
/// one of `inputs`, which may well be the same file.
///
/// # Errors
/// Wrong usage that names both.
pub(crate) fn check_outputs(
    outputs: &[(&str, impl AsRef<Path>)],
    inputs: &[(&str, impl AsRef<Path>)],
) -> anyhow::Result<()> {
    let outputs = outputs.iter().map(|(flag, to)| (*flag, to.as_ref()));
    let outputs: Vec<_> = outputs.collect();
    check_distinct(&outputs)?;
    for (name, input) in inputs {
        for &output in &outputs {
            check_distinct(&[output, (*name, input.as_ref())])?;
        }
    }
    Ok(())
}

/// Writes a file of these bytes, whole or not at all.
pub(crate) fn write(path: &Path, bytes: &[u8]) -> anyhow::Result<()> {
    Ok(write_atomically(path, |out| out.write_all(bytes))?)
}

/// The place of the bytes of a file at `path`, which may not exist yet, with links followed.
fn place_of(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| {
        let file = target_of(path).map_or_else(|_| path.to_owned(), |(file, _)| file);
        let folder = folder_of(&file);
        let folder = folder.canonicalize().unwrap_or_else(|_| folder.to_owned());
        folder.join(file.file_name().unwrap_or(OsStr::new("..")))
    })
}
