//! Trainings that begin with a finished model.

use std::ops::ControlFlow;

use selvedge_data::Dataset;
use selvedge_model::{Model, Network, RunningStatistics, edge_groups, node_groups};
use serde::{Deserialize, Serialize};

use crate::checkpoint::differences_but_encoder;
use crate::config::TrainConfig;
use crate::engine::{EngineMaker, Learned};
use crate::trainer::{TrainError, Trainer, first_state, first_weights, prepare};

/// A training whose weights another one began with.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Origin {
    /// The name of its configuration.
    pub name: String,
    /// Its steps by then.
    pub steps_done: u64,
    /// The name of its data set.
    pub dataset: String,
}

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
    /// `observe` is called after each and may stop there, which gives no training. Only the network must
    /// be that of the configuration, except its encoder: weights that the model has none for are
    /// fresh ([`Self::fresh_tensors`]).
    pub fn from_model(
        cfg: TrainConfig,
        dataset: &Dataset,
        engine: &dyn EngineMaker,
        model: &Model,
        observe: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Result<Option<Self>, TrainError> {
        let differences =
            differences_but_encoder(model.spec(), &cfg.model).map_err(TrainError::Json)?;
        if !differences.is_empty() {
            return Err(TrainError::OtherModel { differences });
        }
        let (set, network) = prepare(&cfg, dataset, engine.micro_batch())?;
        let Some(mut state) = first_state(&cfg, &set, observe) else {
            return Ok(None);
        };
        let normalizers = model.normalizers();
        state.inputs = [
            RunningStatistics::of(&normalizers.nodes, &node_groups(&cfg.model)),
            RunningStatistics::of(&normalizers.edges, &edge_groups(&cfg.model)),
        ];
        state.targets = state.targets.with_acceleration(&normalizers.acceleration);
        state.origins = origins(&model.training);
        let of_model = Network::new(model.spec())?;
        let (weights, fresh) = taken(&cfg, &network, &of_model, model.weights());
        let learned = Learned::first(&cfg, weights)?;
        let mut trainer = Self::assemble((cfg, set, network), engine, learned, state)?;
        trainer.fresh_tensors = fresh;
        Ok(Some(trainer))
    }
}

/// The weights of `network`: those of `other` where that has a tensor of the same name and shape,
/// else as a training that begins with nothing has them; and the names of the latter.
fn taken(
    cfg: &TrainConfig,
    network: &Network,
    other: &Network,
    other_weights: &[f32],
) -> (Vec<f32>, Vec<String>) {
    let mut weights = first_weights(cfg, network);
    let mut fresh = Vec::new();
    for parameter in network.parameters() {
        let same = other
            .parameters()
            .iter()
            .find(|theirs| (&theirs.name, &theirs.shape) == (&parameter.name, &parameter.shape));
        match same {
            Some(theirs) => weights[parameter.range.clone()]
                .copy_from_slice(&other_weights[theirs.range.clone()]),
            None => fresh.push(parameter.name.clone()),
        }
    }
    (weights, fresh)
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
