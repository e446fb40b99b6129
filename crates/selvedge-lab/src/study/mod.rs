//! Studies: a list of trainings and one evaluation of all their models, in one file.
//!
//! `file` is what a study says, checked; `training` and `evaluation` do the work and keep what is
//! done in the study's folder, so that a study that was interrupted goes on. What is kept says what
//! it was made from, and is only taken for that.

mod evaluation;
mod file;
mod training;

use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow, bail};
use selvedge_cluster::Shard;
use selvedge_data::{Dataset, DatasetPreset, shipped_presets, write_atomically};
use serde::Serialize;
use serde::de::DeserializeOwned;

use self::file::{Budget, DataSource, Study, Training};
use self::training::Record;
use crate::event::{End, OnEvent, Reporter};
use crate::folder::REPORT;
use crate::generation;
use crate::machine::{Machine, PROCESSOR};
use crate::report::{self, Cells, Heading};

pub use self::file::{open, shipped};

/// A study to be made.
#[derive(Clone, Copy)]
pub struct StudyOrder<'a> {
    /// The study.
    pub study: &'a Study,
    /// Its folder.
    pub out: &'a Path,
    /// The machine that trains and runs models.
    pub machine: &'a Machine,
    /// Threads of simulations and evaluations; by default one per processor.
    pub threads: Option<usize>,
    /// The share of its trainings to be made, and nothing else; all without one.
    pub part: Option<Shard>,
}

/// The outcome of a study.
pub struct StudyOutcome {
    /// Trainings that are finished.
    pub trained: usize,
    /// Methods that are measured.
    pub measured: usize,
    /// The files of the report; none where it was interrupted.
    pub wrote: Vec<PathBuf>,
    /// The end that it came to.
    pub end: End,
}

/// Does what of a study is not done yet, in its folder. A part trains its share of the models and
/// ends there.
pub fn run(order: StudyOrder<'_>, on_event: &mut OnEvent<'_>) -> Result<StudyOutcome> {
    let StudyOrder {
        study, out, part, ..
    } = order;
    let mut outcome = StudyOutcome {
        trained: 0,
        measured: 0,
        wrote: Vec::new(),
        end: End::Interrupted,
    };
    let reporter = Reporter::new(on_event);
    let Some(data) = prepare(order, &reporter)? else {
        return Ok(outcome);
    };
    let run = StudyRun {
        order,
        reporter: &reporter,
        data,
    };
    training::check_kept(&run)?;
    evaluation::check(&run)?;
    let entries = entries_of(study, part);
    let trained = train(&run, &entries)?;
    outcome.trained = trained.len();
    if trained.len() < entries.len() {
        return Ok(outcome);
    }
    if part.is_some() {
        outcome.end = End::Complete;
        return Ok(outcome);
    }
    let Some(measured) = evaluation::measure_all(&run)? else {
        return Ok(outcome);
    };
    outcome.measured = study.train.len() + study.model.len() + study.evaluation.baselines().count();
    let heading = heading(study, &trained)?;
    outcome.wrote = report::write(&out.join(REPORT), &heading, &measured)?;
    outcome.end = End::Complete;
    Ok(outcome)
}

/// Opens the data sets, and makes those that are to be made. None where an end was asked for.
fn prepare(order: StudyOrder<'_>, reporter: &Reporter<'_>) -> Result<Option<Vec<StudyData>>> {
    let StudyOrder {
        study, out, part, ..
    } = order;
    let mut all = Vec::with_capacity(study.data.len());
    for (name, source) in &study.data {
        let context = || format!("data set {name:?} of the study");
        let folder = match source {
            DataSource::Folder(folder) => study.folder.join(folder),
            DataSource::Preset(preset) => {
                let is_shipped = shipped_presets().iter().any(|shipped| shipped.0 == *preset);
                let preset = if is_shipped {
                    preset.clone()
                } else {
                    study.folder.join(preset).display().to_string()
                };
                let folder = out.join("data").join(name);
                if part.is_some() && !folder.join("index.json").is_file() {
                    let folder = folder.display();
                    bail!(
                        "{folder}: the data set is not there yet, and a part of a study makes none: make it \
                         first with `selvedge data generate {preset} -o {folder}`"
                    );
                }
                let end = make(&preset, &folder, order.threads, reporter).with_context(context)?;
                if end == End::Interrupted {
                    return Ok(None);
                }
                folder
            }
        };
        let set = generation::open(&folder).with_context(context)?;
        let hash = hash_of(&folder.join("index.json"))?;
        all.push(StudyData {
            name: name.clone(),
            set,
            hash,
        });
    }
    Ok(Some(all))
}

/// Makes a data set, or finds it made from the same preset.
fn make(name: &str, folder: &Path, threads: Option<usize>, reporter: &Reporter<'_>) -> Result<End> {
    let preset = DatasetPreset::open(name)?;
    for warning in preset.warnings() {
        reporter.remark(&format!("{name}: {warning}"));
    }
    if !folder.join("index.json").is_file() {
        let order = generation::Order {
            preset: &preset,
            folder,
            part: None,
        };
        return Ok(generation::generate(order, threads, &mut reporter.listener())?.end());
    }
    let plan = preset.plan()?;
    let made = generation::open(folder)?;
    if let Some(difference) = plan.difference(made.index()) {
        bail!(
            "{}: the data set that is there was not made from the preset {name}, since it {difference}: remove the folder, or choose another",
            folder.display()
        );
    }
    Ok(End::Complete)
}

