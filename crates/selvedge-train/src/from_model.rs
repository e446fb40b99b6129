//! Trainings that begin with a finished model.

use selvedge_model::{Model, Network, OUTPUTS, RunningStatistics, edge_groups, node_groups};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::checkpoint::{State, differences_but_encoder};
use crate::config::TrainConfig;
use crate::trainer::TrainError;

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

/// Checks that the network of `model` is that of the configuration, except its encoder.
pub(crate) fn check_model(cfg: &TrainConfig, model: &Model) -> Result<(), TrainError> {
    let differences = differences_but_encoder(model.spec(), &cfg.model);
    match differences.map_err(TrainError::Json)? {
        differences if differences.is_empty() => Ok(()),
        differences => Err(TrainError::OtherModel { differences }),
    }
}

/// Gives a training the statistics of `model`, the trainings that made it, and its weights where
/// `network` has a tensor of the same name and shape. Returns the names of those that stay as they
/// are.
pub(crate) fn take_model(
    model: &Model,
    cfg: &TrainConfig,
    state: &mut State,
    network: &Network,
    weights: &mut [f32],
) -> Result<Vec<String>, TrainError> {
    let normalizers = model.normalizers();
    state.inputs = [
        RunningStatistics::of(&normalizers.nodes, &node_groups(&cfg.model)),
        RunningStatistics::of(&normalizers.edges, &edge_groups(&cfg.model)),
    ];
    state.targets.acceleration = RunningStatistics::of(&normalizers.acceleration, &[OUTPUTS]);
    state.origins = origins(&model.training);
    let of_model = Network::new(model.spec())?;
    let mut fresh = Vec::new();
    for parameter in network.parameters() {
        let mut all = of_model.parameters().iter();
        match all.find(|own| (&own.name, &own.shape) == (&parameter.name, &parameter.shape)) {
            Some(own) => weights[parameter.range.clone()]
                .copy_from_slice(&model.weights()[own.range.clone()]),
            None => fresh.push(parameter.name.clone()),
        }
    }
    Ok(fresh)
}

/// The trainings that made a model, by its own account of them, as far as it is one.
fn origins(account: &str) -> Vec<Origin> {
    let account: Value = serde_json::from_str(account).unwrap_or_default();
    let config = &account["config"];
    // The whole configuration, or its name alone.
    let name = config.get("name").unwrap_or(config);
    let from = serde_json::from_value(account["from"].clone());
    let mut origins: Vec<Origin> = from.unwrap_or_default();
    origins.push(Origin {
        name: name.as_str().unwrap_or("a model").to_owned(),
        steps_done: account["steps_done"].as_u64().unwrap_or_default(),
        dataset: account["dataset"].as_str().unwrap_or_default().to_owned(),
    });
    origins
}

#[cfg(test)]
mod tests;
