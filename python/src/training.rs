//! Trainings on data sets, with a callback per step.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::Duration;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use selvedge_lab::folder::{self, FolderKind};
use selvedge_lab::machine::{self, Machine};
use selvedge_lab::{assets, training};
use selvedge_train::{RunEnd, RunLimits, Setting, StepReport, TrainConfig, Trainer, files};

use crate::arrays::natural;
use crate::dataset::{Data, Dataset};
use crate::errors::{raised, wrong};
use crate::json as python;
use crate::long::{Progress, Stop, beside, call};
use crate::model::Model;

/// The wishes for a training.
struct Asked<'a> {
    cfg: TrainConfig,
    out: &'a Path,
    resume: bool,
    from: Option<Start>,
    micro_batch: usize,
    limits: RunLimits,
}

/// The model that a training starts from: itself, its file, or the folder of its training.
#[derive(FromPyObject)]
pub(crate) enum Start {
    Model(Py<Model>),
    Path(PathBuf),
}

impl Start {
    fn model(&self) -> PyResult<selvedge::Model> {
        let file = match self {
            Self::Model(model) => return Ok(model.get().named()),
            Self::Path(folder) if folder.is_dir() => folder.join(files::MODEL),
            Self::Path(file) => file.clone(),
        };
        selvedge::Model::open(Some(&file)).map_err(raised)
    }
}

/// Names of the shipped configurations of trainings.
#[pyfunction]
pub(crate) fn training_presets() -> Vec<&'static str> {
    assets::TRAININGS.iter().map(|entry| entry.0).collect()
}

/// Trains a model, or goes on with training, as `selvedge train` does, into the folder `out`.
///
/// `config` is a shipped name or a TOML file, `settings` changes its values by dotted paths.
/// `on_step(report)` hears of every step as a dictionary; its answer `False` ends the training.
/// Ctrl-C ends it too and raises `KeyboardInterrupt` once the checkpoint is written: the same call
/// with `resume=True` goes on. `seconds` limits the time, `checkpoint_every` is the time between
/// checkpoints `[s]`.
///
/// # Errors
/// What of the configuration, the data, the folder or a step went wrong.
#[pyfunction]
#[pyo3(signature = (config, data, out, *, steps=None, settings=None, resume=false,
    start_from=None, micro_batch=1, seconds=None, checkpoint_every=300.0, on_step=None,
    progress=None))]
pub(crate) fn train<'py>(
    py: Python<'py>,
    config: PathBuf,
    data: Data,
    out: PathBuf,
    #[pyo3(from_py_with = natural)] steps: Option<u64>,
    settings: Option<&Bound<'py, PyDict>>,
    resume: bool,
    start_from: Option<Start>,
    #[pyo3(from_py_with = natural)] micro_batch: usize,
    seconds: Option<f64>,
    checkpoint_every: f64,
    on_step: Option<Py<PyAny>>,
    progress: Option<Py<PyAny>>,
) -> PyResult<Bound<'py, PyDict>> {
    if micro_batch == 0 {
        return Err(wrong("micro_batch must be at least 1"));
    }
    let (config, data) = (config.to_string_lossy(), data.open(py)?);
    let (config, data) = (&*config, data.get());
    let settings = settings_of(settings)?;
    let asked = Asked {
        cfg: training::config(config, &settings, steps).map_err(raised)?,
        out: &out,
        resume,
        from: start_from,
        micro_batch,
        limits: RunLimits {
            time: seconds.map(span).transpose()?,
            checkpoint_every: span(checkpoint_every)?,
        },
    };
    let stop = Stop::default();
    let mut reporter = Progress::new(progress, &stop);
    let hear = |report: &StepReport| {
        if let Some(on_step) = &on_step {
            call(on_step, &stop, |py| {
                let report = python::to_python(py, report)?;
                Ok((report,).into_pyobject(py)?.unbind())
            });
        }
        stop.flow()
    };
    let done = beside(py, &stop, || {
        learn(&asked, data, &stop, &hear, &mut reporter)
    })??;
    let report = PyDict::new(py);
    report.set_item("steps_done", done.steps_done)?;
    report.set_item("steps", done.steps)?;
    report.set_item("parameters", done.parameters)?;
    report.set_item("is_finished", done.end == RunEnd::Finished)?;
    report.set_item("model", out.join(files::MODEL))?;
    report.set_item("log", out.join(files::LOG))?;
    Ok(report)
}