/// A study at work.
struct StudyRun<'a> {
    order: StudyOrder<'a>,
    reporter: &'a Reporter<'a>,
    data: Vec<StudyData>,
}

/// A data set of a study.
struct StudyData {
    name: String,
    set: Dataset,
    /// Of its index.
    hash: String,
}

impl StudyRun<'_> {
    /// The data set of this name, which `file` has checked to be there.
    fn data(&self, name: &str) -> Result<&StudyData> {
        let found = self.data.iter().find(|data| data.name == name);
        found.ok_or_else(|| anyhow!("the study has no data set {name:?}"))
    }
}

/// Trainings that go on from one another, by their places in the study.
fn groups(study: &Study) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (place, entry) in study.train.iter().enumerate() {
        let before =
            |other: &usize| entry.after.as_deref() == Some(study.train[*other].name.as_str());
        match groups.iter_mut().find(|group| group.iter().any(before)) {
            Some(group) => group.push(place),
            None => groups.push(vec![place]),
        }
    }
    groups
}

/// The trainings of a part, by their places in the study.
fn entries_of(study: &Study, part: Option<Shard>) -> Vec<usize> {
    let groups = groups(study).into_iter().enumerate();
    let own = groups.filter(|(number, _)| part.is_none_or(|part| part.has(*number)));
    let mut places: Vec<usize> = own.flat_map(|(_, group)| group).collect();
    places.sort_unstable();
    places
}

/// These trainings, one after another, as far as nobody asks for an end.
fn train(run: &StudyRun<'_>, entries: &[usize]) -> Result<Vec<Record>> {
    let mut trained = Vec::new();
    for place in entries {
        let entry = &run.order.study.train[*place];
        let context = || format!("training {:?} of the study", entry.name);
        match training::train(run, entry).with_context(context)? {
            Some(record) => trained.push(record),
            None => break,
        }
    }
    Ok(trained)
}

/// The hash of a file, in hexadecimal.
fn hash_of(path: &Path) -> Result<String> {
    let bytes = selvedge_data::read_file(path)
        .with_context(|| format!("{}: could not be read", path.display()))?;
    Ok(blake3::hash(&bytes).to_hex().to_string())
}

/// Reads what is kept in `path`; none where there is no such file.
fn read_kept<T: DeserializeOwned>(path: &Path) -> Result<Option<T>> {
    let text = match selvedge_data::read_text(path) {
        Ok(text) => text,
        Err(error) if error.kind() == ErrorKind::NotFound => return Ok(None),
        Err(error) => {
            let context = format!("{}: could not be read", path.display());
            return Err(error).context(context);
        }
    };
    serde_json::from_str(&text).map(Some).with_context(|| {
        format!(
            "{}: is not what a study keeps: remove it, and it is made again",
            path.display()
        )
    })
}

/// The device of what does not say one.
fn processor() -> String {
    PROCESSOR.to_owned()
}

/// Keeps `value` in `path`.
fn write_kept(path: &Path, value: &impl Serialize) -> Result<()> {
    let text = serde_json::to_string(value)
        .with_context(|| format!("{}: writing JSON", path.display()))?;
    Ok(write_atomically(path, |out| {
        out.write_all(text.as_bytes())
    })?)
}

/// What the report of a study says beside the numbers.
fn heading(study: &Study, trained: &[Record]) -> Result<Heading> {
    Ok(Heading {
        title: study.title.clone(),
        note: study.text.clone(),
        tables: vec![models(study, trained)?],
        reference_order: None,
        times: vec![training_times(study, trained)],
    })
}

/// A table of the models and of their trainings.
fn models(study: &Study, trained: &[Record]) -> Result<String> {
    let headings = [
        "model",
        "what",
        "learned from",
        "budget",
        "steps",
        "parameters",
    ];
    let mut rows: Vec<Cells> = Vec::new();
    for (entry, record) in study.train.iter().zip(trained) {
        let mut what = vec![entry.config.clone()];
        what.extend(study.settings(entry).cloned());
        what.extend(entry.after.iter().map(|before| format!("after {before}")));
        rows.push(vec![
            entry.name.clone(),
            what.join("; "),
            study.data_of(entry)?.to_owned(),
            match study.budget(entry)? {
                Budget::Steps(steps) => format!("{steps} steps"),
                Budget::Time(time) => format!("{} s", time.as_secs()),
            },
            record.steps_done.to_string(),
            record.parameters.to_string(),
        ]);
    }
    for entry in &study.model {
        let mut cells = vec![entry.name.clone(), entry.file.display().to_string()];
        cells.extend(vec!["–".to_owned(); 4]);
        rows.push(cells);
    }
    Ok(report::table(&headings, &rows))
}

fn training_times(study: &Study, trained: &[Record]) -> String {
    let headings = ["training", "begun on", "time (s)", "steps per second"];
    let cells = |(entry, record): (&Training, &Record)| {
        vec![
            entry.name.clone(),
            record.device.clone(),
            format!("{:.0}", record.seconds),
            format!("{:.1}", record.rate()),
        ]
    };
    let rows: Vec<Cells> = study.train.iter().zip(trained).map(cells).collect();
    format!("## Training\n\n{}", report::table(&headings, &rows))
}
