//! The trainings of a study: each in a folder of its own, with a record of what it was made from
//! and how far it is. A finished one is kept, one under way goes on from its checkpoint.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use anyhow::{Context, Result, anyhow, bail};
use selvedge_train::{RunEnd, RunLimits, TrainConfig, Trainer, files};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::file::{Budget, Finished, Training};
use super::{StudyData, StudyRun, hash_of, read_kept, write_kept};
use crate::event::{Goal, Task};
use crate::folder::{FolderKind, TRAININGS};
use crate::{folder, training};

/// Between two checkpoints; a training that is limited in time also notes its time so often.
const CHECKPOINT_EVERY: Duration = Duration::from_secs(120);

/// Samples that go through the network together on the processor.
const MICRO_BATCH: usize = 1;

/// The progress of a training, and its inputs.
#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct Record {
    config: Value,
    /// Hash of the data set's index.
    data: String,
    budget: Budget,
    after: Option<After>,
    /// The device at its beginning; by default `cpu`.
    #[serde(default = "super::processor")]
    pub(super) device: String,
    /// Steps in all, with those of the training that this one goes on from.
    pub(super) steps_done: u64,
    /// Time that it took, without that of the training that this one goes on from `[s]`.
    pub(super) seconds: f64,
    /// Weights.
    pub(super) parameters: usize,
    /// Hash of the finished model; none until it is.
    model: Option<String>,
}

impl Record {
    /// Its steps per second, without those of the training that it goes on from.
    pub(super) fn rate(&self) -> f64 {
        let before = self.after.as_ref().map_or(0, |after| after.steps);
        self.steps_done.saturating_sub(before) as f64 / self.seconds.max(1e-9)
    }
}

/// The training that another one goes on from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct After {
    name: String,
    /// Hash of its model.
    model: String,
    /// Its steps, and those before it; 0 where the training only begins with its weights.
    steps: u64,
}

/// Fails where a finished model is gone or another one: before any work is done.
pub(super) fn check_kept(run: &StudyRun<'_>) -> Result<()> {
    for entry in &run.order.study.train {
        let folder = folder(run, &entry.name);
        if read_kept::<Record>(&folder.join(RECORD))?.is_some_and(|record| record.model.is_some()) {
            finished_model(run, entry)?;
        }
    }
    run.order
        .study
        .model
        .iter()
        .try_for_each(|entry| model_file(run, entry).map(drop))
}

/// The file of a model that is there already, and its hash.
pub(super) fn model_file(run: &StudyRun<'_>, entry: &Finished) -> Result<(PathBuf, String)> {
    let path = run.order.study.folder.join(&entry.file);
    let hash = hash_of(&path).with_context(|| {
        format!(
            "model {:?} of the study has vanished: train it again to {}, or remove the entry from the study",
            entry.name,
            path.display()
        )
    })?;
    Ok((path, hash))
}

/// The file of a model whose training is finished, and its hash.
pub(super) fn finished_model(run: &StudyRun<'_>, entry: &Training) -> Result<(PathBuf, String)> {
    let folder = folder(run, &entry.name);
    let path = folder.join(files::MODEL);
    let remedy = || {
        format!(
            "remove the folder {} to train it again, or remove the entry from the study",
            folder.display()
        )
    };
    let name = &entry.name;
    if !path.is_file() {
        bail!(
            "training {name:?} is finished, but its model {} has vanished: {}",
            path.display(),
            remedy()
        );
    }
    let hash = hash_of(&path)?;
    let record: Option<Record> = read_kept(&folder.join(RECORD))?;
    if record.and_then(|record| record.model).as_ref() != Some(&hash) {
        bail!(
            "training {name:?} is finished, but its model {} is another one by now: {}",
            path.display(),
            remedy()
        );
    }
    Ok((path, hash))
}

