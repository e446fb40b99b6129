//! Checkpoints: all that decides how a training goes on, in one `.safetensors` file, so that a
//! resumed training continues bit for bit. Every part is checked before it is used.

use std::collections::{BTreeMap, HashMap};
use std::fmt::Display;
use std::path::Path;
use std::sync::Arc;

use glam::Vec3;
use selvedge_data::{ArrayFile, Dataset, TensorOut, TensorValues, WriteError, write_tensors};
use selvedge_model::{ModelSpec, RunningStatistics, edge_groups, node_groups};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use crate::config::TrainConfig;
use crate::engine::{EngineMaker, Learned};
use crate::from_model::Origin;
use crate::losses::RunningLossStatistics;
use crate::optimizer::Adam;
use crate::slot::Slot;
use crate::trainer::{StepReport, TrainError, Trainer, prepare};
use crate::training_set::TrainingSet;

/// Value of the metadata `format` of a checkpoint.
pub const CHECKPOINT_FORMAT: &str = "selvedge-checkpoint";
const VERSION: &str = "1";

/// What a training is between two steps, beside weights, optimiser and the slots' histories: the
/// part of a checkpoint that is JSON.
#[derive(Clone, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct State {
    pub(crate) step: u64,
    pub(crate) optimizer_steps: u64,
    /// Statistics of the features of vertices and of arcs.
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
    #[serde(rename = "lanes")]
    pub(crate) slots: Vec<Slot>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) origins: Vec<Origin>,
    /// Steps of which the log has no line yet.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub(crate) since_line: Vec<StepReport>,
}

/// A training that cannot be resumed.
#[derive(Debug, Error)]
pub enum ResumeError {
    /// The file is no checkpoint of this training; the message names it and says why.
    #[error("{0}")]
    File(String),
    /// The training cannot start.
    #[error(transparent)]
    Train(#[from] TrainError),
}

impl Trainer {
    /// Writes everything that decides the rest of the training, as it was last collected
    /// ([`Self::collect`]).
    ///
    /// # Errors
    /// [`WriteError`]; what was at `path` is then still there.
    pub fn save(&self, path: &Path) -> Result<(), WriteError> {
        let json = |result: Result<String, serde_json::Error>| {
            result.map_err(|error| WriteError {
                path: path.to_owned(),
                action: "write its metadata",
                source: error.into(),
            })
        };
        let Learned {
            weights,
            averaged,
            adam,
        } = &self.learned;
        let state = State {
            optimizer_steps: adam.steps(),
            ..self.state.clone()
        };
        let metadata = BTreeMap::from([
            ("format", CHECKPOINT_FORMAT.to_owned()),
            ("version", VERSION.to_owned()),
            ("config", json(serde_json::to_string(&self.cfg))?),
            ("dataset", self.set.fingerprint.clone()),
            ("state", json(serde_json::to_string(&state))?),
        ]);
        let mut flat: Vec<(&str, &[f32])> = vec![
            ("weights", weights),
            ("first_moment", adam.first_moment()),
            ("second_moment", adam.second_moment()),
        ];
        flat.extend(averaged.iter().map(|averaged| ("averaged", &averaged[..])));
        let flat = flat.into_iter().map(|(name, values)| {
            TensorOut::new(name, &[values.len()], TensorValues::F32(values.into()))
        });
        let tensors: Vec<TensorOut<'_>> = flat.chain(histories(&state.slots)).collect();
        write_tensors(path, &tensors, &metadata)
    }

    /// Goes on from the checkpoint at `path`, wherever that was made. Only `name`, `steps` and
    /// `log_every` may differ from the configuration it was made with.
    pub fn resume(
        cfg: TrainConfig,
        dataset: &Dataset,
        path: &Path,
        engine: &dyn EngineMaker,
    ) -> Result<Self, ResumeError> {
        cfg.validate().map_err(TrainError::from)?;
        let bytes = selvedge_data::read_file(path).map_err(|source| {
            ResumeError::File(format!("cannot read {}: {source}", path.display()))
        })?;
        let file = CheckpointFile::open(path, &bytes)?;
        file.check(&cfg)?;
        let (set, network) = prepare(&cfg, dataset, engine.micro_batch())?;
        file.check_data(&set)?;
        let mut state: State = file.json("state")?;
        file.check_state(&state, &cfg)?;
        let learned = file.learned(&cfg, network.parameter_count(), state.optimizer_steps)?;
        for (number, slot) in state.slots.iter_mut().enumerate() {
            file.read_history(number, slot, &cfg, &set)?;
        }
        Ok(Self::assemble((cfg, set, network), engine, learned, state)?)
    }
}

/// The name of the tensor of a slot's history.
fn history_name(slot: usize) -> String {
    format!("lane.{slot}.history")
}

/// The history of each slot that is in a run, `[frames, vertices, 3]`.
fn histories(slots: &[Slot]) -> impl Iterator<Item = TensorOut<'_>> {
    let in_runs = slots.iter().enumerate();
    let in_runs = in_runs.filter(|(_, slot)| !slot.history.is_empty());
    in_runs.map(|(number, slot)| {
        let shape = [slot.history.len(), slot.history[0].len(), 3];
        let points = slot.history.iter().flat_map(|frame| frame.iter());
        let values: Vec<f32> = points.flat_map(|p| p.to_array()).collect();
        TensorOut::new(
            history_name(number),
            &shape,
            TensorValues::F32(values.into()),
        )
    })
}

