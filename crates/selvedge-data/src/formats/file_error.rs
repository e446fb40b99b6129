//! Errors of files: what is wrong, and in which file.

use std::fmt::Display;
use std::path::{Path, PathBuf};

use thiserror::Error;

/// A problem, in words: what was expected and found, and what to do.
#[derive(Clone, Debug, Error, PartialEq, Eq)]
#[error("{0}")]
pub struct Problem(pub(crate) String);

/// A path or a name as errors begin with it: in quotation marks where nothing of it would be seen.
pub fn readable_path(path: &Path) -> String {
    let text = path.display().to_string();
    if text.trim().is_empty() { format!("{text:?}") } else { text }
}

/// A file that could not be read, and why.
#[derive(Debug, Error)]
#[error("{}: {source}", readable_path(path))]
pub struct FileError<E: std::error::Error + 'static> {
    /// The file.
    pub path: PathBuf,
    /// The problem.
    #[source]
    pub source: E,
}

impl<E: std::error::Error> FileError<E> {
    /// `source` in the file at `path`, for `map_err`.
    pub(crate) fn at(path: &Path) -> impl Fn(E) -> Self {
        |source| Self {
            path: path.to_owned(),
            source,
        }
    }
}

impl FileError<Problem> {
    /// This problem of the file or folder at `path`.
    pub(crate) fn new(path: &Path, problem: impl Display) -> Self {
        Self::at(path)(Problem(problem.to_string()))
    }

    /// A file or folder that could not be read, for `map_err`.
    pub(crate) fn unread(path: &Path) -> impl Fn(std::io::Error) -> Self {
        move |error| Self::new(path, format!("could not be read: {error}"))
    }
}
