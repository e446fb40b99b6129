//! The beginning of a training, which may be stopped.

use selvedge_data::Dataset;
use selvedge_train::{EngineMaker, TrainConfig, TrainError, Trainer};

use crate::event::{OnEvent, Reporter};
use crate::models::NamedModel;

/// Says whose mirror images are not learned from, where there are some.
pub fn warn_of_data(trainer: &Trainer) {
    let left_out = trainer.images_left_out();
    if !left_out.is_empty() {
        tracing::warn!(
            "mirror_images: not of {}, whose handles would go as in a motion to test on",
            left_out.join(", ")
        );
    }
}

/// A training at its beginning, with its statistics gathered. None where an end was asked for.
///
/// # Errors
/// What of the configuration or the data went wrong.
pub fn fresh(
    cfg: TrainConfig,
    data: &Dataset,
    engine: &dyn EngineMaker,
    on_event: &mut OnEvent<'_>,
) -> Result<Option<Trainer>, TrainError> {
    begin(cfg, data, engine, &Reporter::new(on_event))
}

/// The same, with the weights and statistics of `model`.
///
/// # Errors
/// As [`fresh`], and where the configuration is of another network.
pub fn from_model(
    cfg: TrainConfig,
    data: &Dataset,
    engine: &dyn EngineMaker,
    model: &NamedModel,
    on_event: &mut OnEvent<'_>,
) -> Result<Option<Trainer>, TrainError> {
    let reporter = Reporter::new(on_event);
    let task = reporter.count("gathering statistics", cfg.statistics_samples, "samples");
    Trainer::from_model(cfg, data, engine, &model.model, &mut |_| task.advance())
}

/// As [`fresh`], within a longer operation.
pub(crate) fn begin(
    cfg: TrainConfig,
    data: &Dataset,
    engine: &dyn EngineMaker,
    reporter: &Reporter<'_>,
) -> Result<Option<Trainer>, TrainError> {
    let task = reporter.count("gathering statistics", cfg.statistics_samples, "samples");
    Trainer::new_observed(cfg, data, engine, &mut |_| task.advance())
}
