//! The training loop: steps, lines of the log and checkpoints, until the last step, a time limit or
//! a stop of the caller.
//!
//! The folder holds `config.toml` (resolved), `log.jsonl` (a line every `log_every` steps),
//! `checkpoint.safetensors` (to go on from) and `model.safetensors` (to use), each written whole.
//!
//! Of several ranks the first one writes, and all go through the same steps: whether to stop and
//! when to write is agreed on after each.

use std::fs::OpenOptions;
use std::io::{ErrorKind, Write};
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use selvedge_data::{WriteError, write_atomically};
use selvedge_model::ModelFileError;
use serde::Serialize;
use thiserror::Error;

use crate::losses::LossTerms;
use crate::trainer::{StepReport, TrainError, Trainer};

/// File names in the folder of a training.
pub mod files {
    /// The checkpoint, to resume from.
    pub const CHECKPOINT: &str = "checkpoint.safetensors";
    /// The model, for rollouts.
    pub const MODEL: &str = "model.safetensors";
    /// One JSON object per line.
    pub const LOG: &str = "log.jsonl";
    /// The resolved configuration.
    pub const CONFIG: &str = "config.toml";
}

/// Limits of a run besides its last step, and the time between checkpoints.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct RunLimits {
    /// Stop cleanly after this time.
    pub time: Option<Duration>,
    /// Time between checkpoints.
    pub checkpoint_every: Duration,
}

/// The end of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RunEnd {
    /// All steps are done.
    Finished,
    /// The time was up.
    TimeUp,
    /// The observer said stop.
    Stopped,
}

