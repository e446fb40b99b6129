//! The beginning of a training, which may be stopped.

use std::path::Path;

use anyhow::{Result, anyhow, bail};
use selvedge_data::Dataset;
use selvedge_model::Model;
use selvedge_train::{EngineMaker, Labels, Setting, TrainConfig, Trainer};

use crate::assets;
use crate::event::{OnEvent, Reporter};
use crate::expert::PhysicsExpert;

/// The configuration that is called `name`, a shipped one or a file, with the changes of `settings`
/// and, where they are given, so many `steps`.
pub fn config(name: &str, settings: &[Setting], steps: Option<u64>) -> Result<TrainConfig> {
    let text = match assets::training(name) {
        Some(text) => text.to_owned(),
        None if !Path::new(name).exists() => {
            let known: Vec<&str> = assets::TRAININGS.iter().map(|entry| entry.0).collect();
            bail!(
                "{name}: is neither a file nor a shipped configuration; shipped are {}",
                known.join(", ")
            )
        }
        None => selvedge_data::read_text(Path::new(name))
            .map_err(|error| anyhow!("cannot read {name}: {error}"))?,
    };
    let mut cfg = TrainConfig::parse_with(&text, name.as_ref(), settings)?;
    cfg.steps = steps.unwrap_or(cfg.steps);
    Ok(cfg)
}

/// Says which weights begin with random numbers although the training began with a model.
fn say_what_is_fresh(trainer: &Trainer) {
    let fresh = trainer.fresh_tensors();
    if fresh.is_empty() {
        return;
    }
    let all = trainer.tensor_count();
    tracing::warn!(
        "{} of {all} tensors are as they were there; new, with random numbers: {}",
        all - fresh.len(),
        fresh.join(", ")
    );
}

/// A training at its beginning, with its statistics gathered; or with the weights and statistics of
/// the model `from`. None where an end was asked for.
pub fn begin(
    from: Option<&Model>,
    cfg: TrainConfig,
    data: &Dataset,
    engine: &dyn EngineMaker,
    on_event: &mut OnEvent<'_>,
) -> Result<Option<Trainer>> {
    let reporter = Reporter::new(on_event);
    let task = reporter.count("gathering statistics", cfg.statistics_samples, "samples");
    let mut observe = || task.advance();
    let trainer = Trainer::begin(cfg, data, engine, from, &mut observe)?;
    trainer.iter().for_each(say_what_is_fresh);
    Ok(trainer)
}

/// Gives `trainer` the physics of `data`, where its configuration asks for expert labels.
pub fn with_expert(trainer: &mut Trainer, data: &Dataset) -> Result<()> {
    if trainer.config().scheduled_sampling.labels == Labels::Expert {
        trainer.ask(Box::new(PhysicsExpert::new(data)?));
    }
    Ok(())
}
