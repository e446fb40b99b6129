//! The configuration of a training that corrects physics.

use std::path::Path;

use selvedge_model::ModelSpec;
use serde::{Deserialize, Serialize};

use crate::config::{BatchConfig, ConfigError, InvalidConfig, Setting, changed, error as check};
use crate::optimizer::AdamSettings;
use crate::schedule::{LearningRate, MOST_STEPS, UnrollFrames};

/// All settings that decide a training of a model that corrects physics.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct CorrectionConfig {
    /// Name for people.
    pub name: String,
    /// Seed of all random numbers.
    pub seed: u64,
    /// Optimiser steps in all.
    pub steps: u64,
    /// The network and the physics that it corrects (`model.base`).
    pub model: ModelSpec,
    /// The physics that it learns from.
    pub teacher: TeacherConfig,
    /// The making and the use of samples.
    #[serde(default)]
    pub samples: SampleConfig,
    /// Settings of the optimiser.
    #[serde(default)]
    pub optimizer: AdamSettings,
    /// The learning rate.
    pub learning_rate: LearningRate,
    /// The largest Euclidean norm of the batch's mean gradient.
    #[serde(default)]
    pub gradient_clip: Option<f64>,
    /// A sample whose loss L is above this counts with the weight `loss_cap`/L.
    #[serde(default)]
    pub loss_cap: Option<f64>,
    /// The part that a step leaves of the running mean of the weights, of which the model is made.
    #[serde(default)]
    pub weight_average: Option<f64>,
    /// Samples of a step.
    pub batch: BatchConfig,
    /// Frames in a row, at most, that follow from a state of the teacher, all but the last one by
    /// the model itself; with 1 every sample starts from a state of the teacher.
    #[serde(default)]
    pub own_frames: UnrollFrames,
    /// Steps from one line of the log to the next.
    pub log_every: u64,
}

/// The physics that a model learns from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct TeacherConfig {
    /// Presets of data sets, names or files: the cloths move as in their motions to train on.
    pub scenes: Vec<String>,
    /// Solves of second order per frame.
    pub substeps: u32,
}

/// The making and the use of samples.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SampleConfig {
    /// Cloths that move at once.
    pub cloths: usize,
    /// The latest samples that are kept.
    pub kept: usize,
    /// Number of times that each sample is learned from, on average.
    pub uses: f64,
    /// Samples from which statistics are taken before the first step.
    pub statistics: usize,
    /// Frames of a motion that pass before its first sample, at most.
    pub lead: usize,
    /// Frames of a motion that give samples, at most.
    pub frames: usize,
    /// Mean distance from the teacher's frame, over the vertices that no handle holds, after one
    /// frame of the model, at which a run of its own frames ends `[m]`: what a run that diverges
    /// shows is not learned from.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub farthest: Option<f64>,
}

impl Default for SampleConfig {
    fn default() -> Self {
        Self {
            cloths: 24,
            kept: 3000,
            uses: 6.0,
            statistics: 400,
            lead: 300,
            frames: 300,
            farthest: None,
        }
    }
}

impl CorrectionConfig {
    /// Returns true for the text of a configuration of this kind: it names a teacher.
    #[must_use]
    pub fn is_meant(text: &str) -> bool {
        let table: Result<toml::Table, _> = toml::from_str(text);
        table.is_ok_and(|table| table.contains_key("teacher"))
    }

    /// Reads and checks the TOML text of a configuration, with some of its values changed; errors
    /// name it `path`.
    ///
    /// # Errors
    /// [`ConfigError`] names the file and the field.
    pub fn parse_with(text: &str, path: &Path, settings: &[Setting]) -> Result<Self, ConfigError> {
        let path = path.to_owned();
        let cfg: Self = changed(text, &path, settings)?;
        match cfg.validate() {
            Ok(()) => Ok(cfg),
            Err(source) => Err(ConfigError::Invalid { path, source }),
        }
    }

    /// Checks every value.
    ///
    /// # Errors
    /// [`InvalidConfig`] names the field.
    pub fn validate(&self) -> Result<(), InvalidConfig> {
        self.model.validate()?;
        self.optimizer.validate()?;
        self.learning_rate.validate()?;
        self.own_frames.validate_as("own_frames")?;
        check::count("steps", self.steps, MOST_STEPS)?;
        check::count("log_every", self.log_every, 100_000)?;
        check::count("batch.samples", self.batch.samples as u64, 65_536)?;
        for (field, value) in [
            ("gradient_clip", self.gradient_clip),
            ("loss_cap", self.loss_cap),
        ] {
            value.map_or(Ok(()), |value| check::positive(field, value))?;
        }
        if let Some(part) = self.weight_average {
            let below = (0.0..1.0).contains(&part);
            check::require(below, "weight_average", "at least 0 and below 1", part)?;
        }
        let substeps = u64::from(self.teacher.substeps);
        check::count("teacher.substeps", substeps, 10_000)?;
        let scenes = self.teacher.scenes.len() as u64;
        check::count("teacher.scenes", scenes, 1000)?;
        if self.model.base.is_none() {
            return Err(InvalidConfig::NoBase);
        }
        self.samples.validate()
    }
}

impl SampleConfig {
    fn validate(&self) -> Result<(), InvalidConfig> {
        for (field, value, most) in [
            ("samples.cloths", self.cloths, 10_000),
            ("samples.kept", self.kept, 10_000_000),
            ("samples.statistics", self.statistics, 1_000_000),
            ("samples.frames", self.frames, 1_000_000),
        ] {
            check::count(field, value as u64, most)?;
        }
        let enough = self.kept >= self.statistics;
        let expected = "at least samples.statistics";
        check::require(enough, "samples.kept", expected, self.kept as f64)?;
        if let Some(farthest) = self.farthest {
            check::positive("samples.farthest", farthest)?;
        }
        check::positive("samples.uses", self.uses)
    }
}

#[cfg(test)]
mod tests {
    use crate::correction::trainer::tests::config;

    #[test]
    fn wrong_values_name_their_key() {
        let frames = |frames| crate::schedule::UnrollFrames::Constant { frames };
        type Edit = fn(&mut super::CorrectionConfig);
        let edits: [(&str, Edit); 7] = [
            ("teacher.substeps", |cfg| cfg.teacher.substeps = 0),
            ("teacher.scenes", |cfg| cfg.teacher.scenes.clear()),
            ("samples.cloths", |cfg| cfg.samples.cloths = 0),
            ("samples.kept", |cfg| cfg.samples.kept = 3),
            ("samples.uses", |cfg| cfg.samples.uses = 0.0),
            ("samples.farthest", |cfg| cfg.samples.farthest = Some(0.0)),
            ("model.base", |cfg| {
                cfg.model.base.as_mut().unwrap().substeps = 0
            }),
        ];
        for (key, edit) in edits {
            let mut cfg = config("");
            edit(&mut cfg);
            let error = cfg.validate().unwrap_err().to_string();
            assert!(error.contains(key), "{key}: {error}");
        }
        let mut cfg = config("");
        cfg.own_frames = frames(0);
        let error = cfg.validate().unwrap_err().to_string();
        assert!(error.contains("own_frames.frames"), "{error}");
    }
}
