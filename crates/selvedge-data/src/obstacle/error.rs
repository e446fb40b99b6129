//! Errors of obstacles in files.

use selvedge_cloth::ObstacleError;
use thiserror::Error;

/// An obstacle of a scene that cannot be made.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct ObstacleSpecError(String);

impl From<ObstacleError> for ObstacleSpecError {
    fn from(error: ObstacleError) -> Self {
        Self(error.to_string())
    }
}

/// A problem of a field of an obstacle that does not know whose it is.
#[derive(Debug)]
pub(super) struct Problem(pub(super) &'static str, pub(super) String);

impl Problem {
    /// The problem as one of the obstacle of this name.
    pub(super) fn of(self, name: &str) -> ObstacleSpecError {
        let Self(field, problem) = self;
        ObstacleSpecError(format!("obstacles[{name:?}].{field}: {problem}"))
    }
}
