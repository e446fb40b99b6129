//! Checkpoints: all that decides how a training goes on, in one `.safetensors` file, so that a
//! resumed training continues bit for bit.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::Vec3;
use safetensors::{Dtype, SafeTensorError, SafeTensors};
use selvedge_data::{Dataset, Section, TensorOut, TensorValues, WriteError, write_tensors};
use selvedge_model::{Network, RunningStatistics};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::config::TrainConfig;
use crate::corpus::Corpus;
use crate::lane::LaneState;
use crate::losses::RunningLossStatistics;
use crate::optimizer::Adam;
use crate::trainer::{Parts, TrainError, Trainer};

const FORMAT: &str = "selvedge-checkpoint";
const VERSION: &str = "1";

/// Why a training cannot be resumed.
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
        "{path} was made on another data set (\"{found}\"; now \"{expected}\"): give that one, or train into a new folder"
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
    lanes: Vec<LaneEntry>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LaneEntry {
    section: Section,
    current: usize,
    run: u32,
}

impl Trainer {
    /// Writes everything that decides how the training goes on.
    ///
    /// # Errors
    /// [`WriteError`]; what was at `path` is then still there.
    pub fn save(&self, path: &Path, dataset: &Dataset) -> Result<(), WriteError> {
        let state = State {
            step: self.step,
            optimizer_steps: self.adam.steps(),
            inputs: self.inputs.clone(),
            targets: self.targets.clone(),
            lanes: self.lanes.iter().map(LaneEntry::of).collect(),
        };
        let histories: Vec<(String, Vec<usize>, Vec<f32>)> = self
            .lanes
            .iter()
            .enumerate()
            .filter(|(_, lane)| !lane.history.is_empty())
            .map(|(number, lane)| {
                let shape = vec![lane.history.len(), lane.history[0].len(), 3];
                let values = lane.history.iter().flatten().flat_map(|p| p.to_array());
                (history_name(number), shape, values.collect())
            })
            .collect();
        let flat = |name, values| TensorOut {
            name,
            shape: vec![self.weights.len()],
            values: TensorValues::F32(values),
        };
        let mut tensors = vec![
            flat("weights", &self.weights),
            flat("first_moment", self.adam.first_moment()),
            flat("second_moment", self.adam.second_moment()),
        ];
        tensors.extend(histories.iter().map(|(name, shape, values)| TensorOut {
            name,
            shape: shape.clone(),
            values: TensorValues::F32(values),
        }));
        let metadata = BTreeMap::from([
            ("format", FORMAT.to_owned()),
            ("version", VERSION.to_owned()),
            ("config", to_json(&self.cfg)),
            ("dataset", fingerprint(dataset)),
            ("state", to_json(&state)),
        ]);
        write_tensors(path, &tensors, &metadata)
    }

    /// Goes on from the checkpoint at `path`. Only `name`, `steps` and `log_every` may differ
    /// from the configuration it was made with.
    ///
    /// # Errors
    /// [`ResumeError`] names the file and what does not fit.
    pub fn resume(cfg: TrainConfig, dataset: &Dataset, path: &Path) -> Result<Self, ResumeError> {
        let bytes = std::fs::read(path).map_err(|source| ResumeError::Read {
            path: path.to_owned(),
            source,
        })?;
        let file = CheckpointFile::open(path, &bytes)?;
        file.check(&cfg, dataset)?;
        let state: State = file.json("state")?;
        let corpus = Corpus::load(dataset).map_err(TrainError::from)?;
        let network = Network::new(&cfg.model).map_err(TrainError::from)?;
        let count = network.parameter_count();
        let moments = [
            file.numbers("first_moment", count)?,
            file.numbers("second_moment", count)?,
        ];
        let [first, second] = moments;
        let adam = Adam::resume(cfg.optimizer, first, second, state.optimizer_steps)
            .map_err(TrainError::from)?;
        if state.lanes.len() != cfg.batch.samples {
            return Err(file.content("state", format!("{} lanes", state.lanes.len())));
        }
        let lanes = state.lanes.iter().enumerate();
        let lanes = lanes.map(|(number, entry)| file.lane(number, entry, &cfg, &corpus));
        let parts = Parts {
            weights: file.numbers("weights", count)?,
            lanes: lanes.collect::<Result<_, _>>()?,
            network,
            adam,
            inputs: state.inputs,
            targets: state.targets,
            step: state.step,
        };
        Ok(Self::assemble(cfg, corpus, parts))
    }
}

