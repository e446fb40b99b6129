//! The file of a study: TOML, checked before anything is done.

mod check;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use selvedge_assets::STUDIES;
use selvedge_train::{Setting, TrainConfig};
use serde::{Deserialize, Deserializer, Serialize};

use super::error::{OfPart, StudyError};
use crate::evaluation::Method;
use crate::{assets, span};

/// A study.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// The title of its report.
    pub title: String,
    /// Text under the title.
    #[serde(default)]
    pub(super) text: String,
    /// Data sets by name.
    pub(super) data: BTreeMap<String, DataSource>,
    /// The budget of trainings that name none.
    budget: Option<Budget>,
    /// Values that are changed in every training, before its own.
    #[serde(default)]
    set: Vec<String>,
    /// The measurement of all models.
    pub(super) evaluation: Measured,
    /// Models that are trained, in this order.
    #[serde(default)]
    pub(super) train: Vec<Training>,
    /// Models that are there already.
    #[serde(default)]
    pub(super) model: Vec<Finished>,
    /// The folder of relative paths.
    #[serde(skip)]
    pub(super) folder: PathBuf,
}

/// The source of a data set.
#[derive(Debug, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum DataSource {
    /// It is made, in the study's folder.
    Preset(String),
    Folder(PathBuf),
}

/// The end of a training.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Budget {
    /// After so many optimiser steps of its own.
    Steps(u64),
    /// After so much time of its own, and at the last step of its configuration at the latest.
    #[serde(deserialize_with = "time", serialize_with = "seconds")]
    Time(Duration),
}

/// The measurement of all models.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Measured {
    /// Data sets on whose test splits; all where none is said.
    #[serde(default)]
    pub(super) data: Vec<String>,
    /// Motions; all where none is said.
    #[serde(default)]
    pub(super) motions: Vec<String>,
    /// Frames k from true states after which errors are taken; those of the usual ones that fit
    /// where none is said.
    pub(super) horizons: Option<Vec<usize>>,
    /// True frames per trajectory from which runs start.
    #[serde(default = "usual_starts")]
    pub(super) starts: usize,
    /// Baselines beside the models: `rigid`, `mirror`.
    #[serde(default)]
    pub(super) baselines: Vec<String>,
}

/// A model that is trained.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Training {
    /// Its name in tables, and of its folder.
    pub(super) name: String,
    /// A TOML file, or the name of a shipped configuration.
    pub(super) config: String,
    /// Changed values, as `model.latent=32`.
    #[serde(default)]
    pub(super) set: Vec<String>,
    /// The data set that it learns from; needed where there are several.
    data: Option<String>,
    budget: Option<Budget>,
    /// A training before this one, from whose end it goes on; with another configuration or other
    /// data it begins with the weights and statistics of that.
    pub(super) after: Option<String>,
}

/// A model that is there already.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Finished {
    /// Its name in tables.
    pub(super) name: String,
    pub(super) file: PathBuf,
}

/// Names of the studies that ship.
pub fn shipped() -> impl Iterator<Item = &'static str> {
    STUDIES.iter().map(|study| study.0)
}

/// Opens a study by the path of its file or by the name of a shipped one.
pub fn open(name: &str) -> Result<Study, StudyError> {
    if let Some((_, text)) = STUDIES.iter().find(|study| study.0 == name) {
        return parse(text, Path::new(""), name);
    }
    let path = Path::new(name);
    let known = assets::names(STUDIES);
    let text = selvedge_data::read_text(path)
        .of(|| format!("{name}: could not be read, and is none of the shipped studies {known}"))?;
    parse(&text, path.parent().unwrap_or(Path::new("")), name)
}

fn parse(text: &str, folder: &Path, name: &str) -> Result<Study, StudyError> {
    let read = || -> Result<Study, StudyError> {
        let mut study: Study = toml::from_str(text)?;
        study.folder = folder.to_owned();
        study.check()?;
        Ok(study)
    };
    read().of(|| name.to_owned())
}

impl Measured {
    /// Baselines beside the models, in the order of a table.
    pub(super) fn baselines(&self) -> impl Iterator<Item = Method> {
        self.baselines
            .iter()
            .filter_map(|name| Method::baseline(name))
    }
}

impl Study {
    /// The configuration of `entry`, with its changes.
    pub(super) fn config(&self, entry: &Training) -> Result<TrainConfig, StudyError> {
        let path = self.folder.join(&entry.config);
        let text = match assets::training(&entry.config) {
            Some(text) => text.to_owned(),
            None => selvedge_data::read_text(&path).of(|| {
                format!(
                    "{}: could not be read, and is no shipped configuration",
                    path.display()
                )
            })?,
        };
        let shown = Path::new(&entry.config);
        let set: Result<Vec<Setting>, _> = self.settings(entry).map(|text| text.parse()).collect();
        let set = set.of(|| "set".to_owned())?;
        Ok(TrainConfig::parse_with(&text, shown, &set)?)
    }

    /// Values of its configuration that are changed for `entry`.
    pub(super) fn settings<'a>(&'a self, entry: &'a Training) -> impl Iterator<Item = &'a String> {
        self.set.iter().chain(&entry.set)
    }

    /// The end of `entry`.
    pub(super) fn budget(&self, entry: &Training) -> Result<Budget, StudyError> {
        match entry.budget.or(self.budget) {
            Some(Budget::Steps(0)) => Err(StudyError::new("budget: 0 steps train nothing: give at least 1".to_string())),
            Some(budget) => Ok(budget),
            None => Err(StudyError::new("there is no budget: write budget = { steps = 1000 } or { time = \"10m\" }, here or for the whole study".to_string())),
        }
    }

    /// The name of the data set that `entry` learns from.
    pub(super) fn data_of<'a>(&'a self, entry: &'a Training) -> Result<&'a str, StudyError> {
        match (&entry.data, self.data.keys().next()) {
            (Some(name), _) => Ok(name),
            (None, Some(only)) if self.data.len() == 1 => Ok(only),
            _ => Err(StudyError::new(
                "data: the study has several data sets: say which one it learns from".to_string(),
            )),
        }
    }
}

fn usual_starts() -> usize {
    8
}

fn time<'de, D: Deserializer<'de>>(value: D) -> Result<Duration, D::Error> {
    let text = String::deserialize(value)?;
    span::parse(&text).map_err(serde::de::Error::custom)
}

fn seconds<S: serde::Serializer>(time: &Duration, out: S) -> Result<S::Ok, S::Error> {
    out.serialize_str(&format!("{}s", time.as_secs()))
}

#[cfg(test)]
mod tests;
