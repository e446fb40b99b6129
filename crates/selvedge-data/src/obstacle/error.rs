//! Errors of obstacles in files.

use selvedge_cloth::ObstacleError;
use thiserror::Error;

/// An obstacle of a scene that cannot be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ObstacleSpecError {
    #[error("obstacles[{name:?}].{field}: {problem}")]
    Field {
        name: String,
        field: &'static str,
        problem: String,
    },
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
}

/// A problem of a field of an obstacle that does not know whose it is.
#[derive(Debug)]
pub(super) struct Problem(pub(super) &'static str, pub(super) String);

impl Problem {
    /// The problem as one of the obstacle of this name.
    pub(super) fn of(self, name: &str) -> ObstacleSpecError {
        let Self(field, problem) = self;
        ObstacleSpecError::Field {
            name: name.to_owned(),
            field,
            problem,
        }
    }
}
