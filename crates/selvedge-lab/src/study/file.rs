//! The file of a study: TOML, checked before anything is done.

mod check;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Duration;

use selvedge_assets::STUDIES;
use selvedge_train::{Setting, TrainConfig};
use serde::{Deserialize, Deserializer, Serialize};

use super::error::{OfPart, StudyError};
use crate::evaluation::{Contestant, Who};
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
    /// Schedules of a configuration are scaled from its own steps to its budget.
    #[serde(default)]
    pub(super) scale_schedules: bool,
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
    /// Questions, a section of the report each.
    pub(super) question: Vec<Question>,
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
    /// It is there.
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
    /// k, for errors over k steps from the truth; those of the usual ones that fit where none is
    /// said.
    pub(super) steps: Option<Vec<usize>>,
    /// True frames per trajectory from which these start.
    #[serde(default = "usual_starts")]
    pub(super) starts: usize,
    /// Rivals beside the models.
    #[serde(default)]
    rivals: Vec<Rival>,
}

/// A rival beside the models.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
enum Rival {
    /// The rest pose moved rigidly with the handles.
    Rigid,
    /// The physics from the other branch of the buckling.
    Mirror,
    /// The recorded trajectory itself, without any error.
    Truth,
}

/// A model that is trained.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Training {
    /// Its name in questions, and of its folder.
    pub(super) name: String,
    /// The label beside its numbers; by default the name.
    pub(super) label: Option<String>,
    /// A TOML file, or the name of a shipped configuration.
    pub(super) config: String,
    /// Changed values, as `model.latent=32`.
    #[serde(default)]
    pub(super) set: Vec<String>,
    /// The data set that it learns from; needed where there are several.
    data: Option<String>,
    budget: Option<Budget>,
    /// A training before this one, from whose end it goes on.
    pub(super) after: Option<String>,
}

/// A model that is there already.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Finished {
    /// Its name in questions.
    pub(super) name: String,
    /// The label beside its numbers; by default the name.
    pub(super) label: Option<String>,
    /// Its file.
    pub(super) file: PathBuf,
}

/// A question.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Question {
    /// The heading.
    pub(super) title: String,
    /// Text under the heading.
    #[serde(default)]
    pub(super) text: String,
    /// Names of the models to compare.
    #[serde(default)]
    pub(super) models: Vec<String>,
    /// Instead of `models`: in groups with headings.
    #[serde(default)]
    pub(super) groups: Vec<Grouped>,
    /// Tables and plots, in this order.
    pub(super) show: Vec<Show>,
}

/// Models that belong together.
#[derive(Clone, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Grouped {
    /// The heading of the group.
    pub(super) heading: String,
    /// Their names.
    pub(super) models: Vec<String>,
}

/// A table or a plot.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(super) enum Show {
    /// A table of everything about whole runs.
    Table,
    /// The two errors of the paper's table 1.
    Ablation,
    /// Errors over k steps: table and plot (figure 3a).
    Steps,
    /// Errors by time (figure 3b).
    Time,
    /// Errors of whole runs as bars (figures 3c and 5).
    Bars,
    /// A table motion by motion.
    Motions,
    /// A table mesh by mesh.
    Meshes,
}

/// Opens a study by the path of its file or by the name of a shipped one.
///
/// # Errors
/// Names the file, the entry and what is wrong.
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
    /// Rivals beside the models, in the order of a table.
    pub(super) fn rivals(&self) -> impl Iterator<Item = Contestant> {
        let asked = self.rivals.iter().map(|rival| match rival {
            Rival::Rigid => Who::Rigid,
            Rival::Mirror => Who::Mirror,
            Rival::Truth => Who::Truth,
        });
        let asked: Vec<Who> = asked.collect();
        let all = Contestant::rivals().into_iter();
        all.filter(move |rival| asked.contains(&rival.who()))
    }
}

impl Study {
    /// The configuration of `entry`, with its changes.
    ///
    /// # Errors
    /// Names the file and the field.
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
        let cfg = TrainConfig::parse_with(&text, shown, &set.of(|| "set".to_owned())?)?;
        if !self.scale_schedules {
            return Ok(cfg);
        }
        let Budget::Steps(steps) = self.budget(entry)? else {
            return Err(StudyError::new(
                "scale_schedules: a budget in time has no steps to scale to: give { steps = 1000 }"
                    .to_string(),
            ));
        };
        let scaled = cfg.scaled_to(steps);
        scaled.of(|| format!("scaled from {} steps to the budget of {steps}", cfg.steps))
    }

    /// Values of its configuration that are changed for `entry`.
    pub(super) fn settings<'a>(&'a self, entry: &'a Training) -> impl Iterator<Item = &'a String> {
        self.set.iter().chain(&entry.set)
    }

    /// The end of `entry`.
    ///
    /// # Errors
    /// Where nobody says it, or it is zero.
    pub(super) fn budget(&self, entry: &Training) -> Result<Budget, StudyError> {
        match entry.budget.or(self.budget) {
            Some(Budget::Steps(0)) => Err(StudyError::new("budget: 0 steps train nothing: give at least 1".to_string())),
            Some(budget) => Ok(budget),
            None => Err(StudyError::new("there is no budget: write budget = { steps = 1000 } or { time = \"10m\" }, here or for the whole study".to_string())),
        }
    }

    /// The name of the data set that `entry` learns from.
    ///
    /// # Errors
    /// Where there are several and none is said.
    pub(super) fn data_of<'a>(&'a self, entry: &'a Training) -> Result<&'a str, StudyError> {
        match (&entry.data, self.data.keys().next()) {
            (Some(name), _) => Ok(name),
            (None, Some(only)) if self.data.len() == 1 => Ok(only),
            _ => Err(StudyError::new(
                "data: the study has several data sets: say which one it learns from".to_string(),
            )),
        }
    }

    /// The label of the model or rival of this name; none for an unknown name.
    pub(super) fn label<'a>(&'a self, name: &'a str) -> Option<&'a str> {
        let trained = self.train.iter().map(|entry| (&entry.name, &entry.label));
        let finished = self.model.iter().map(|entry| (&entry.name, &entry.label));
        let mut models = trained.chain(finished);
        if let Some((known, label)) = models.find(|entry| entry.0 == name) {
            return Some(label.as_ref().unwrap_or(known));
        }
        let mut rivals = self.evaluation.rivals();
        rivals.any(|rival| rival.name == name).then_some(name)
    }
}

impl Question {
    /// Names of the models to compare, in groups.
    pub(super) fn groups(&self) -> Vec<Grouped> {
        if !self.groups.is_empty() {
            return self.groups.clone();
        }
        vec![Grouped {
            heading: String::new(),
            models: self.models.clone(),
        }]
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