impl LaneEntry {
    fn of(lane: &LaneState) -> Self {
        Self {
            section: lane.section,
            current: lane.current,
            run: lane.run,
        }
    }
}

struct CheckpointFile<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
    metadata: std::collections::HashMap<String, String>,
}

impl<'a> CheckpointFile<'a> {
    fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self, ResumeError> {
        let container = |source| ResumeError::Container {
            path: path.to_owned(),
            source,
        };
        let (_, header) = SafeTensors::read_metadata(bytes).map_err(container)?;
        let tensors = SafeTensors::deserialize(bytes).map_err(container)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        for (key, expected) in [("format", FORMAT), ("version", VERSION)] {
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
        let text = self.metadata.get(key).map_or("", String::as_str);
        serde_json::from_str(text).map_err(|error| self.content(key, error))
    }

    /// That the checkpoint was made with this configuration and this data set.
    fn check(&self, cfg: &TrainConfig, dataset: &Dataset) -> Result<(), ResumeError> {
        let path = || self.path.to_owned();
        let made: TrainConfig = self.json("config")?;
        let fields = |cfg: &TrainConfig| match serde_json::to_value(cfg) {
            Ok(serde_json::Value::Object(map)) => map,
            _ => serde_json::Map::new(),
        };
        let (made, now) = (fields(&made), fields(cfg));
        let free = ["name", "steps", "log_every"];
        for (field, expected) in now
            .iter()
            .filter(|(field, _)| !free.contains(&field.as_str()))
        {
            let found = made.get(field).unwrap_or(&serde_json::Value::Null);
            if found != expected {
                return Err(ResumeError::Configuration {
                    path: path(),
                    field: field.clone(),
                    expected: expected.to_string(),
                    found: found.to_string(),
                });
            }
        }
        let (expected, found) = (fingerprint(dataset), self.metadata.get("dataset"));
        if found != Some(&expected) {
            let short = |text: &str| text.split(' ').next().unwrap_or_default().to_owned();
            return Err(ResumeError::Data {
                path: path(),
                expected: short(&expected),
                found: short(found.map_or("", String::as_str)),
            });
        }
        Ok(())
    }

    fn numbers(&self, name: &str, count: usize) -> Result<Vec<f32>, ResumeError> {
        let view = self
            .tensors
            .tensor(name)
            .map_err(|error| self.content(name, error))?;
        if view.dtype() != Dtype::F32 || view.shape().iter().product::<usize>() != count {
            let found = format!(
                "{:?} {:?}, expected {count} × F32",
                view.dtype(),
                view.shape()
            );
            return Err(self.content(name, found));
        }
        let chunks = view.data().as_chunks().0.iter();
        let values: Vec<f32> = chunks.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        match values.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(self.content(name, format!("entry {index} is not finite"))),
            None => Ok(values),
        }
    }

    fn lane(
        &self,
        number: usize,
        entry: &LaneEntry,
        cfg: &TrainConfig,
        corpus: &Corpus,
    ) -> Result<LaneState, ResumeError> {
        let mut history = Vec::new();
        if entry.run > 0 {
            let trajectory = entry.section.trajectory;
            if trajectory >= corpus.trajectory_count()
                || !Corpus::section_has(&entry.section, entry.current)
            {
                return Err(self.content("state", format!("lane {number} is in no section")));
            }
            let vertices = corpus.motion(trajectory).graph.vertex_count();
            let frames = cfg.model.window() + 1;
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
        Ok(LaneState {
            section: entry.section,
            current: entry.current,
            run: entry.run,
            history,
        })
    }
}

fn history_name(lane: usize) -> String {
    format!("lane.{lane}.history")
}

/// What tells one data set from another: its name, and the hashes of what is learned from.
fn fingerprint(dataset: &Dataset) -> String {
    let index = dataset.index();
    let mut text = index.name.clone();
    for entry in &index.splits.train {
        text.push(' ');
        text.push_str(&entry.blake3);
    }
    text.push_str(&format!(" {}", to_json(&index.sections)));
    text
}

fn to_json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}
