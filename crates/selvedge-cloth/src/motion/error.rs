//! Errors of motions.

use glam::DVec3;
use thiserror::Error;

/// A motion that cannot drive the handles.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum MotionError {
    #[error("motion: {field} must be {expected}, found {found}")]
    Value {
        field: String,
        expected: &'static str,
        found: String,
    },
    #[error("motion: {what} needs at least {needed} handles, found {found}")]
    TooFewHandles {
        what: &'static str,
        needed: usize,
        found: usize,
    },
    #[error("motion: frame {frame} has positions for {found} handles, the scene has {expected}")]
    HandleCount {
        frame: usize,
        expected: usize,
        found: usize,
    },
    #[error(
        "motion: the position of handle {handle} in frame {frame} must be finite and at most 1e6 m from the origin, found {position}"
    )]
    Position {
        frame: usize,
        handle: usize,
        position: DVec3,
    },
    #[error(
        "motion: the recording starts with handle {handle} at {found}, {millimetres:.3} mm from where it stands in the scene, {expected} (1 mm is allowed): move the mesh or the recording"
    )]
    Start {
        handle: usize,
        expected: DVec3,
        found: DVec3,
        millimetres: f64,
    },
    #[error(
        "motion: groups[{group}] names handle {handle}, but the scene has {handle_count} handles (numbered from 0)"
    )]
    HandleOutOfRange {
        group: usize,
        handle: usize,
        handle_count: usize,
    },
    #[error("motion: handle {handle} is named by groups[{first}] and again by groups[{second}]")]
    HandleRepeated {
        handle: usize,
        first: usize,
        second: usize,
    },
}

pub(super) fn value_error(
    field: impl Into<String>,
    expected: &'static str,
    found: String,
) -> MotionError {
    MotionError::Value {
        field: field.into(),
        expected,
        found,
    }
}
