//! Checkpoints: all that decides how a training goes on, in one `.safetensors` file, or in several
//! small ones where that would be large, so that a resumed training continues bit for bit.

mod parts;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use selvedge_data::{Dataset, Section, WriteError};
use selvedge_model::{ModelSpec, RunningStatistics};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use crate::config::TrainConfig;
use crate::engine::{EngineMaker, Learned};
use crate::fit_normalizers::Statistics;
use crate::losses::RunningLossStatistics;
use crate::optimizer::Adam;
use crate::origin::Origin;
use crate::slot::Slot;
use crate::trainer::{Parts, TrainError, Trainer, prepare};
use crate::training_set::TrainingSet;

/// Value of the metadata `format` of a checkpoint.
pub const CHECKPOINT_FORMAT: &str = "selvedge-checkpoint";
const VERSION: &str = "1";

/// A training that cannot be resumed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ResumeError {
    #[error("cannot read {path}: {source}")]
    Read {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("{path} is not a whole safetensors file ({source})")]
    Container {
        path: PathBuf,
        source: SafeTensorError,
    },
    #[error("{path}: metadata \"{key}\" is {found}, expected \"{expected}\"")]
    Metadata {
        path: PathBuf,
        key: &'static str,
        expected: &'static str,
        found: String,
    },
    #[error("{path}: {what}: {detail}")]
    Content {
        path: PathBuf,
        what: String,
        detail: String,
    },
    #[error(
        "{path} was made with another {field} ({found}, now {expected}): train into a new folder, or restore it"
    )]
    Configuration {
        path: PathBuf,
        field: String,
        expected: String,
        found: String,
    },
    #[error(
        "{path} is of another model: {differences}: set these values as they are there, or train without it"
    )]
    OtherModel { path: PathBuf, differences: String },
    #[error(
        "{path} was made on other data (data set \"{found}\", now \"{expected}\", or its files or sections have changed): give the same, or train into a new folder"
    )]
    Data {
        path: PathBuf,
        expected: String,
        found: String,
    },
    #[error(transparent)]
    Train(#[from] TrainError),
}

/// The part of a checkpoint that is JSON.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    step: u64,
    optimizer_steps: u64,
    inputs: [RunningStatistics; 2],
    targets: RunningLossStatistics,
    #[serde(rename = "lanes")]
    slots: Vec<SlotEntry>,
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    origins: Vec<Origin>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct SlotEntry {
    section: Section,
    current: usize,
    run: u32,
}

impl Trainer {
    /// Writes everything that decides the rest of the training, as it was last collected
    /// ([`Self::collect`]).
    ///
    /// # Errors
    /// [`WriteError`]; what was at `path` is then still there.
    pub fn save(&self, path: &Path, dataset: &Dataset) -> Result<(), WriteError> {
        self.save_in_parts(path, dataset, parts::MOST_BYTES)
    }

    /// The same, in files of at most so many bytes of numbers.
    fn save_in_parts(&self, path: &Path, dataset: &Dataset, most: usize) -> Result<(), WriteError> {
        let json = |result: Result<String, serde_json::Error>| {
            result.map_err(|error| WriteError {
                path: path.to_owned(),
                action: "write its metadata",
                source: error.into(),
            })
        };
        let state = State {
            step: self.step,
            optimizer_steps: self.learned.adam.steps(),
            inputs: self.inputs.clone(),
            targets: self.targets.clone(),
            slots: self.slots.iter().map(SlotEntry::of).collect(),
            origins: self.origins.clone(),
        };
        let histories = self.histories();
        let Learned {
            weights,
            averaged,
            adam,
        } = &self.learned;
        let mut flat: Vec<(&str, &[f32])> = vec![
            ("weights", weights),
            ("first_moment", adam.first_moment()),
            ("second_moment", adam.second_moment()),
        ];
        flat.extend(averaged.iter().map(|averaged| ("averaged", &averaged[..])));
        let flat = flat
            .into_iter()
            .map(|(name, values)| (name, vec![values.len()], values));
        let of_lanes = histories.iter();
        let of_lanes =
            of_lanes.map(|(name, shape, values)| (&name[..], shape.clone(), &values[..]));
        let tensors: Vec<parts::Tensor<'_>> = flat.chain(of_lanes).collect();
        let metadata = BTreeMap::from([
            ("format", CHECKPOINT_FORMAT.to_owned()),
            ("version", VERSION.to_owned()),
            ("config", json(serde_json::to_string(&self.cfg))?),
            ("dataset", json(fingerprint(dataset))?),
            ("state", json(serde_json::to_string(&state))?),
        ]);
        parts::write(path, &tensors, &metadata, most)
    }

