//! Everything that can be wrong with the index of a data set, or with the folder it is made in.

use std::path::PathBuf;

use serde_json::Value;
use thiserror::Error;

use super::sections::SAMPLE_FRAMES;

/// A problem of the index of a data set.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum IndexProblem {
    #[error("is no JSON: {0}")]
    Json(#[source] serde_json::Error),
    #[error("{0}")]
    Contents(#[source] serde_json::Error),
    #[error("{key}: expected {expected}, found {found}")]
    Format {
        key: &'static str,
        expected: String,
        found: Value,
    },
    #[error("motion {motion:?} {problem}")]
    Name {
        motion: String,
        problem: &'static str,
    },
    #[error("file {file:?} is not inside the data set's folder")]
    Outside { file: String },
    #[error("file {file:?} is missing")]
    Missing { file: String },
    #[error("file {file:?} is not that of motion {motion:?}, {expected:?}")]
    OtherMotion {
        file: String,
        motion: String,
        expected: String,
    },
    #[error("files {first:?} and {second:?} are the same trajectory (hash {blake3})")]
    Twice {
        first: String,
        second: String,
        blake3: String,
    },
    #[error(
        "section {section}: frames {start}..{end} of training trajectory {trajectory} do not exist"
    )]
    NoFrames {
        section: usize,
        trajectory: usize,
        start: usize,
        end: usize,
    },
    #[error(
        "section {section}: frames {start}..{end} are fewer than the {SAMPLE_FRAMES} of a sample"
    )]
    TooShort {
        section: usize,
        start: usize,
        end: usize,
    },
    #[error(
        "sections {first} and {second} of training trajectory {trajectory} have samples in common"
    )]
    Shared {
        first: usize,
        second: usize,
        trajectory: usize,
    },
    #[error("statistics.{field} is {said}, but its trajectories and sections have {counted}")]
    Count {
        field: &'static str,
        said: usize,
        counted: u128,
    },
}

/// A problem of the folder in which a data set is to be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum FolderProblem {
    #[error("holds a data set that {difference}: choose another folder")]
    Other { difference: String },
    #[error("holds {found} of this data set, not {asked}: choose another folder")]
    OtherPart { found: String, asked: String },
    #[error("has files in {name}/ but no index: choose an empty folder")]
    NoIndex { name: &'static str },
    #[error("could not be made: {0}")]
    Make(#[source] std::io::Error),
}

/// A problem of parts that are to be one data set.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum PartsProblem {
    #[error("name the folders of the parts")]
    None,
    #[error(
        "{}: is no part of a data set: `selvedge data generate --shard I/N` makes one",
        folder.display()
    )]
    NoPart { folder: PathBuf },
    #[error("{}: is part {part}, and {} is part {other}: take parts of one number", folder.display(), first.display())]
    OtherCount {
        folder: PathBuf,
        part: String,
        first: PathBuf,
        other: String,
    },
    #[error("{}: does not fit {}, since it {difference}", folder.display(), first.display())]
    OtherPlan {
        folder: PathBuf,
        first: PathBuf,
        difference: String,
    },
    #[error("{}: part {part} lacks {} of its trajectories, as {:?}: run again the command that makes it", folder.display(), missing.len(), missing.first().map_or("", String::as_str))]
    Incomplete {
        folder: PathBuf,
        part: String,
        missing: Vec<String>,
    },
    #[error("parts {} are missing: name their folders, too, or make them", missing.join(", "))]
    Missing { missing: Vec<String> },
    #[error("{} and {} are both part {part}", first.display(), second.display())]
    Twice {
        first: PathBuf,
        second: PathBuf,
        part: String,
    },
}