/// The end of a training.
struct Done {
    end: RunEnd,
    steps_done: u64,
    steps: u64,
    parameters: usize,
}

/// A span of time of so many seconds.
fn span(seconds: f64) -> PyResult<Duration> {
    Duration::try_from_secs_f64(seconds).map_err(|error| wrong(format!("a time: {error}")))
}

/// Changes of a configuration, as `--set` takes them.
fn settings_of(settings: Option<&Bound<'_, PyDict>>) -> PyResult<Vec<Setting>> {
    let Some(settings) = settings else {
        return Ok(Vec::new());
    };
    let one = |(path, value): (Bound<'_, PyAny>, Bound<'_, PyAny>)| {
        let json = settings.py().import("json")?;
        let value: String = match value.extract::<String>() {
            Ok(text) => text,
            Err(_) => json.call_method1("dumps", (value,))?.extract()?,
        };
        let text = format!("{}={value}", path.extract::<String>()?);
        text.parse().map_err(raised)
    };
    settings.iter().map(one).collect()
}

/// The checkpoint of a folder, where the training goes on; otherwise the folder must have none.
fn check_folder(asked: &Asked<'_>) -> PyResult<PathBuf> {
    let checkpoint = asked.out.join(files::CHECKPOINT);
    let kept = [files::CHECKPOINT, files::MODEL];
    let kept = kept.iter().find(|name| asked.out.join(name).exists());
    match kept {
        Some(kept) if !asked.resume => Err(wrong(format!(
            "{}: there is a training in this folder ({kept}): go on with it with resume=True, or choose another folder",
            asked.out.display()
        ))),
        _ => Ok(checkpoint),
    }
}

fn learn(
    asked: &Asked<'_>,
    data: &Dataset,
    stop: &Stop,
    hear: &dyn Fn(&StepReport) -> ControlFlow<()>,
    reporter: &mut Progress<'_>,
) -> PyResult<Done> {
    let steps = asked.cfg.steps;
    let _claimed = folder::claim_folder(asked.out, FolderKind::Training).map_err(raised)?;
    let checkpoint = check_folder(asked)?;
    let Some(mut trainer) = begin(asked, data, &checkpoint, reporter)? else {
        return Ok(Done {
            end: RunEnd::Stopped,
            steps_done: 0,
            steps,
            parameters: 0,
        });
    };
    trainer.stop_by(stop.flag().into());
    reporter.begin("training", Some(steps - trainer.steps_done().min(steps)));
    let end = selvedge_train::run(&mut trainer, asked.out, asked.limits, &mut |step| {
        // Whoever wants to stop is heard below, too.
        let _ = reporter.advance();
        hear(step)
    });
    Ok(Done {
        end: end.map_err(raised)?,
        steps_done: trainer.steps_done(),
        steps,
        parameters: trainer.parameter_count(),
    })
}

/// The training, or none where an end was asked for.
fn begin(
    asked: &Asked<'_>,
    data: &Dataset,
    checkpoint: &Path,
    reporter: &mut Progress<'_>,
) -> PyResult<Option<Trainer>> {
    let data = &data.inner;
    let engine = machine::engine(&Machine::Cpu, asked.micro_batch);
    let cfg = asked.cfg.clone();
    let mut trainer = if asked.resume {
        Some(Trainer::resume(cfg, data, checkpoint, &*engine).map_err(raised)?)
    } else {
        let from = asked.from.as_ref().map(Start::model).transpose()?;
        let from = from.as_ref().map(|from| &*from.model);
        let begun = training::begin(from, cfg, data, &*engine, &mut |event| {
            reporter.on_event(event)
        });
        begun.map_err(raised)?
    };
    if let Some(trainer) = &mut trainer {
        training::with_expert(trainer, data).map_err(raised)?;
    }
    Ok(trainer)
}
