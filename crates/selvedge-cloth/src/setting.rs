//! Settings that cannot be used.

use thiserror::Error;

/// A setting that cannot be used.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{field} must be {expected}, found {found}")]
pub struct SettingError {
    field: String,
    expected: &'static str,
    found: String,
}

/// Checks that a setting holds.
///
/// # Errors
/// Names the field, what it must be and what was `found`.
pub fn require(
    holds: bool,
    field: &str,
    expected: &'static str,
    found: impl std::fmt::Display,
) -> Result<(), SettingError> {
    if holds {
        return Ok(());
    }
    Err(SettingError {
        field: field.to_owned(),
        expected,
        found: found.to_string(),
    })
}

/// Checks that a number is finite and positive.
pub(crate) fn require_positive(field: &str, found: f64) -> Result<(), SettingError> {
    let holds = found.is_finite() && found > 0.0;
    require(holds, field, "finite and positive", found)
}
