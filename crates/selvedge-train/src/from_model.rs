//! Trainings that begin with a finished model.

use std::ops::ControlFlow;

use selvedge_data::Dataset;
use selvedge_model::{Model, RunningStatistics, edge_groups, node_groups};
use serde::Deserialize;

use crate::checkpoint::differences_of_networks;
use crate::config::TrainConfig;
use crate::engine::EngineMaker;
use crate::fit_normalizers::{FitProgress, NormalizerFit, Statistics};
use crate::origin::Origin;
use crate::trainer::{Parts, TrainError, Trainer, prepare};

/// The account of a training, as far as it is one.
#[derive(Default, Deserialize)]
struct Account {
    #[serde(default)]
    config: serde_json::Value,
    #[serde(default)]
    dataset: String,
    #[serde(default)]
    steps_done: u64,
    #[serde(default)]
    from: Vec<Origin>,
}

impl Trainer {
    /// A new training from its first step, but with the weights of `model` and the statistics of
    /// its inputs and its output. What the losses are measured by is from samples of `dataset`;
    /// `observe` hears of each and may stop there, which gives no training. Only the network must
    /// be that of the configuration.
    ///
    /// # Errors
    /// As [`Self::new`], and [`TrainError::OtherModel`].
    pub fn from_model(
        cfg: TrainConfig,
        dataset: &Dataset,
        engine: &dyn EngineMaker,
        model: &Model,
        observe: &mut dyn FnMut(FitProgress) -> ControlFlow<()>,
    ) -> Result<Option<Self>, TrainError> {
        let differences =
            differences_of_networks(model.spec(), &cfg.model).map_err(TrainError::Json)?;
        if !differences.is_empty() {
            return Err(TrainError::OtherModel { differences });
        }
        let (set, network) = prepare(&cfg, dataset, engine.arithmetic())?;
        let Some(fitted) = NormalizerFit::new(&cfg, &set).observed(observe) else {
            return Ok(None);
        };
        let normalizers = model.normalizers();
        let statistics = Statistics {
            inputs: [
                RunningStatistics::of(&normalizers.nodes, &node_groups(&cfg.model)),
                RunningStatistics::of(&normalizers.edges, &edge_groups(&cfg.model)),
            ],
            targets: fitted.targets.with_acceleration(&normalizers.acceleration),
        };
        let weights = model.weights().to_vec();
        let origins = origins(&model.training);
        let parts = Parts::at_first_step(&cfg, network, weights, statistics, origins)?;
        Self::assemble(cfg, set, engine, parts).map(Some)
    }
}

/// The trainings that made a model, by its own account of them.
fn origins(account: &str) -> Vec<Origin> {
    let Account {
        config,
        dataset,
        steps_done,
        from,
    } = serde_json::from_str(account).unwrap_or_default();
    // The whole configuration, or its name alone.
    let name = config.get("name").unwrap_or(&config);
    let mut origins = from;
    origins.push(Origin {
        name: name.as_str().unwrap_or("a model").to_owned(),
        steps_done,
        dataset,
    });
    origins
}

#[cfg(test)]
mod tests;
