//! Errors of obstacles in files.

use selvedge_cloth::ObstacleError;

use crate::formats::file_error::Problem;

impl From<ObstacleError> for Problem {
    fn from(error: ObstacleError) -> Self {
        Self(error.to_string())
    }
}

/// A problem of a field of an obstacle that does not know whose it is.
#[derive(Debug)]
pub(super) struct FieldProblem(pub(super) &'static str, pub(super) String);

impl FieldProblem {
    /// The problem as one of the obstacle of this name.
    pub(super) fn of(self, name: &str) -> Problem {
        let Self(field, problem) = self;
        Problem(format!("obstacles[{name:?}].{field}: {problem}"))
    }
}
