//! Checks of the index of a data set that need no trajectory: names and files, trajectories that are
//! there once, and sections within them.

use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use super::{DatasetIndex, Entry, Split};
use crate::dataset::sections::{SAMPLE_FRAMES, Section};
use crate::formats::file_error::Problem;

/// Checks the index of the data set in `folder`.
pub(super) fn check(folder: &Path, index: &DatasetIndex) -> Result<(), String> {
    for split in Split::BOTH {
        let entries = index.splits.of(split);
        check_names(entries.iter().map(|entry| entry.motion.as_str()))
            .map_err(|(motion, problem)| format!("motion {motion:?} {problem}"))?;
        for entry in entries {
            check_file(folder, split, entry)?;
        }
    }
    check_once(index)?;
    check_sections(index)
}

/// File of the trajectory of a motion, relative to the folder.
pub(crate) fn file_of(split: Split, motion: &str) -> String {
    format!("{}/{motion}.safetensors", split.name())
}

/// The problem of a motion.
pub(crate) fn of_motion(motion: &str, problem: &str) -> Problem {
    Problem(format!("motion {motion:?}: {problem}"))
}

/// Checks that the motions of a split can be names of files and are all different. The error is the
/// motion and the reason.
pub(crate) fn check_names<'a>(
    motions: impl Iterator<Item = &'a str>,
) -> Result<(), (&'a str, &'static str)> {
    let mut seen = BTreeSet::new();
    for motion in motions {
        let is_plain = |c: char| c.is_ascii_alphanumeric() || "-_.@".contains(c);
        if motion.starts_with('.') || !motion.chars().all(is_plain) || motion.is_empty() {
            let problem =
                "is no name: names of motions become file names, of letters, digits, - _ . @";
            return Err((motion, problem));
        }
        if !seen.insert(motion) {
            return Err((motion, "is twice in one split"));
        }
    }
    Ok(())
}

fn check_file(folder: &Path, split: Split, entry: &Entry) -> Result<(), String> {
    let Entry { file, motion, .. } = entry;
    // A name that was checked leads nowhere but into the data set's folder.
    let expected = file_of(split, motion);
    if *file != expected {
        return Err(format!(
            "file {file:?} is not that of motion {motion:?}, {expected:?}"
        ));
    }
    if folder.join(file).is_file() {
        Ok(())
    } else {
        Err(format!("file {file:?} is missing"))
    }
}

/// Checks that no trajectory is there twice, neither in a split nor in both.
fn check_once(index: &DatasetIndex) -> Result<(), String> {
    let mut seen: BTreeMap<&str, &Entry> = BTreeMap::new();
    for entry in index.splits.all() {
        if let Some(other) = seen.insert(&entry.blake3, entry) {
            return Err(format!(
                "files {:?} and {:?} are the same trajectory (hash {})",
                other.file, entry.file, entry.blake3
            ));
        }
    }
    Ok(())
}

fn check_sections(index: &DatasetIndex) -> Result<(), String> {
    for (number, section) in index.sections.iter().enumerate() {
        let &Section {
            trajectory,
            start,
            end,
        } = section;
        let frames = index.splits.train.get(trajectory).map(|entry| entry.frames);
        if start >= end || frames.is_none_or(|frames| end > frames) {
            return Err(format!(
                "section {number}: frames {start}..{end} of training trajectory {trajectory} do not exist"
            ));
        }
        if end - start < SAMPLE_FRAMES {
            return Err(format!(
                "section {number}: frames {start}..{end} are fewer than the {SAMPLE_FRAMES} of a sample"
            ));
        }
    }
    Ok(())
}
