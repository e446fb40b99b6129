//! Checkpoints of a training that corrects physics: weights, moments, statistics and the step.
//!
//! Samples and the cloths that make them are not kept: they are hundreds of megabytes, and are made
//! anew in seconds. A training that was interrupted therefore goes on from the same weights with
//! other samples.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use safetensors::{Dtype, SafeTensorError, SafeTensors};
use selvedge_data::{TensorOut, TensorValues, WriteError, read_header, write_tensors};
use selvedge_model::{Network, Normalizer, NormalizerError, Normalizers};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::config::CorrectionConfig;
use super::trainer::{CorrectionTrainError, CorrectionTrainer};
use crate::checkpoint::{ContentProblem, differences};
use crate::engine::Learned;
use crate::optimizer::Adam;

/// Value of the metadata `format` of such a checkpoint.
pub const CORRECTION_FORMAT: &str = "selvedge-correction-checkpoint";
const VERSION: &str = "1";

/// A checkpoint that cannot be written.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum SaveCorrectionError {
    Write(#[from] WriteError),
    Json(#[from] serde_json::Error),
}

/// A training that cannot be resumed.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum ResumeCorrectionError {
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
    #[error(
        "{path}: metadata \"{key}\" is not \"{expected}\": no checkpoint of this kind of training"
    )]
    Metadata {
        path: PathBuf,
        key: &'static str,
        expected: &'static str,
    },
    #[error("{path}: {what}: {problem}")]
    Content {
        path: PathBuf,
        what: &'static str,
        problem: ContentProblem,
    },
    #[error("{path}: statistics: {source}")]
    Statistics {
        path: PathBuf,
        source: NormalizerError,
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
    #[error(transparent)]
    Train(#[from] CorrectionTrainError),
}

/// The part that is JSON.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct State {
    step: u64,
    optimizer_steps: u64,
    /// Means and deviations of node columns, arc columns and targets.
    normalizers: Option<[[Vec<f64>; 2]; 3]>,
}

impl CorrectionTrainer {
    /// Writes a checkpoint.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SaveCorrectionError> {
        let pair = |n: &Normalizer| [n.mean().to_vec(), n.deviation().to_vec()];
        let normalizers = self.normalizers.as_ref();
        let state = State {
            step: self.step,
            optimizer_steps: self.learned.adam.steps(),
            normalizers: normalizers.map(|n| [&n.nodes, &n.edges, &n.acceleration].map(pair)),
        };
        let metadata = BTreeMap::from([
            ("format", CORRECTION_FORMAT.to_owned()),
            ("version", VERSION.to_owned()),
            ("config", serde_json::to_string(&self.cfg)?),
            ("state", serde_json::to_string(&state)?),
        ]);
        let Learned {
            weights,
            averaged,
            adam,
        } = &self.learned;
        let mut tensors = vec![
            ("weights", weights.as_slice()),
            ("first_moment", adam.first_moment()),
            ("second_moment", adam.second_moment()),
        ];
        tensors.extend(averaged.as_ref().map(|mean| ("averaged", mean.as_slice())));
        let out = tensors.iter().map(|(name, values)| TensorOut {
            name,
            shape: vec![values.len()],
            values: TensorValues::F32(values),
        });
        let out: Vec<TensorOut<'_>> = out.collect();
        Ok(write_tensors(path, &out, &metadata)?)
    }

    /// Goes on from the checkpoint at `path`, which was made with `cfg` but for its name, its
    /// length, its log and its samples.
    ///
    /// # Errors
    /// What of the file does not fit.
    pub fn resume(cfg: CorrectionConfig, path: &Path) -> Result<Self, ResumeCorrectionError> {
        cfg.validate().map_err(CorrectionTrainError::from)?;
        let bytes =
            selvedge_data::read_file(path).map_err(|source| ResumeCorrectionError::Read {
                path: path.to_owned(),
                source,
            })?;
        let file = Checkpoint::open(path, &bytes)?;
        file.check(&cfg)?;
        let state: State = file.json("state")?;
        let network = Network::new(&cfg.model).map_err(CorrectionTrainError::from)?;
        let count = network.parameter_count();
        let numbers = |name| file.numbers(name, count);
        let [first, second] = [numbers("first_moment")?, numbers("second_moment")?];
        let adam = Adam::resume(cfg.optimizer, first, second, state.optimizer_steps);
        let learned = Learned {
            weights: numbers("weights")?,
            averaged: match cfg.weight_average {
                Some(_) => Some(numbers("averaged")?),
                None => None,
            },
            adam: adam.map_err(CorrectionTrainError::from)?,
        };
        let mut trainer = Self::with(cfg, network, learned);
        trainer.step = state.step;
        trainer.normalizers = match state.normalizers {
            None => None,
            Some(all) => Some(file.normalizers(all, &trainer.cfg)?),
        };
        Ok(trainer)
    }
}

/// The file of a checkpoint.
struct Checkpoint<'a> {
    path: &'a Path,
    tensors: SafeTensors<'a>,
    metadata: std::collections::HashMap<String, String>,
}

