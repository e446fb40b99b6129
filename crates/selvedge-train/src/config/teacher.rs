//! The part of a configuration that makes the samples of a model that corrects physics.

use serde::{Deserialize, Serialize};

use super::error::{InvalidConfig, count, positive, require};

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

impl TeacherConfig {
    pub(super) fn validate(&self) -> Result<(), InvalidConfig> {
        count("teacher.substeps", self.substeps.into(), 10_000)?;
        count("teacher.scenes", self.scenes.len() as u64, 1000)
    }
}

impl SampleConfig {
    pub(super) fn validate(&self) -> Result<(), InvalidConfig> {
        for (field, value, most) in [
            ("samples.cloths", self.cloths, 10_000),
            ("samples.kept", self.kept, 10_000_000),
            ("samples.statistics", self.statistics, 1_000_000),
            ("samples.frames", self.frames, 1_000_000),
        ] {
            count(field, value as u64, most)?;
        }
        let enough = self.kept >= self.statistics;
        let expected = "at least samples.statistics";
        require(enough, "samples.kept", expected, self.kept as f64)?;
        if let Some(farthest) = self.farthest {
            positive("samples.farthest", farthest)?;
        }
        positive("samples.uses", self.uses)
    }
}
