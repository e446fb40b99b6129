//! The file of a checkpoint: its JSON, its tensors, and the checks before either is used.

use std::collections::HashMap;
use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use selvedge_data::read_header;
use selvedge_model::{Network, RunningStatistics};
use serde::{Deserialize, Serialize};

use super::differences::differences;
use super::error::ResumeError;
use crate::config::TrainConfig;
use crate::engine::Learned;
use crate::fit_normalizers::Statistics;
use crate::losses::RunningLossStatistics;
use crate::optimizer::Adam;
use crate::origin::Origin;
use crate::slot::Slot;
use crate::trainer::{Parts, StepReport, TrainError};
use crate::training_set::TrainingSet;

/// Value of the metadata `format` of a checkpoint.
pub const CHECKPOINT_FORMAT: &str = "selvedge-checkpoint";
pub(super) const VERSION: &str = "1";

/// The part of a checkpoint that is JSON.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct State {
    pub(super) step: u64,
    pub(super) optimizer_steps: u64,
    pub(super) inputs: [RunningStatistics; 2],
    pub(super) targets: RunningLossStatistics,
    #[serde(rename = "lanes")]
    pub(super) slots: Vec<Slot>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) origins: Vec<Origin>,
    /// Steps of which the log has no line yet.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(super) since_line: Vec<StepReport>,
}

pub(super) struct CheckpointFile<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
    metadata: HashMap<String, String>,
}

impl<'a> CheckpointFile<'a> {
    pub(super) fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self, ResumeError> {
        let shown = path.display();
        let container = |source: SafeTensorError| {
            ResumeError::File(format!(
                "{shown} is not a whole safetensors file ({source})"
            ))
        };
        let header = read_header(bytes).map_err(container)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(container)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        for (key, expected) in [("format", CHECKPOINT_FORMAT), ("version", VERSION)] {
            let found = metadata.get(key);
            if found.map(String::as_str) != Some(expected) {
                let found = found.map_or("missing".into(), |found| format!("\"{found}\""));
                return Err(ResumeError::File(format!(
                    "{shown}: metadata \"{key}\" is {found}, expected \"{expected}\""
                )));
            }
        }
        Ok(Self {
            path,
            tensors,
            metadata,
        })
    }

    fn content(&self, what: &str, problem: impl Display) -> ResumeError {
        ResumeError::File(format!("{}: {what}: {problem}", self.path.display()))
    }

    fn json<T: serde::de::DeserializeOwned>(&self, key: &str) -> Result<T, ResumeError> {
        let missing = || self.content(key, "is missing");
        let text = self.metadata.get(key).ok_or_else(missing)?;
        serde_json::from_str(text).map_err(|error| self.content(key, error))
    }

    /// Checks that the checkpoint was made with this configuration.
    pub(super) fn check(&self, cfg: &TrainConfig) -> Result<(), ResumeError> {
        let made: TrainConfig = self.json("config")?;
        let value = |made: &TrainConfig| {
            let free = TrainConfig {
                name: String::new(),
                steps: 1,
                log_every: 1,
                ..made.clone()
            };
            serde_json::to_value(free).map_err(|error| self.content("config", error))
        };
        let differences = differences(&value(&made)?, &value(cfg)?);
        match differences.into_iter().next() {
            None => Ok(()),
            Some(first) => Err(ResumeError::File(format!(
                "{} was made with another {} ({}, now {}): train into a new folder, or restore it",
                self.path.display(),
                first.path,
                first.made,
                first.now
            ))),
        }
    }

    /// Checks that the checkpoint was made on this data set.
    pub(super) fn check_data(&self, set: &TrainingSet) -> Result<(), ResumeError> {
        let made = self.metadata.get("dataset").map_or("", String::as_str);
        if made == set.fingerprint {
            return Ok(());
        }
        Err(ResumeError::File(format!(
            "{} was made on other data (data set \"{}\", now \"{}\", or its files or sections have changed): give the same, or train into a new folder",
            self.path.display(),
            made.split(' ').next().unwrap_or_default(),
            set.name
        )))
    }