struct CheckpointFile<'a> {
    path: &'a Path,
    arrays: ArrayFile<'a>,
    metadata: HashMap<String, String>,
}

impl<'a> CheckpointFile<'a> {
    fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self, ResumeError> {
        let shown = path.display();
        let read = ArrayFile::safetensors(bytes);
        let (arrays, metadata) =
            read.map_err(|problem| ResumeError::File(format!("{shown} {problem}")))?;
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
            arrays,
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
    fn check(&self, cfg: &TrainConfig) -> Result<(), ResumeError> {
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
        match differences(&value(&made)?, &value(cfg)?).first() {
            None => Ok(()),
            Some([place, made, now]) => Err(ResumeError::File(format!(
                "{} was made with another {place} ({made}, now {now}): train into a new folder, or restore it",
                self.path.display(),
            ))),
        }
    }

    /// Checks that the checkpoint was made on this data set.
    fn check_data(&self, set: &TrainingSet) -> Result<(), ResumeError> {
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

    /// Checks that the statistics have the columns of the configuration, and that there are as many
    /// slots.
    fn check_state(&self, state: &State, cfg: &TrainConfig) -> Result<(), ResumeError> {
        let groups = [node_groups(&cfg.model), edge_groups(&cfg.model)];
        let inputs = state.inputs.iter().zip(&groups);
        let inputs = inputs.map(|(statistics, groups)| statistics.check(groups));
        let all: Result<(), _> = inputs.chain([state.targets.check()]).collect();
        all.map_err(|problem| self.content("state: statistics", problem))?;
        let (found, expected) = (state.slots.len(), cfg.batch.samples);
        if found != expected {
            return Err(self.content("state", format!("{found} slots, expected {expected}")));
        }
        Ok(())
    }

    fn numbers(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, ResumeError> {
        let shape: Vec<_> = shape.iter().copied().map(Some).collect();
        let array = self.arrays.singles(name);
        let array = array.and_then(|array| array.of_shape(&shape));
        let values = array.map_err(|problem| self.content(name, problem))?.values;
        match values.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(self.content(name, format!("entry {index} is not finite"))),
            None => Ok(values),
        }
    }

    /// `count` weights, and the optimiser after so many steps.
    fn learned(&self, cfg: &TrainConfig, count: usize, steps: u64) -> Result<Learned, ResumeError> {
        let numbers = |name| self.numbers(name, &[count]);
        let [first, second] = [numbers("first_moment")?, numbers("second_moment")?];
        let adam = Adam::resume(cfg.optimizer, first, second, steps);
        let averaged = cfg.weight_average.map(|_| numbers("averaged"));
        Ok(Learned {
            weights: numbers("weights")?,
            averaged: averaged.transpose()?,
            adam: adam.map_err(TrainError::from)?,
        })
    }

    /// Reads the history of the slot of that number.
    fn read_history(
        &self,
        number: usize,
        slot: &mut Slot,
        cfg: &TrainConfig,
        set: &TrainingSet,
    ) -> Result<(), ResumeError> {
        if slot.run == 0 {
            return Ok(());
        }
        let section = slot.section;
        if !set.has(&section) || !TrainingSet::section_has(&section, slot.current) {
            let problem = format!("slot {number} is in no section of the data set");
            return Err(self.content("state", problem));
        }
        let vertices = set.motion(section.trajectory).graph.vertex_count();
        let frames = cfg.model.history();
        let numbers = self.numbers(&history_name(number), &[frames, vertices, 3])?;
        let points = numbers.as_chunks().0.iter().copied().map(Vec3::from_array);
        let positions: Vec<Vec3> = points.collect();
        let history = positions.chunks_exact(vertices);
        slot.history = history.map(|frame| Arc::new(frame.to_vec())).collect();
        Ok(())
    }
}

/// The places where two networks differ but for their encoders, in words; none where they are the
/// same.
pub(crate) fn differences_but_encoder(
    made: &ModelSpec,
    now: &ModelSpec,
) -> Result<String, serde_json::Error> {
    let network = |spec: &ModelSpec| {
        serde_json::to_value(ModelSpec {
            encoder: now.encoder,
            ..spec.clone()
        })
    };
    let words = differences(&network(made)?, &network(now)?)
        .into_iter()
        .map(|[place, made, now]| format!("model.{place} is {made} there, {now} here"));
    Ok(words.collect::<Vec<_>>().join("; "))
}

/// The places where two values differ, and both texts. Tables of other keys (another kind of
/// schedule) differ as a whole.
fn differences(made: &Value, now: &Value) -> Vec<[String; 3]> {
    if made == now {
        return Vec::new();
    }
    if let (Value::Object(made), Value::Object(now)) = (made, now)
        && made.keys().eq(now.keys())
    {
        let fields = made.iter().zip(now.values());
        let within = fields.flat_map(|((key, made), now)| {
            let inner = differences(made, now).into_iter();
            inner.map(move |[place, made, now]| {
                let dot = if place.is_empty() { "" } else { "." };
                [format!("{key}{dot}{place}"), made, now]
            })
        });
        return within.collect();
    }
    vec![[String::new(), made.to_string(), now.to_string()]]
}

#[cfg(test)]
mod tests;