/// Trains `entry`, or goes on with it, or finds it finished. None where an end was asked for.
pub(super) fn train(run: &StudyRun<'_>, entry: &Training) -> Result<Option<Record>> {
    let data = run.data(run.order.study.data_of(entry)?)?;
    let mut cfg = run.order.study.config(entry)?;
    let after = after(run, entry)?;
    if let Budget::Steps(steps) = run.order.study.budget(entry)? {
        cfg.steps = steps + after.as_ref().map_or(0, |after| after.steps);
    }
    let folder = folder(run, &entry.name);
    let _claimed = folder::claim_folder(&folder, FolderKind::Training)?;
    let path = folder.join(RECORD);
    if folder.join(files::CHECKPOINT).is_file() && !path.is_file() {
        bail!(
            "{}: there is a checkpoint, but no {RECORD} that says what it was made from and how long it was \
             trained: remove the folder to train again",
            folder.display()
        );
    }
    let mut record = record(run, entry, after, &cfg, data)?;
    if record.model.is_some() {
        return Ok(Some(record));
    }
    let Some(mut trainer) = trainer(run, entry, record.after.as_ref(), cfg, data)? else {
        return Ok(None);
    };
    record.parameters = trainer.parameter_count();
    write_kept(&path, &record)?;
    let task = begin(run, &entry.name, &trainer, &record);
    loop {
        let end = slice(&mut trainer, &folder, &mut record, &task)?;
        let is_last = match (end, record.budget) {
            (RunEnd::Stopped, _) => false,
            (RunEnd::Finished, _) => true,
            (RunEnd::TimeUp, Budget::Time(time)) => record.seconds >= time.as_secs_f64(),
            (RunEnd::TimeUp, Budget::Steps(_)) => false,
        };
        if is_last {
            record.model = Some(hash_of(&folder.join(files::MODEL))?);
        }
        write_kept(&path, &record)?;
        if is_last {
            return Ok(Some(record));
        }
        if end == RunEnd::Stopped {
            return Ok(None);
        }
    }
}

/// The finished training that `entry` goes on from.
fn after(run: &StudyRun<'_>, entry: &Training) -> Result<Option<After>> {
    let Some(name) = &entry.after else {
        return Ok(None);
    };
    let path = folder(run, name).join(RECORD);
    let record = read_kept::<Record>(&path)?;
    let finished = record.and_then(|record| Some((record.model?, record.steps_done)));
    let (model, steps) = finished.ok_or_else(|| {
        let path = path.display();
        anyhow!("{path}: training {name:?} is not finished")
    })?;
    let before = run
        .order
        .study
        .train
        .iter()
        .find(|entry| entry.name == *name);
    let continues = match before {
        Some(before) => run.order.study.continues(entry, before)?,
        None => false,
    };
    Ok(Some(After {
        name: name.clone(),
        model,
        steps: if continues { steps } else { 0 },
    }))
}

/// The record of a training, which may be at its beginning.
fn record(
    run: &StudyRun<'_>,
    entry: &Training,
    after: Option<After>,
    cfg: &TrainConfig,
    data: &StudyData,
) -> Result<Record> {
    let fresh = Record {
        config: serde_json::to_value(cfg)?,
        data: data.hash.clone(),
        budget: run.order.study.budget(entry)?,
        after,
        device: run.order.machine.name(),
        steps_done: 0,
        seconds: 0.0,
        parameters: 0,
        model: None,
    };
    let folder = folder(run, &entry.name);
    match read_kept::<Record>(&folder.join(RECORD))? {
        Some(known) => check_same(&known, &fresh, &folder).map(|()| known),
        None => Ok(fresh),
    }
}

/// The name of the record in a training's folder.
const RECORD: &str = "record.json";

fn folder(run: &StudyRun<'_>, name: &str) -> PathBuf {
    run.order.out.join(TRAININGS).join(name)
}

