//! The error of what describes a cloth and its motion.

use std::fmt::Display;

use thiserror::Error;

use crate::{HandleError, MeshError};

/// A part of a scene that cannot be used: what it must be and what was found.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{0}")]
pub struct SceneError(pub(crate) String);

impl SceneError {
    /// The same error of a part of what this names.
    pub(crate) fn of(self, whole: &str) -> Self {
        Self(format!("{whole}: {self}"))
    }
}

impl From<HandleError> for SceneError {
    fn from(error: HandleError) -> Self {
        Self(error.to_string())
    }
}

impl From<MeshError> for SceneError {
    fn from(error: MeshError) -> Self {
        Self(error.to_string())
    }
}

/// Checks that a setting holds.
///
/// # Errors
/// Names the field, what it must be and what was `found`.
pub fn require(
    holds: bool,
    field: impl Display,
    expected: &str,
    found: impl Display,
) -> Result<(), SceneError> {
    if holds { Ok(()) } else { Err(must(field, expected, found)) }
}

/// The error of a field that is not as `expected`.
pub(crate) fn must(field: impl Display, expected: &str, found: impl Display) -> SceneError {
    SceneError(format!("{field} must be {expected}, found {found}"))
}

/// Checks that a number is finite and positive.
pub(crate) fn require_positive(field: impl Display, found: f64) -> Result<(), SceneError> {
    let holds = found.is_finite() && found > 0.0;
    require(holds, field, "finite and positive", found)
}

/// Returns true for a value that a file need not name.
pub(crate) fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

/// The words that an error begins with, and the change that it is about.
#[cfg(test)]
pub(crate) type Change<'a, T> = (&'a str, fn(&mut T));

/// Checks for a test that `check` refuses `good` with each of the changes, by an error that begins
/// with the words beside it.
#[cfg(test)]
#[track_caller]
pub(crate) fn refuses<T: Clone, O: std::fmt::Debug, E: Display>(
    good: &T,
    check: impl Fn(&T) -> Result<O, E>,
    changes: &[Change<'_, T>],
) {
    assert!(check(good).is_ok());
    for (words, change) in changes {
        let mut bad = good.clone();
        change(&mut bad);
        let text = check(&bad).map_err(|error| error.to_string());
        let text = text.expect_err(words);
        assert!(
            text.starts_with(words),
            "{text} does not begin with {words}"
        );
    }
}

/// Checks for a test that each line of `cases`, settings in TOML and words with ` | ` between them,
/// is refused, while it is read or by `check`, by an error with these words.
#[cfg(test)]
#[track_caller]
pub(crate) fn refuses_toml<T: serde::de::DeserializeOwned, E: Display>(
    check: impl Fn(&T) -> Result<(), E>,
    cases: &str,
) {
    for case in cases.trim().lines() {
        let (settings, words) = case.trim().split_once(" | ").expect("two columns");
        let read = toml::from_str::<T>(settings).map_err(|error| error.to_string());
        let checked = read.and_then(|read| check(&read).map_err(|error| error.to_string()));
        let text = checked.expect_err(case);
        assert!(text.contains(words), "{case}: {text}");
    }
}
