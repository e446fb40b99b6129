//! The file of a study: TOML, checked before anything is done.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use anyhow::{Context, Result, anyhow, bail};
use selvedge_assets::STUDIES;
use selvedge_train::{Setting, TrainConfig};
use serde::{Deserialize, Deserializer, Serialize};

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
pub fn open(name: &str) -> Result<Study> {
    if let Some((_, text)) = STUDIES.iter().find(|study| study.0 == name) {
        return parse(text, Path::new(""), name);
    }
    let path = Path::new(name);
    let known = assets::names(STUDIES);
    let text = selvedge_data::read_text(path).with_context(|| {
        format!("{name}: could not be read, and is none of the shipped studies {known}")
    })?;
    parse(&text, path.parent().unwrap_or(Path::new("")), name)
}

fn parse(text: &str, folder: &Path, name: &str) -> Result<Study> {
    let read = || -> Result<Study> {
        let mut study: Study = toml::from_str(text)?;
        study.folder = folder.to_owned();
        study.check()?;
        Ok(study)
    };
    read().with_context(|| name.to_owned())
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
    pub(super) fn config(&self, entry: &Training) -> Result<TrainConfig> {
        let path = self.folder.join(&entry.config);
        let text = match assets::training(&entry.config) {
            Some(text) => text.to_owned(),
            None => selvedge_data::read_text(&path).with_context(|| {
                format!(
                    "{}: could not be read, and is no shipped configuration",
                    path.display()
                )
            })?,
        };
        let shown = Path::new(&entry.config);
        let set: Result<Vec<Setting>, _> = self.settings(entry).map(|text| text.parse()).collect();
        let set = set.context("set")?;
        Ok(TrainConfig::parse_with(&text, shown, &set)?)
    }

    /// Values of its configuration that are changed for `entry`.
    pub(super) fn settings<'a>(&'a self, entry: &'a Training) -> impl Iterator<Item = &'a String> {
        self.set.iter().chain(&entry.set)
    }

    /// The end of `entry`.
    pub(super) fn budget(&self, entry: &Training) -> Result<Budget> {
        match entry.budget.or(self.budget) {
            Some(Budget::Steps(0)) => {
                Err(anyhow!("budget: 0 steps train nothing: give at least 1"))
            }
            Some(budget) => Ok(budget),
            None => Err(anyhow!(
                "there is no budget: write budget = {{ steps = 1000 }} or {{ time = \"10m\" }}, here or for the whole study"
            )),
        }
    }

    /// The name of the data set that `entry` learns from.
    pub(super) fn data_of<'a>(&'a self, entry: &'a Training) -> Result<&'a str> {
        match (&entry.data, self.data.keys().next()) {
            (Some(name), _) => Ok(name),
            (None, Some(only)) if self.data.len() == 1 => Ok(only),
            _ => Err(anyhow!(
                "data: the study has several data sets: say which one it learns from"
            )),
        }
    }

    /// Checks everything that can be known before anything is done.
    fn check(&self) -> Result<()> {
        self.check_names()?;
        if self.data.is_empty() {
            bail!(
                "data: there is no data set: write [data] and a line such as small = {{ preset = \"small\" }}"
            );
        }
        for name in &self.evaluation.data {
            self.check_data(name).context("evaluation.data")?;
        }
        for name in &self.evaluation.baselines {
            if Method::baseline(name).is_none() {
                bail!(
                    "evaluation.baselines: there is no baseline {name:?}: there are {}",
                    Method::BASELINES.join(", ")
                );
            }
        }
        if self.train.is_empty() && self.model.is_empty() {
            bail!("there is nothing to measure: write a [[train]] or a [[model]]");
        }
        for (field, bad) in [
            (
                "horizons",
                self.evaluation.horizons.iter().flatten().any(|&k| k == 0),
            ),
            ("starts", self.evaluation.starts == 0),
        ] {
            if bad {
                bail!("evaluation.{field} must be at least 1, found 0");
            }
        }
        for (number, entry) in self.train.iter().enumerate() {
            self.check_training(entry, &self.train[..number])
                .with_context(|| format!("training {:?}", entry.name))?;
        }
        Ok(())
    }

    fn check_training(&self, entry: &Training, before: &[Training]) -> Result<()> {
        self.check_data(self.data_of(entry)?)?;
        let cfg = self.config(entry)?;
        self.budget(entry)?;
        let Some(after) = &entry.after else {
            return Ok(());
        };
        let Some(before) = before.iter().find(|entry| entry.name == *after) else {
            bail!("after: no training before this one is called {after:?}");
        };
        let mut network = self.config(before)?.model;
        network.encoder = cfg.model.encoder;
        if network != cfg.model {
            bail!("after: {after:?} has another network; only its encoder may be another");
        }
        Ok(())
    }

    /// Whether `entry` is `before` with more steps, which goes on as if that had never ended.
    pub(super) fn continues(&self, entry: &Training, before: &Training) -> Result<bool> {
        // A budget of steps decides when each ends.
        let comparable = |mut cfg: TrainConfig| {
            cfg.steps = 0;
            cfg.log_every = 1;
            cfg.name.clear();
            cfg
        };
        Ok(self.data_of(before)? == self.data_of(entry)?
            && comparable(self.config(before)?) == comparable(self.config(entry)?))
    }

    fn check_names(&self) -> Result<()> {
        let mut seen: Vec<&str> = Vec::new();
        let trained = self.train.iter().map(|entry| &entry.name);
        let models = trained.chain(self.model.iter().map(|entry| &entry.name));
        for name in models {
            let plain = |c: char| c.is_ascii_alphanumeric() || "-_".contains(c);
            if name.is_empty() || !name.chars().all(plain) {
                bail!(
                    "name {name:?}: use letters, digits, - and _, since it is the name of a folder"
                );
            }
            if Method::BASELINES.contains(&name.as_str()) {
                bail!("name {name:?}: a baseline has this name: take another");
            }
            if seen.contains(&name.as_str()) {
                bail!("two entries are called {name:?}: rename one");
            }
            seen.push(name);
        }
        Ok(())
    }

    fn check_data(&self, name: &str) -> Result<()> {
        if self.data.contains_key(name) {
            return Ok(());
        }
        let known: Vec<&str> = self.data.keys().map(String::as_str).collect();
        Err(anyhow!(
            "there is no data set {name:?}: the study has {}",
            known.join(", ")
        ))
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