    /// Checks that the statistics have the columns of the configuration.
    fn check_widths(&self, state: &State, cfg: &TrainConfig) -> Result<(), ResumeError> {
        let [nodes, edges] = &state.inputs;
        let (model, found) = (&cfg.model, (nodes.width(), edges.width()));
        let expected = (model.node_width(), model.edge_width());
        if found != expected || !state.targets.has_widths() {
            let problem = format!("statistics of {found:?} columns, expected {expected:?}");
            return Err(self.content("state", problem));
        }
        Ok(())
    }

    fn numbers(&self, name: &str, count: usize) -> Result<Vec<f32>, ResumeError> {
        let view = self.tensors.tensor(name);
        let view = view.map_err(|error| self.content(name, error))?;
        if view.dtype() != Dtype::F32 || view.shape().iter().product::<usize>() != count {
            let (dtype, shape) = (view.dtype(), view.shape());
            let problem = format!("{dtype:?} {shape:?}, expected {count} × F32");
            return Err(self.content(name, problem));
        }
        let chunks = view.data().as_chunks().0.iter();
        let values: Vec<f32> = chunks.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        match values.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(self.content(name, format!("entry {index} is not finite"))),
            None => Ok(values),
        }
    }

    /// The parts of a training by `cfg` that goes on from here.
    pub(super) fn parts(
        &self,
        cfg: &TrainConfig,
        set: &TrainingSet,
        network: Network,
    ) -> Result<Parts, ResumeError> {
        let state: State = self.json("state")?;
        self.check_widths(&state, cfg)?;
        let count = network.parameter_count();
        let numbers = |name| self.numbers(name, count);
        let [first, second] = [numbers("first_moment")?, numbers("second_moment")?];
        let adam = Adam::resume(cfg.optimizer, first, second, state.optimizer_steps);
        let (found, expected) = (state.slots.len(), cfg.batch.samples);
        if found != expected {
            return Err(self.content("state", format!("{found} slots, expected {expected}")));
        }
        let slots = state.slots.into_iter().enumerate();
        let slots = slots.map(|(number, slot)| self.with_history(number, slot, cfg, set));
        Ok(Parts {
            learned: Learned {
                weights: numbers("weights")?,
                averaged: cfg
                    .weight_average
                    .map(|_| numbers("averaged"))
                    .transpose()?,
                adam: adam.map_err(TrainError::from)?,
            },
            slots: slots.collect::<Result<_, _>>()?,
            network,
            statistics: Statistics {
                inputs: state.inputs,
                targets: state.targets,
            },
            step: state.step,
            origins: state.origins,
            since_line: state.since_line,
        })
    }

    /// The slot of that number with its history.
    fn with_history(
        &self,
        number: usize,
        slot: Slot,
        cfg: &TrainConfig,
        set: &TrainingSet,
    ) -> Result<Slot, ResumeError> {
        if slot.run == 0 {
            return Ok(slot);
        }
        let section = slot.section;
        if !set.has(&section) || !TrainingSet::section_has(&section, slot.current) {
            let problem = format!("slot {number} is in no section of the data set");
            return Err(self.content("state", problem));
        }
        let vertices = set.motion(section.trajectory).graph.vertex_count();
        let frames = cfg.model.history();
        let numbers = self.numbers(&history_name(number), frames * vertices * 3)?;
        let points = numbers.as_chunks().0.iter().copied().map(Vec3::from_array);
        let positions: Vec<Vec3> = points.collect();
        let history = positions.chunks_exact(vertices);
        Ok(Slot {
            history: history.map(|frame| Arc::new(frame.to_vec())).collect(),
            ..slot
        })
    }
}

/// The name of the tensor of a slot's history.
pub(super) fn history_name(slot: usize) -> String {
    format!("lane.{slot}.history")
}
