//! Checkpoints: all that decides how a training goes on, in one `.safetensors` file, so that a
//! resumed training continues bit for bit.

mod differences;
mod error;
mod file;

use std::collections::BTreeMap;
use std::path::Path;

use selvedge_data::{Dataset, TensorOut, TensorValues, WriteError, write_tensors};

pub(crate) use self::differences::differences_but_encoder;
pub use self::error::ResumeError;
pub use self::file::CHECKPOINT_FORMAT;
use self::file::{CheckpointFile, State, VERSION, history_name};
use crate::config::TrainConfig;
use crate::engine::{EngineMaker, Learned};
use crate::trainer::{TrainError, Trainer, prepare};

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
        let state = State {
            step: self.step,
            optimizer_steps: self.learned.adam.steps(),
            inputs: self.inputs.clone(),
            targets: self.targets.clone(),
            slots: self.slots.clone(),
            origins: self.origins.clone(),
            since_line: self.since_line.clone(),
        };
        let metadata = BTreeMap::from([
            ("format", CHECKPOINT_FORMAT.to_owned()),
            ("version", VERSION.to_owned()),
            ("config", json(serde_json::to_string(&self.cfg))?),
            ("dataset", self.set.fingerprint.clone()),
            ("state", json(serde_json::to_string(&state))?),
        ]);
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
        let histories = self.histories();
        let flat = flat.into_iter().map(|(name, values)| {
            TensorOut::new(name, &[values.len()], TensorValues::F32(values.into()))
        });
        let of_slots = histories.iter().map(|(name, shape, values)| {
            TensorOut::new(name, shape, TensorValues::F32(values.into()))
        });
        let tensors: Vec<TensorOut<'_>> = flat.chain(of_slots).collect();
        write_tensors(path, &tensors, &metadata)
    }

    /// Name, shape and numbers of the history of each slot that is in a run.
    fn histories(&self) -> Vec<(String, Vec<usize>, Vec<f32>)> {
        let slots = self.slots.iter().enumerate();
        slots
            .filter(|(_, slot)| !slot.history.is_empty())
            .map(|(number, slot)| {
                let shape = vec![slot.history.len(), slot.history[0].len(), 3];
                let values = slot.history.iter().flat_map(|frame| frame.iter());
                let values = values.flat_map(|p| p.to_array());
                (history_name(number), shape, values.collect())
            })
            .collect()
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
        let (set, network) = prepare(&cfg, dataset, engine.arithmetic())?;
        file.check_data(&set)?;
        let parts = file.parts(&cfg, &set, network)?;
        Ok(Self::assemble(cfg, set, engine, parts)?)
    }
}

#[cfg(test)]
mod tests;
