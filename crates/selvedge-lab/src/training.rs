//! The beginning of a training, which may be stopped.

use anyhow::Result;
use selvedge_data::Dataset;
use selvedge_model::Model;
use selvedge_train::{EngineMaker, Labels, TrainConfig, Trainer};

use crate::event::{OnEvent, Reporter};
use crate::expert::PhysicsExpert;

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
