//! The loop of a training that corrects physics: samples where they are due, steps, lines of the
//! log and checkpoints, until the last step, a time limit or a stop of the caller.

use std::error::Error;
use std::io::Write;
use std::ops::ControlFlow;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use selvedge_data::{WriteError, write_atomically};
use selvedge_model::{Domain, Model, ModelFileError};
use serde::Serialize;
use thiserror::Error;

use super::checkpoint::SaveCorrectionError;
use super::store::CorrectionSample;
use super::trainer::{CorrectionReport, CorrectionTrainError, CorrectionTrainer};
use crate::run::{LogError, RunEnd, RunLimits, append_line, files, trim_log};

/// A maker of samples: cloths that move by cheap physics, corrected or not, and a teacher.
pub trait SampleSource {
    /// Moves every cloth by a frame and returns their samples. With a `model` the cloths may go on
    /// from its own frames, up to `own_frames` in a row with the one that the sample is of. None
    /// where an end was asked for meanwhile.
    ///
    /// # Errors
    /// What went wrong, for people.
    fn samples(
        &mut self,
        model: Option<&Arc<Model>>,
        own_frames: usize,
    ) -> Result<Option<Vec<CorrectionSample>>, Box<dyn Error + Send + Sync>>;

    /// Cloths that were begun anew so far, because a run went astray.
    fn gone_astray(&self) -> u64;

    /// The domain of the samples; none where it is not known.
    fn domain(&self) -> Option<&Domain>;
}

/// A training that failed; an earlier checkpoint is still whole.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum RunCorrectionError {
    Train(#[from] CorrectionTrainError),
    #[error("making samples: {0}")]
    Samples(Box<dyn Error + Send + Sync>),
    Save(#[from] SaveCorrectionError),
    Write(#[from] WriteError),
    Log(#[from] LogError),
    #[error("the configuration cannot be written as TOML: {0}")]
    Config(#[from] toml::ser::Error),
    #[error("the account of the training cannot be written: {0}")]
    Account(#[from] serde_json::Error),
    #[error("the model cannot be written: {0}")]
    Model(#[from] ModelFileError),
}

/// Progress of a training.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CorrectionEvent {
    /// Samples were made: so many of those that the first step needs are there.
    Samples(usize),
    /// A step was made.
    Step(CorrectionReport),
}

/// A line of the log.
#[derive(Serialize)]
struct LogLine {
    step: u64,
    loss: f64,
    gradient_norm: f64,
    learning_rate: f64,
    own_frames: usize,
    samples: u64,
    gone_astray: u64,
}

/// Trains until the last step, a limit, or until `observe` breaks; it is called after each step and
/// whenever samples were made. A step that is given up ends the run too
/// ([`CorrectionTrainer::stop_by`]), and so do samples that are.
///
/// # Errors
/// [`RunCorrectionError`]; a checkpoint that was there is then whole.
pub fn run_correction(
    trainer: &mut CorrectionTrainer,
    source: &mut dyn SampleSource,
    folder: &Path,
    limits: RunLimits,
    observe: &mut dyn FnMut(CorrectionEvent) -> ControlFlow<()>,
) -> Result<RunEnd, RunCorrectionError> {
    let log = folder.join(files::LOG);
    trim_log(&log, trainer.steps_done())?;
    let text = toml::to_string(trainer.config())?;
    write_atomically(&folder.join(files::CONFIG), |out| {
        out.write_all(text.as_bytes())
    })?;
    let (started, mut saved) = (Instant::now(), Instant::now());
    let mut since_line = Vec::new();
    let end = loop {
        if trainer.steps_done() >= trainer.config().steps {
            break RunEnd::Finished;
        }
        if limits.time.is_some_and(|time| started.elapsed() >= time) {
            break RunEnd::TimeUp;
        }
        if trainer.wants_samples() {
            if make_samples(trainer, source)?.is_break() {
                break RunEnd::Stopped;
            }
            let made = usize::try_from(trainer.samples_made()).unwrap_or(usize::MAX);
            if observe(CorrectionEvent::Samples(made)).is_break() {
                break RunEnd::Stopped;
            }
            continue;
        }
        let report = match trainer.step() {
            Ok(report) => report,
            Err(CorrectionTrainError::Stopped { .. }) => break RunEnd::Stopped,
            Err(error) => return Err(error.into()),
        };
        since_line.push(report);
        if report.step.is_multiple_of(trainer.config().log_every) {
            append_line(&log, &line(&since_line, trainer, source))?;
            since_line.clear();
        }
        if saved.elapsed() >= limits.checkpoint_every {
            save(trainer, source.domain(), folder)?;
            saved = Instant::now();
        }
        if observe(CorrectionEvent::Step(report)).is_break() {
            break RunEnd::Stopped;
        }
    };
    if trainer.steps_done() > 0 {
        save(trainer, source.domain(), folder)?;
    }
    Ok(end)
}

/// Breaks where an end was asked for.
fn make_samples(
    trainer: &mut CorrectionTrainer,
    source: &mut dyn SampleSource,
) -> Result<ControlFlow<()>, RunCorrectionError> {
    let own_frames = trainer.config().own_frames.at(trainer.steps_done());
    let model = match own_frames {
        1 => None,
        _ => trainer.model(String::new())?.map(Arc::new),
    };
    let samples = source.samples(model.as_ref(), own_frames);
    let Some(samples) = samples.map_err(RunCorrectionError::Samples)? else {
        return Ok(ControlFlow::Break(()));
    };
    trainer.add(samples);
    Ok(ControlFlow::Continue(()))
}

/// Writes checkpoint and model. The model comes first into memory: it refuses weights that are not
/// finite, and they must not replace a good checkpoint.
fn save(
    trainer: &CorrectionTrainer,
    domain: Option<&Domain>,
    folder: &Path,
) -> Result<(), RunCorrectionError> {
    let mut account = serde_json::json!({
        "config": trainer.config(),
        "steps_done": trainer.steps_done(),
    });
    if let Some(domain) = domain {
        account["domain"] = serde_json::json!(domain);
    }
    let Some(model) = trainer.model(account.to_string())? else {
        return Ok(());
    };
    let bytes = model.to_bytes()?;
    trainer.save(&folder.join(files::CHECKPOINT))?;
    write_atomically(&folder.join(files::MODEL), |out| out.write_all(&bytes))?;
    Ok(())
}

/// The means of steps in a row, with number and rate of the last.
fn line(
    steps: &[CorrectionReport],
    trainer: &CorrectionTrainer,
    source: &dyn SampleSource,
) -> LogLine {
    let count = steps.len().max(1) as f64;
    let mean = |of: fn(&CorrectionReport) -> f64| steps.iter().map(of).sum::<f64>() / count;
    LogLine {
        step: trainer.steps_done(),
        loss: mean(|step| step.loss),
        gradient_norm: mean(|step| step.gradient_norm),
        learning_rate: steps.last().map_or(0.0, |step| step.learning_rate),
        own_frames: trainer.config().own_frames.at(trainer.steps_done()),
        samples: trainer.samples_made(),
        gone_astray: source.gone_astray(),
    }
}
