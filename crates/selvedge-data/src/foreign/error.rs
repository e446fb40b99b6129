//! Errors of foreign data: always with the file.

use std::fmt::Display;
use std::path::Path;

use thiserror::Error;

use crate::formats::file_error::FileError;

/// Foreign data that cannot be imported, with the file or folder.
pub type ForeignError = FileError<ForeignProblem>;

/// A problem of foreign data.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct ForeignProblem(pub(super) String);

/// A problem of the file or folder at `path`.
pub(super) fn at(path: &Path, problem: impl Display) -> ForeignError {
    FileError::at(path)(ForeignProblem(problem.to_string()))
}

/// A file or folder that could not be read.
pub(super) fn unread(path: &Path) -> impl Fn(std::io::Error) -> ForeignError {
    move |error| at(path, format!("could not be read: {error}"))
}
