//! Single values of a configuration, changed from outside by their dotted path:
//! `model.latent = 32`. A value is TOML; it is put into the table before the table is read, so that
//! keys and types are checked as in a file.

use std::fmt;
use std::str::FromStr;

use serde::Deserialize;
use toml::{Table, Value};

use super::TrainConfig;
use crate::bounds::ConfigError;

/// A change of one value of a configuration.
#[derive(Clone, Debug, PartialEq)]
pub struct Setting {
    path: Vec<String>,
    value: Value,
}

impl FromStr for Setting {
    type Err = ConfigError;

    fn from_str(text: &str) -> Result<Self, ConfigError> {
        let no_setting = || {
            ConfigError(format!(
                "\"{text}\" is no setting: write the dotted path of a key, an equals sign and a value as in TOML, such as model.latent=32"
            ))
        };
        let (path, value) = text.split_once('=').ok_or_else(no_setting)?;
        let path: Vec<String> = path.split('.').map(|key| key.trim().to_owned()).collect();
        if path.iter().any(|key| !is_word(key)) {
            return Err(no_setting());
        }
        let value = value_of(value.trim()).ok_or_else(no_setting)?;
        Ok(Self { path, value })
    }
}

impl fmt::Display for Setting {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} = {}", self.path.join("."), self.value)
    }
}

/// A value as it stands in TOML; a plain word is a text.
fn value_of(text: &str) -> Option<Value> {
    let line: Result<Table, _> = format!("value = {text}").parse();
    match line {
        Ok(mut table) if table.len() == 1 => table.remove("value"),
        Err(_) if is_word(text) => Some(Value::String(text.to_owned())),
        _ => None,
    }
}

fn is_word(text: &str) -> bool {
    let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
    !text.is_empty() && text.chars().all(plain)
}

/// All of them in one line.
pub(super) fn list(settings: &[Setting]) -> String {
    let all: Vec<String> = settings.iter().map(Setting::to_string).collect();
    all.join(", ")
}

/// The configuration of `text`, which is `cfg`, with `settings`.
pub(super) fn changed(
    cfg: TrainConfig,
    text: &str,
    settings: &[Setting],
) -> Result<TrainConfig, ConfigError> {
    if settings.is_empty() {
        return Ok(cfg);
    }
    let wrong = |error: toml::de::Error| ConfigError(error.to_string());
    let mut table: Table = text.parse().map_err(wrong)?;
    for setting in settings {
        put(&mut table, setting)?;
    }
    TrainConfig::deserialize(table).map_err(wrong)
}

/// Tables on the way that are not there yet are made: what reads the whole refuses those that have
/// no place.
fn put(table: &mut Table, setting: &Setting) -> Result<(), ConfigError> {
    let Some((last, way)) = setting.path.split_last() else {
        return Ok(());
    };
    let mut at = table;
    for (number, key) in way.iter().enumerate() {
        let next = at
            .entry(key.clone())
            .or_insert_with(|| Value::Table(Table::new()));
        let Value::Table(next) = next else {
            let (path, key) = (way[..=number].join("."), &setting.path[number + 1]);
            let problem = format!("{path} is no table, so that it has no key {key}");
            return Err(ConfigError(problem));
        };
        at = next;
    }
    at.insert(last.clone(), setting.value.clone());
    Ok(())
}
