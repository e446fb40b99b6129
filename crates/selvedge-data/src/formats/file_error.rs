//! An error with the file that it is about.

use std::path::{Path, PathBuf};

use thiserror::Error;

/// A file that could not be read, and why.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
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
