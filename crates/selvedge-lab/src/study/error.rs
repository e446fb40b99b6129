//! Errors of studies: each names the entry, the file, and the remedy.

use std::error::Error as StdError;

use thiserror::Error;

/// A study that makes no sense, or cannot go on.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum StudyError {
    /// A mistake in the study, or in what is kept of it, with the remedy.
    #[error("{0}")]
    Problem(String),
    /// An error of a part, with the part's name.
    #[error("{part}: {source}")]
    Part {
        part: String,
        source: Box<dyn StdError + Send + Sync>,
    },
}

impl StudyError {
    /// A mistake with its remedy.
    pub(super) fn new(problem: impl Into<String>) -> Self {
        Self::Problem(problem.into())
    }
}

/// Errors of the laboratory's own operations, which name their parts themselves.
macro_rules! passed_on {
    ($($error:ty),+ $(,)?) => {
        $(impl From<$error> for StudyError {
            fn from(error: $error) -> Self {
                Self::Problem(crate::cause::chain(&error))
            }
        })+
    };
}

passed_on!(
    crate::evaluation::EvaluateError,
    crate::expert::ExpertError,
    crate::folder::FolderError,
    crate::generation::GenerateError,
    crate::generation::OpenDatasetError,
    crate::models::OpenModelError,
    crate::report::WriteReportError,
    selvedge_data::SceneFileError,
    selvedge_data::SceneSpecError,
    selvedge_data::WriteError,
    selvedge_train::ConfigError,
    selvedge_train::ResumeError,
    selvedge_train::RunError,
    selvedge_train::TrainError,
    selvedge_view::plot::PlotError,
    serde_json::Error,
    toml::de::Error,
);

/// Names the part that an error is of.
pub(super) trait OfPart<T> {
    /// Puts `part` in front of the error.
    fn of(self, part: impl FnOnce() -> String) -> Result<T, StudyError>;
}

impl<T, E: StdError + Send + Sync + 'static> OfPart<T> for Result<T, E> {
    fn of(self, part: impl FnOnce() -> String) -> Result<T, StudyError> {
        self.map_err(|source| StudyError::Part {
            part: part(),
            source: Box::new(source),
        })
    }
}