    /// Name, shape and numbers of the history of each slot that is in a run.
    fn histories(&self) -> Vec<(String, Vec<usize>, Vec<f32>)> {
        let slots = self.slots.iter().enumerate();
        slots
            .filter(|(_, slot)| !slot.history.is_empty())
            .map(|(number, slot)| {
                let shape = vec![slot.history.len(), slot.history[0].len(), 3];
                let values = slot.history.iter().flatten().flat_map(|p| p.to_array());
                (history_name(number), shape, values.collect())
            })
            .collect()
    }

    /// Goes on from the checkpoint at `path`, wherever that was made. Only `name`, `steps` and
    /// `log_every` may differ from the configuration it was made with.
    ///
    /// # Errors
    /// [`ResumeError`] names the file and what does not fit.
    pub fn resume(
        cfg: TrainConfig,
        dataset: &Dataset,
        path: &Path,
        engine: &dyn EngineMaker,
    ) -> Result<Self, ResumeError> {
        cfg.validate().map_err(TrainError::from)?;
        let bytes = Bytes::read(path)?;
        let file = CheckpointFile::open(path, &bytes)?;
        file.check(&cfg, dataset)?;
        let state: State = file.json("state")?;
        file.check_widths(&state, &cfg)?;
        let (set, network) = prepare(&cfg, dataset, engine.arithmetic())?;
        let count = network.parameter_count();
        let moments = [
            file.numbers("first_moment", count)?,
            file.numbers("second_moment", count)?,
        ];
        let [first, second] = moments;
        let adam = Adam::resume(cfg.optimizer, first, second, state.optimizer_steps)
            .map_err(TrainError::from)?;
        if state.slots.len() != cfg.batch.samples {
            let (found, expected) = (state.slots.len(), cfg.batch.samples);
            return Err(file.content("state", format!("{found} slots, expected {expected}")));
        }
        let slots = state.slots.iter().enumerate();
        let slots = slots.map(|(number, entry)| file.slot(number, entry, &cfg, &set));
        let averaged = cfg.weight_average.map(|_| file.numbers("averaged", count));
        let parts = Parts {
            learned: Learned {
                weights: file.numbers("weights", count)?,
                averaged: averaged.transpose()?,
                adam,
            },
            slots: slots.collect::<Result<_, _>>()?,
            network,
            statistics: Statistics {
                inputs: state.inputs,
                targets: state.targets,
            },
            step: state.step,
            origins: state.origins,
        };
        Ok(Self::assemble(cfg, set, engine, parts)?)
    }
}

