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
    #[error(
        "obstacles[{name:?}].{field}: {path} has changed since the scene was resolved (hash {found}, expected {expected})"
    )]
    Changed {
        name: String,
        field: &'static str,
        path: String,
        expected: String,
        found: String,
    },
    #[error(transparent)]
    Obstacle(#[from] ObstacleError),
}

/// A problem of a part of an obstacle that does not know whose it is.
#[derive(Debug)]
pub(super) enum Problem {
    Field(&'static str, String),
    Changed {
        field: &'static str,
        path: String,
        expected: String,
        found: String,
    },
}

impl Problem {
    /// The problem as one of the obstacle of this name.
    pub(super) fn of(self, name: &str) -> ObstacleSpecError {
        let name = name.to_owned();
        match self {
            Self::Field(field, problem) => ObstacleSpecError::Field {
                name,
                field,
                problem,
            },
            Self::Changed {
                field,
                path,
                expected,
                found,
            } => ObstacleSpecError::Changed {
                name,
                field,
                path,
                expected,
                found,
            },
        }
    }
}
