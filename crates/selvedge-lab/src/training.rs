//! The beginning of a training, which may be stopped.

use selvedge_data::Dataset;
use selvedge_model::Model;
use selvedge_train::{EngineMaker, Labels, TrainConfig, TrainError, Trainer};

use crate::event::{OnEvent, Reporter};
use crate::expert::{ExpertError, PhysicsExpert};
use crate::models::NamedModel;

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

/// A training at its beginning, with its statistics gathered. None where an end was asked for.
pub fn fresh(
    cfg: TrainConfig,
    data: &Dataset,
    engine: &dyn EngineMaker,
    on_event: &mut OnEvent<'_>,
) -> Result<Option<Trainer>, TrainError> {
    begin(None, cfg, data, engine, &Reporter::new(on_event))
}

/// The same, with the weights and statistics of `model`.
pub fn from_model(
    cfg: TrainConfig,
    data: &Dataset,
    engine: &dyn EngineMaker,
    model: &NamedModel,
    on_event: &mut OnEvent<'_>,
) -> Result<Option<Trainer>, TrainError> {
    let reporter = Reporter::new(on_event);
    begin(Some(&model.model), cfg, data, engine, &reporter)
}

/// Gives `trainer` the physics of `data`, where its configuration asks for expert labels.
pub fn with_expert(trainer: &mut Trainer, data: &Dataset) -> Result<(), ExpertError> {
    if trainer.config().scheduled_sampling.labels == Labels::Expert {
        trainer.ask(Box::new(PhysicsExpert::new(data)?));
    }
    Ok(())
}

/// As [`fresh`], or with a model as [`from_model`], within a longer operation.
pub(crate) fn begin(
    from: Option<&Model>,
    cfg: TrainConfig,
    data: &Dataset,
    engine: &dyn EngineMaker,
    reporter: &Reporter<'_>,
) -> Result<Option<Trainer>, TrainError> {
    let task = reporter.count("gathering statistics", cfg.statistics_samples, "samples");
    let mut observe = || task.advance();
    let Some(model) = from else {
        return Trainer::new_observed(cfg, data, engine, &mut observe);
    };
    let trainer = Trainer::from_model(cfg, data, engine, model, &mut observe)?;
    trainer.iter().for_each(say_what_is_fresh);
    Ok(trainer)
}