impl Trainer {
    /// A new training from its first step, but with the weights and the statistics of the
    /// checkpoint at `path`, which may be of another configuration and other data; only `model`
    /// must be the same, but for its edge limits.
    ///
    /// # Errors
    /// [`ResumeError`] names the file and what does not fit.
    pub fn start_from(
        cfg: TrainConfig,
        dataset: &Dataset,
        path: &Path,
        engine: &dyn EngineMaker,
    ) -> Result<Self, ResumeError> {
        cfg.validate().map_err(TrainError::from)?;
        let bytes = Bytes::read(path)?;
        let file = CheckpointFile::open(path, &bytes)?;
        let made: TrainConfig = file.json("config")?;
        file.check_network(&made, &cfg)?;
        let state: State = file.json("state")?;
        file.check_widths(&state, &cfg)?;
        let (set, network) = prepare(&cfg, dataset, engine.arithmetic())?;
        let mut origins = state.origins;
        origins.push(Origin {
            name: made.name,
            steps_done: state.step,
            dataset: name_in(file.metadata.get("dataset").map_or("", String::as_str)),
        });
        let weights = file.numbers("weights", network.parameter_count())?;
        let parts = Parts {
            learned: Learned {
                adam: Adam::new(cfg.optimizer, weights.len()).map_err(TrainError::from)?,
                averaged: cfg.weight_average.map(|_| weights.clone()),
                weights,
            },
            slots: vec![Slot::new(); cfg.batch.samples],
            network,
            statistics: Statistics {
                inputs: state.inputs,
                targets: state.targets,
            },
            step: 0,
            origins,
        };
        Ok(Self::assemble(cfg, set, engine, parts)?)
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ResumeError> {
    std::fs::read(path).map_err(|source| ResumeError::Read {
        path: path.to_owned(),
        source,
    })
}

impl SlotEntry {
    fn of(slot: &Slot) -> Self {
        Self {
            section: slot.section,
            current: slot.current,
            run: slot.run,
        }
    }
}

/// The bytes of a checkpoint: its first file's, and those of the others.
struct Bytes {
    first: Vec<u8>,
    others: Vec<(PathBuf, Vec<u8>)>,
}

impl Bytes {
    fn read(path: &Path) -> Result<Self, ResumeError> {
        let first = read(path)?;
        let others = parts::read_others(path, &first)?;
        Ok(Self { first, others })
    }
}

struct CheckpointFile<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
    others: Vec<SafeTensors<'a>>,
    metadata: std::collections::HashMap<String, String>,
}

impl<'a> CheckpointFile<'a> {
    fn open(path: &'a Path, bytes: &'a Bytes) -> Result<Self, ResumeError> {
        let container = |path: &Path, source| ResumeError::Container {
            path: path.to_owned(),
            source,
        };
        let here = |source| container(path, source);
        let (_, header) = SafeTensors::read_metadata(&bytes.first).map_err(here)?;
        let tensors = SafeTensors::deserialize(&bytes.first).map_err(here)?;
        let others = bytes.others.iter().map(|(path, bytes)| {
            SafeTensors::deserialize(bytes).map_err(|source| container(path, source))
        });
        let others: Vec<SafeTensors<'_>> = others.collect::<Result<_, _>>()?;
        let metadata = header.metadata().clone().unwrap_or_default();
        for (key, expected) in [("format", CHECKPOINT_FORMAT), ("version", VERSION)] {
            let found = metadata.get(key);
            if found.map(String::as_str) != Some(expected) {
                return Err(ResumeError::Metadata {
                    path: path.to_owned(),
                    key,
                    expected,
                    found: found.map_or("missing".into(), |found| format!("\"{found}\"")),
                });
            }
        }
        Ok(Self {
            path,
            tensors,
            others,
            metadata,
        })
    }

    fn content(&self, what: &str, detail: impl std::fmt::Display) -> ResumeError {
        ResumeError::Content {
            path: self.path.to_owned(),
            what: what.to_owned(),
            detail: detail.to_string(),
        }
    }

    fn json<T: serde::de::DeserializeOwned>(&self, key: &str) -> Result<T, ResumeError> {
        let missing = || self.content(key, "is missing");
        let text = self.metadata.get(key).ok_or_else(missing)?;
        serde_json::from_str(text).map_err(|error| self.content(key, error))
    }

    /// Checks that the checkpoint was made with this configuration and this data set.
    fn check(&self, cfg: &TrainConfig, dataset: &Dataset) -> Result<(), ResumeError> {
        let path = || self.path.to_owned();
        let made: TrainConfig = self.json("config")?;
        let value = |cfg: &TrainConfig| {
            let free = TrainConfig {
                name: String::new(),
                steps: 1,
                log_every: 1,
                ..cfg.clone()
            };
            serde_json::to_value(free).map_err(|error| self.content("config", error))
        };
        let differences = differences(&value(&made)?, &value(cfg)?);
        if let Some(first) = differences.into_iter().next() {
            return Err(ResumeError::Configuration {
                path: path(),
                field: first.path,
                expected: first.now,
                found: first.made,
            });
        }
        let now = fingerprint(dataset).map_err(|error| self.content("dataset", error))?;
        let made = self.metadata.get("dataset").map_or("", String::as_str);
        if made != now {
            return Err(ResumeError::Data {
                path: path(),
                expected: name_in(&now),
                found: name_in(made),
            });
        }
        Ok(())
    }

    /// Checks that the network is the same; the limits of edges may differ.
    fn check_network(&self, made: &TrainConfig, cfg: &TrainConfig) -> Result<(), ResumeError> {
        let network = |cfg: &TrainConfig| {
            let spec = ModelSpec {
                edge_limits: None,
                ..cfg.model.clone()
            };
            serde_json::to_value(spec).map_err(|error| self.content("config", error))
        };
        let differences: Vec<String> = differences(&network(made)?, &network(cfg)?)
            .into_iter()
            .map(|Difference { path, made, now }| {
                format!("model.{path} is {made} there, {now} here")
            })
            .collect();
        if differences.is_empty() {
            return Ok(());
        }
        Err(ResumeError::OtherModel {
            path: self.path.to_owned(),
            differences: differences.join("; "),
        })
    }

