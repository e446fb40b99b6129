//! Bounds of the values of a configuration, and the error that names the one that is beyond.

use selvedge_model::SpecError;
use thiserror::Error;

/// A configuration that cannot be used, a value of one, or a setting that cannot be followed. The
/// message names it, what it must be and what was found.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct ConfigError(pub(crate) String);

impl From<SpecError> for ConfigError {
    fn from(error: SpecError) -> Self {
        Self(error.to_string())
    }
}

pub(crate) fn count(field: &str, found: u64, most: u64) -> Result<(), ConfigError> {
    let expected = format!("between 1 and {most}");
    require((1..=most).contains(&found), field, expected, found)
}

pub(crate) fn positive(field: &str, found: f64) -> Result<(), ConfigError> {
    let holds = found.is_finite() && found > 0.0;
    require(holds, field, "finite and positive", found)
}

pub(crate) fn part(field: &str, found: f64) -> Result<(), ConfigError> {
    let holds = (0.0..=1.0).contains(&found);
    require(holds, field, "between 0 and 1", found)
}

pub(crate) fn below_one(field: &str, found: f64) -> Result<(), ConfigError> {
    let holds = (0.0..1.0).contains(&found);
    require(holds, field, "at least 0 and below 1", found)
}

pub(crate) fn require(
    holds: bool,
    field: &str,
    expected: impl std::fmt::Display,
    found: impl std::fmt::Display,
) -> Result<(), ConfigError> {
    if holds {
        Ok(())
    } else {
        Err(ConfigError(format!(
            "{field} must be {expected}, found {found}"
        )))
    }
}