/// A run that failed; an earlier checkpoint is still whole.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum RunError {
    #[error("{source}; {}", words(.kept.as_deref()))]
    Train {
        source: TrainError,
        /// The checkpoint of an earlier step, whole.
        kept: Option<PathBuf>,
    },
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("the log {path} cannot be kept: {source}")]
    Log {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("the configuration cannot be written as TOML: {0}")]
    Config(#[from] toml::ser::Error),
    #[error("the model cannot be written: {0}")]
    Model(#[from] ModelFileError),
}

fn words(kept: Option<&Path>) -> String {
    match kept {
        Some(path) => format!("{} is of an earlier step and whole", path.display()),
        None => "there is no checkpoint yet".to_owned(),
    }
}

#[derive(Serialize)]
struct LogLine {
    step: u64,
    loss: f64,
    acceleration: f64,
    kinetic_energy: Option<f64>,
    edge_vector: Option<f64>,
    edge_length: Option<f64>,
    bending_angle: Option<f64>,
    gradient_norm: f64,
    learning_rate: f64,
    truth_probability: f64,
    frames: usize,
}

/// Trains until the last step, a limit, or until `observe` breaks; it is called after each step. A
/// step that is given up ([`Trainer::stop_by`]) ends the run too.
///
/// # Errors
/// [`RunError`]; a checkpoint that was there is then whole.
pub fn run(
    trainer: &mut Trainer,
    folder: &Path,
    limits: RunLimits,
    observe: &mut dyn FnMut(&StepReport) -> ControlFlow<()>,
) -> Result<RunEnd, RunError> {
    let log_path = folder.join(files::LOG);
    let writes = trainer.ranks().is_first();
    if writes {
        trim_log(&log_path, trainer.steps_done())?;
        write_config(trainer, folder)?;
    }
    let started = Instant::now();
    let mut saved = Instant::now();
    let is_over = || limits.time.is_some_and(|time| started.elapsed() >= time);
    let begin = Wishes {
        end: is_over(),
        ..Wishes::default()
    };
    let mut agreed = agree(trainer, folder, begin)?;
    let end = loop {
        if trainer.steps_done() >= trainer.config().steps {
            break RunEnd::Finished;
        }
        if agreed.end {
            break RunEnd::TimeUp;
        }
        let report = match trainer.step() {
            Ok(report) => report,
            Err(TrainError::Stopped { .. }) => break RunEnd::Stopped,
            Err(source) => return Err(failed(folder, source)),
        };
        let flow = observe(&report);
        trainer.state.since_line.push(report);
        if trainer
            .steps_done()
            .is_multiple_of(trainer.config().log_every)
        {
            if writes {
                append(&log_path, &trainer.state.since_line)?;
            }
            trainer.state.since_line.clear();
        }
        let wishes = Wishes {
            stop: flow.is_break(),
            save: saved.elapsed() >= limits.checkpoint_every,
            end: is_over(),
        };
        agreed = agree(trainer, folder, wishes)?;
        if agreed.save {
            save(trainer, folder)?;
            saved = Instant::now();
        }
        if agreed.stop {
            break RunEnd::Stopped;
        }
    };
    save(trainer, folder)?;
    Ok(end)
}

/// Wishes of a rank after a step.
#[derive(Clone, Copy, Default)]
struct Wishes {
    stop: bool,
    /// To write a checkpoint.
    save: bool,
    /// To end, since the time is up.
    end: bool,
}

/// Agrees on what all ranks do next: rank 0 says whether time is up and a checkpoint is due, and
/// any of them may stop.
fn agree(trainer: &Trainer, folder: &Path, own: Wishes) -> Result<Wishes, RunError> {
    if !trainer.ranks().are_several() {
        return Ok(own);
    }
    let bits = [own.stop, own.save, own.end].map(u8::from).to_vec();
    let all = trainer.ranks().gather_for_all(bits);
    let all = all.map_err(|error| failed(folder, error.into()))?;
    let of_first = |wish: usize| all[0].get(wish) == Some(&1);
    Ok(Wishes {
        stop: all.iter().any(|bits| bits.first() == Some(&1)),
        save: of_first(1),
        end: of_first(2),
    })
}

fn failed(folder: &Path, source: TrainError) -> RunError {
    let kept = Some(folder.join(files::CHECKPOINT)).filter(|path| path.is_file());
    RunError::Train { source, kept }
}

/// Writes checkpoint and model. The model comes first into memory: it refuses weights that are not
/// finite, and they must not replace a good checkpoint.
fn save(trainer: &mut Trainer, folder: &Path) -> Result<(), RunError> {
    trainer.collect().map_err(|source| failed(folder, source))?;
    if !trainer.ranks().is_first() {
        return Ok(());
    }
    let mut domain = trainer.domain().clone();
    domain.contact &= trainer.config().model.sees_bodies();
    let mut account = serde_json::json!({
        "config": trainer.config(),
        "steps_done": trainer.steps_done(),
        "dataset": trainer.dataset_name(),
        "domain": domain,
    });
    if !trainer.origins().is_empty() {
        account["from"] = serde_json::json!(trainer.origins());
    }
    let model = trainer.model(account.to_string());
    let bytes = model.map_err(|source| failed(folder, source))?.to_bytes()?;
    trainer.save(&folder.join(files::CHECKPOINT))?;
    write_atomically(&folder.join(files::MODEL), |out| out.write_all(&bytes))?;
    Ok(())
}

fn write_config(trainer: &Trainer, folder: &Path) -> Result<(), RunError> {
    let text = toml::to_string(trainer.config())?;
    write_atomically(&folder.join(files::CONFIG), |out| {
        out.write_all(text.as_bytes())
    })?;
    Ok(())
}

impl LogLine {
    /// The means of steps in a row, with number and rates of the last.
    fn of(steps: &[StepReport]) -> Option<Self> {
        let last = steps.last()?;
        let LossTerms {
            total,
            acceleration,
            kinetic_energy,
            edge_vector,
            edge_length,
            bending_angle,
        } = LossTerms::mean(steps.iter().map(|step| &step.terms));
        let norms: f64 = steps.iter().map(|step| step.gradient_norm).sum();
        Some(Self {
            step: last.step,
            loss: total,
            acceleration,
            kinetic_energy,
            edge_vector,
            edge_length,
            bending_angle,
            gradient_norm: norms / steps.len() as f64,
            learning_rate: last.learning_rate,
            truth_probability: last.truth_probability,
            frames: last.frames,
        })
    }
}

/// Appends the line of these steps to a log.
fn append(path: &Path, steps: &[StepReport]) -> Result<(), RunError> {
    let Some(line) = LogLine::of(steps) else {
        return Ok(());
    };
    let written = serde_json::to_string(&line)
        .map_err(std::io::Error::from)
        .and_then(|text| {
            let mut file = OpenOptions::new().create(true).append(true).open(path)?;
            file.write_all(format!("{text}\n").as_bytes())
        });
    written.map_err(|source| RunError::Log {
        path: path.to_owned(),
        source,
    })
}

/// Drops the lines of steps that a resumed training will do again, and a line cut short.
fn trim_log(path: &Path, steps_done: u64) -> Result<(), RunError> {
    let text = match selvedge_data::read_text(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(()),
        Err(source) => {
            let path = path.to_owned();
            return Err(RunError::Log { path, source });
        }
    };
    let step_of = |line: &str| -> Option<u64> {
        let value: serde_json::Value = serde_json::from_str(line).ok()?;
        value.get("step")?.as_u64()
    };
    let mut kept = String::new();
    for line in text.lines() {
        if step_of(line).is_some_and(|step| step <= steps_done) {
            kept.push_str(line);
            kept.push('\n');
        }
    }
    let written = write_atomically(path, |out| out.write_all(kept.as_bytes()));
    written.map_err(|error| RunError::Log {
        path: error.path,
        source: error.source,
    })
}

#[cfg(test)]
mod tests;
