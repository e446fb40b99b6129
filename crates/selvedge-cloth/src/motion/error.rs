//! Errors of motions.

use thiserror::Error;

/// A motion that cannot drive the handles.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("motion: {0}")]
pub struct MotionError(pub(super) String);

pub(super) fn value_error(
    field: impl std::fmt::Display,
    expected: &str,
    found: impl std::fmt::Display,
) -> MotionError {
    MotionError(format!("{field} must be {expected}, found {found}"))
}

/// The error of `what`, which needs two handles at least.
pub(super) fn too_few_handles(what: &str, found: usize) -> MotionError {
    MotionError(format!("{what} needs at least 2 handles, found {found}"))
}
