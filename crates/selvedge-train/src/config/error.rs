//! Errors of configurations, and the checks of single values.

use std::path::PathBuf;

use selvedge_model::SpecError;
use thiserror::Error;

/// A configuration that cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ConfigError {
    #[error("cannot read {path}: {source}")]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path}: {source}")]
    Syntax {
        path: PathBuf,
        source: Box<toml::de::Error>,
    },
    #[error("{path}: {source}")]
    Invalid {
        path: PathBuf,
        source: InvalidConfig,
    },
    #[error("{path} with {settings}: {source}")]
    Setting {
        path: PathBuf,
        settings: String,
        source: SettingError,
    },
}

/// A setting that cannot be followed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SettingError {
    #[error(
        "\"{text}\" is no setting: write the dotted path of a key, an equals sign and a value as in TOML, such as model.latent=32"
    )]
    Text { text: String },
    #[error("{path} is no table, so that it has no key {key}")]
    NoTable { path: String, key: String },
    #[error(transparent)]
    Value(Box<toml::de::Error>),
}

/// A value of a configuration that cannot be used.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message is its source's")]
pub enum InvalidConfig {
    #[error(transparent)]
    Model(#[from] SpecError),
    #[error("{field} must be {expected}, found {found}")]
    Value {
        field: String,
        expected: String,
        found: String,
    },
}

pub(crate) fn count(field: &str, found: u64, most: u64) -> Result<(), InvalidConfig> {
    let expected = format!("between 1 and {most}");
    require((1..=most).contains(&found), field, expected, found)
}

pub(crate) fn positive(field: &str, found: f64) -> Result<(), InvalidConfig> {
    let holds = found.is_finite() && found > 0.0;
    require(holds, field, "finite and positive", found)
}

pub(crate) fn part(field: &str, found: f64) -> Result<(), InvalidConfig> {
    let holds = (0.0..=1.0).contains(&found);
    require(holds, field, "between 0 and 1", found)
}

pub(crate) fn require(
    holds: bool,
    field: &str,
    expected: impl Into<String>,
    found: impl ToString,
) -> Result<(), InvalidConfig> {
    if holds {
        return Ok(());
    }
    Err(InvalidConfig::Value {
        field: field.to_owned(),
        expected: expected.into(),
        found: found.to_string(),
    })
}