    /// Checks that the statistics have the columns of the configuration.
    fn check_widths(&self, state: &State, cfg: &TrainConfig) -> Result<(), ResumeError> {
        let [nodes, edges] = &state.inputs;
        let (model, found) = (&cfg.model, (nodes.width(), edges.width()));
        let expected = (model.node_width(), model.edge_width());
        if found != expected || !state.targets.has_own_widths() {
            let detail = format!("statistics of {found:?} columns, expected {expected:?}");
            return Err(self.content("state", detail));
        }
        Ok(())
    }

    fn numbers(&self, name: &str, count: usize) -> Result<Vec<f32>, ResumeError> {
        let files = || std::iter::once(&self.tensors).chain(&self.others);
        let values = match parts::joined(files(), name) {
            Some(values) if values.len() == count => values,
            Some(values) => {
                let found = format!("{} numbers in pieces, expected {count}", values.len());
                return Err(self.content(name, found));
            }
            None => {
                let whole = files().find_map(|file| file.tensor(name).ok());
                let view = match whole {
                    Some(view) => view,
                    None => self
                        .tensors
                        .tensor(name)
                        .map_err(|e| self.content(name, e))?,
                };
                if view.dtype() != Dtype::F32 || view.shape().iter().product::<usize>() != count {
                    let found = format!(
                        "{:?} {:?}, expected {count} × F32",
                        view.dtype(),
                        view.shape()
                    );
                    return Err(self.content(name, found));
                }
                let chunks = view.data().as_chunks().0.iter();
                chunks.map(|bytes| f32::from_le_bytes(*bytes)).collect()
            }
        };
        match values.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(self.content(name, format!("entry {index} is not finite"))),
            None => Ok(values),
        }
    }

    fn slot(
        &self,
        number: usize,
        entry: &SlotEntry,
        cfg: &TrainConfig,
        set: &TrainingSet,
    ) -> Result<Slot, ResumeError> {
        let mut history = Vec::new();
        if entry.run > 0 {
            let trajectory = entry.section.trajectory;
            if !set.has(&entry.section) || !TrainingSet::section_has(&entry.section, entry.current)
            {
                return Err(self.content(
                    "state",
                    format!("slot {number} is in no section of the data set"),
                ));
            }
            let vertices = set.motion(trajectory).graph.vertex_count();
            let frames = cfg.model.history();
            let numbers = self.numbers(&history_name(number), frames * vertices * 3)?;
            let positions: Vec<Vec3> = numbers
                .as_chunks()
                .0
                .iter()
                .copied()
                .map(Vec3::from_array)
                .collect();
            history = positions
                .chunks_exact(vertices)
                .map(<[_]>::to_vec)
                .collect();
        }
        Ok(Slot {
            section: entry.section,
            current: entry.current,
            run: entry.run,
            history,
        })
    }
}

fn history_name(slot: usize) -> String {
    format!("lane.{slot}.history")
}

/// The fingerprint of a data set: its name and the hashes of its training trajectories.
fn fingerprint(dataset: &Dataset) -> Result<String, serde_json::Error> {
    let index = dataset.index();
    let mut text = index.name.clone();
    for entry in &index.splits.train {
        text.push(' ');
        text.push_str(&entry.blake3);
    }
    text.push_str(&format!(" {}", serde_json::to_string(&index.sections)?));
    Ok(text)
}

/// The name of the data set in its fingerprint.
fn name_in(fingerprint: &str) -> String {
    let name = fingerprint.split(' ').next();
    name.unwrap_or_default().to_owned()
}

/// A place where two values differ, and both texts.
struct Difference {
    path: String,
    made: String,
    now: String,
}

/// The places where two values differ. Tables of other keys (another kind of schedule) differ as a
/// whole.
fn differences(made: &Value, now: &Value) -> Vec<Difference> {
    if made == now {
        return Vec::new();
    }
    if let (Value::Object(made), Value::Object(now)) = (made, now)
        && made.keys().eq(now.keys())
    {
        let fields = made.iter().zip(now.values());
        let within = fields.flat_map(|((key, made), now)| {
            differences(made, now).into_iter().map(move |inner| {
                let dot = if inner.path.is_empty() { "" } else { "." };
                let path = format!("{key}{dot}{}", inner.path);
                Difference { path, ..inner }
            })
        });
        return within.collect();
    }
    vec![Difference {
        path: String::new(),
        made: made.to_string(),
        now: now.to_string(),
    }]
}

#[cfg(test)]
mod tests;