/// A training in this folder goes on only as what it was begun as.
fn check_same(known: &Record, now: &Record, folder: &Path) -> Result<()> {
    let what = if known.config != now.config {
        "configuration"
    } else if known.data != now.data {
        "data set"
    } else if known.budget != now.budget {
        "budget"
    } else if known.after != now.after {
        "training to go on from"
    } else {
        return check_device(known, now, folder);
    };
    Err(anyhow!(
        "{} was made with another {what}: remove the folder to train again, or give the entry another name",
        folder.display()
    ))
}

/// So many steps are the same wherever they are made, but for rounding; so many seconds are not.
fn check_device(known: &Record, now: &Record, folder: &Path) -> Result<()> {
    if known.device == now.device || matches!(now.budget, Budget::Steps(_)) {
        return Ok(());
    }
    Err(anyhow!(
        "{} has a budget in time and was begun on {:?}, not on {:?}: take the device that it was \
         begun with, remove the folder to train again, or give the entry another name",
        folder.display(),
        known.device,
        now.device
    ))
}

/// At the checkpoint of its folder, at the end of the training before it or with the weights of
/// that, or new. None where an end was asked for.
fn trainer(
    run: &StudyRun<'_>,
    entry: &Training,
    after: Option<&After>,
    cfg: TrainConfig,
    data: &StudyData,
) -> Result<Option<Trainer>> {
    let engine = crate::machine::engine(run.order.machine, MICRO_BATCH);
    let own = folder(run, &entry.name).join(files::CHECKPOINT);
    let listener = &mut run.reporter.listener();
    let trainer = match after {
        _ if own.is_file() => Some(Trainer::resume(cfg, &data.set, &own, &*engine)?),
        Some(After { name, steps: 0, .. }) => {
            let file = folder(run, name).join(files::MODEL);
            let before =
                selvedge::Model::open(Some(&file)).with_context(|| format!("training {name:?}"))?;
            training::begin(Some(&before.model), cfg, &data.set, &*engine, listener)?
        }
        Some(After { name, .. }) => {
            let checkpoint = folder(run, name).join(files::CHECKPOINT);
            let trainer = Trainer::resume(cfg, &data.set, &checkpoint, &*engine)
                .with_context(|| format!("going on after training {name:?}"))?;
            Some(trainer)
        }
        None => training::begin(None, cfg, &data.set, &*engine, listener)?,
    };
    let Some(mut trainer) = trainer else {
        return Ok(None);
    };
    training::with_expert(&mut trainer, &data.set)?;
    Ok(Some(trainer))
}

/// Trains until the end, or until a checkpoint is due where time is limited.
fn slice(
    trainer: &mut Trainer,
    folder: &Path,
    record: &mut Record,
    task: &Task<'_, '_>,
) -> Result<RunEnd> {
    let time = match record.budget {
        Budget::Time(time) => Some(time_left(time, record).min(CHECKPOINT_EVERY)),
        Budget::Steps(_) => None,
    };
    let limits = RunLimits {
        time,
        checkpoint_every: CHECKPOINT_EVERY,
    };
    let started = Instant::now();
    let end = selvedge_train::run(trainer, folder, limits, &mut |step| {
        task.note(&format!("loss {:.4}", step.terms.total));
        task.advance()
    })?;
    record.seconds += started.elapsed().as_secs_f64();
    record.steps_done = trainer.steps_done();
    Ok(end)
}

fn time_left(budget: Duration, record: &Record) -> Duration {
    budget.saturating_sub(Duration::from_secs_f64(record.seconds))
}

/// Counts the steps of what is left of a training.
fn begin<'a>(run: &StudyRun<'a>, name: &str, trainer: &Trainer, record: &Record) -> Task<'a, 'a> {
    let goal = match record.budget {
        Budget::Time(time) => Goal::Time(time_left(time, record)),
        Budget::Steps(_) => {
            Goal::Count(trainer.config().steps.saturating_sub(trainer.steps_done()))
        }
    };
    run.reporter
        .begin(&format!("training {name}"), goal, "steps")
}
