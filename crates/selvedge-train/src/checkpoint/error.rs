//! Errors of resuming a training.

use std::path::PathBuf;

use safetensors::{Dtype, SafeTensorError};
use thiserror::Error;

use crate::trainer::TrainError;

/// A training that cannot be resumed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ResumeError {
    #[error("cannot read {path}: {source}")]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path} is not a whole safetensors file ({source})")]
    Container {
        path: PathBuf,
        source: SafeTensorError,
    },
    #[error("{path}: metadata \"{key}\" is {found}, expected \"{expected}\"")]
    Metadata {
        path: PathBuf,
        key: &'static str,
        expected: &'static str,
        found: String,
    },
    #[error("{path}: {what}: {problem}")]
    Content {
        path: PathBuf,
        what: String,
        problem: ContentProblem,
    },
    #[error(
        "{path} was made with another {field} ({found}, now {expected}): train into a new folder, or restore it"
    )]
    Configuration {
        path: PathBuf,
        field: String,
        expected: String,
        found: String,
    },
    #[error(
        "{path} was made on other data (data set \"{found}\", now \"{expected}\", or its files or sections have changed): give the same, or train into a new folder"
    )]
    Data {
        path: PathBuf,
        expected: String,
        found: String,
    },
    #[error(transparent)]
    Train(#[from] TrainError),
}

/// A part of a checkpoint that cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ContentProblem {
    #[error("is missing")]
    Missing,
    #[error(transparent)]
    Json(#[from] serde_json::Error),
    #[error(transparent)]
    Tensor(#[from] SafeTensorError),
    #[error("{found} slots, expected {expected}")]
    Slots { found: usize, expected: usize },
    #[error("slot {slot} is in no section of the data set")]
    NoSection { slot: usize },
    #[error("statistics of {found:?} columns, expected {expected:?}")]
    Columns {
        found: (usize, usize),
        expected: (usize, usize),
    },
    #[error("{dtype:?} {shape:?}, expected {expected} × F32")]
    Shape {
        dtype: Dtype,
        shape: Vec<usize>,
        expected: usize,
    },
    #[error("entry {index} is not finite")]
    NonFinite { index: usize },
}