impl<'a> Checkpoint<'a> {
    fn open(path: &'a Path, bytes: &'a [u8]) -> Result<Self, ResumeCorrectionError> {
        let container = |source| ResumeCorrectionError::Container {
            path: path.to_owned(),
            source,
        };
        let header = read_header(bytes).map_err(container)?;
        let metadata = header.metadata().clone().unwrap_or_default();
        for (key, expected) in [("format", CORRECTION_FORMAT), ("version", VERSION)] {
            if metadata.get(key).map(String::as_str) != Some(expected) {
                let path = path.to_owned();
                return Err(ResumeCorrectionError::Metadata {
                    path,
                    key,
                    expected,
                });
            }
        }
        Ok(Self {
            path,
            tensors: SafeTensors::deserialize(bytes).map_err(container)?,
            metadata,
        })
    }

    fn content(
        &self,
        what: &'static str,
        problem: impl Into<ContentProblem>,
    ) -> ResumeCorrectionError {
        ResumeCorrectionError::Content {
            path: self.path.to_owned(),
            what,
            problem: problem.into(),
        }
    }

    fn json<T: DeserializeOwned>(&self, key: &'static str) -> Result<T, ResumeCorrectionError> {
        let text = self.metadata.get(key);
        let text = text.ok_or_else(|| self.content(key, ContentProblem::Missing))?;
        serde_json::from_str(text).map_err(|error| self.content(key, error))
    }

    /// Checks that the checkpoint was made with this configuration.
    fn check(&self, cfg: &CorrectionConfig) -> Result<(), ResumeCorrectionError> {
        let made: CorrectionConfig = self.json("config")?;
        let value = |made: &CorrectionConfig| {
            let free = CorrectionConfig {
                name: String::new(),
                steps: 1,
                log_every: 1,
                samples: cfg.samples,
                ..made.clone()
            };
            serde_json::to_value(free).map_err(|error| self.content("config", error))
        };
        let differences = differences(&value(&made)?, &value(cfg)?);
        match differences.into_iter().next() {
            None => Ok(()),
            Some(first) => Err(ResumeCorrectionError::Configuration {
                path: self.path.to_owned(),
                field: first.path,
                expected: first.now,
                found: first.made,
            }),
        }
    }

    fn numbers(&self, name: &'static str, count: usize) -> Result<Vec<f32>, ResumeCorrectionError> {
        let view = self.tensors.tensor(name);
        let view = view.map_err(|error| self.content(name, error))?;
        if view.dtype() != Dtype::F32 || view.shape() != [count] {
            let problem = ContentProblem::Shape {
                dtype: view.dtype(),
                shape: view.shape().to_vec(),
                expected: count,
            };
            return Err(self.content(name, problem));
        }
        let numbers = view.data().as_chunks().0.iter();
        let numbers: Vec<f32> = numbers.map(|bytes| f32::from_le_bytes(*bytes)).collect();
        match numbers.iter().position(|x| !x.is_finite()) {
            Some(index) => Err(self.content(name, ContentProblem::NonFinite { index })),
            None => Ok(numbers),
        }
    }

    fn normalizers(
        &self,
        all: [[Vec<f64>; 2]; 3],
        cfg: &CorrectionConfig,
    ) -> Result<Normalizers, ResumeCorrectionError> {
        let model = &cfg.model;
        let widths = [model.node_width(), model.edge_width(), model.outputs()];
        let found = all.each_ref().map(|[mean, _]| mean.len());
        if found != widths {
            let (found, expected) = ((found[0], found[1]), (widths[0], widths[1]));
            return Err(self.content("state", ContentProblem::Columns { found, expected }));
        }
        let [nodes, edges, acceleration] = all.map(|[mean, deviation]| {
            let made = Normalizer::new(mean, deviation);
            made.map_err(|source| ResumeCorrectionError::Statistics {
                path: self.path.to_owned(),
                source,
            })
        });
        Ok(Normalizers {
            nodes: nodes?,
            edges: edges?,
            acceleration: acceleration?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correction::learning::tests::sample;
    use crate::correction::trainer::tests::config;

    #[test]
    fn a_training_goes_on_from_its_checkpoint() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.safetensors");
        let mut trainer = CorrectionTrainer::new(config("weight_average = 0.9")).unwrap();
        trainer.add((0..4).map(sample));
        trainer.step().unwrap();
        trainer.save(&path).unwrap();
        let mut longer = config("weight_average = 0.9");
        longer.steps = 1000;
        let back = CorrectionTrainer::resume(longer, &path).unwrap();
        assert_eq!(back.learned, trainer.learned);
        assert_eq!(back.normalizers, trainer.normalizers);
        assert_eq!(back.steps_done(), 1);
        assert!(back.wants_samples());
    }

    #[test]
    fn a_checkpoint_of_another_configuration_names_the_field() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("checkpoint.safetensors");
        CorrectionTrainer::new(config(""))
            .unwrap()
            .save(&path)
            .unwrap();
        let mut other = config("");
        other.teacher.substeps = 7;
        let error = CorrectionTrainer::resume(other, &path).err().unwrap();
        assert!(
            error.to_string().contains("teacher.substeps (2, now 7)"),
            "{error}"
        );
        std::fs::write(&path, b"no").unwrap();
        let error = CorrectionTrainer::resume(config(""), &path).err().unwrap();
        assert!(matches!(error, ResumeCorrectionError::Container { .. }));
    }
}
