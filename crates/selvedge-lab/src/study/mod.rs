//! Studies: a list of trainings and one evaluation of all their models, in one file.
//!
//! `file` is what a study says, checked; `training` and `evaluation` do the work and keep what is
//! done in the study's folder, so that a study that was interrupted goes on. What is kept says what it was made from, and is only taken for that.

mod desk;
mod error;
mod evaluation;
mod file;
mod kept;
mod page;
mod shared;
mod training;

use std::path::{Path, PathBuf};

use selvedge_cluster::Shard;
use selvedge_data::{DatasetPreset, shipped_presets};

use self::desk::{Desk, StudyData};
use self::error::OfPart;
use self::file::{DataSource, Study};
use crate::event::{End, OnEvent, Reporter};
use crate::folder_kind::REPORT;
use crate::generation;
use crate::machine::Machine;
use crate::report;

pub use self::error::StudyError;
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
pub fn run(order: StudyOrder<'_>, on_event: &mut OnEvent<'_>) -> Result<StudyOutcome, StudyError> {
    let StudyOrder {
        study,
        out,
        machine,
        threads,
        part,
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
    let desk = Desk {
        study,
        out,
        threads,
        machine,
        reporter: &reporter,
        data,
    };
    training::check_kept(&desk)?;
    evaluation::check(&desk)?;
    let trained = shared::train_part(&desk, part)?;
    outcome.trained = trained.len();
    if part.is_some() {
        outcome.end = match trained.len() == shared::entries_of(study, part).len() {
            true => End::Complete,
            false => End::Interrupted,
        };
        return Ok(outcome);
    }
    if trained.len() < study.train.len() {
        return Ok(outcome);
    }
    let Some(measured) = evaluation::measure_all(&desk)? else {
        return Ok(outcome);
    };
    outcome.measured = study.train.len() + study.model.len() + study.evaluation.baselines().count();
    let heading = page::heading(study, &trained)?;
    outcome.wrote = report::write(&out.join(REPORT), &heading, &measured)?;
    outcome.end = End::Complete;
    Ok(outcome)
}

/// Opens the data sets, and makes those that are to be made. None where an end was asked for.
fn prepare(
    order: StudyOrder<'_>,
    reporter: &Reporter<'_>,
) -> Result<Option<Vec<StudyData>>, StudyError> {
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
                let preset = match is_shipped {
                    true => preset.clone(),
                    false => study.folder.join(preset).display().to_string(),
                };
                let folder = out.join("data").join(name);
                if part.is_some() && !folder.join("index.json").is_file() {
                    let folder = folder.display();
                    return Err(StudyError::new(format!(
                        "{folder}: the data set is not there yet, and a part of a study makes none: make it \
                         first with `selvedge data generate {preset} -o {folder}`"
                    )));
                }
                let end = make(&preset, &folder, order.threads, reporter).of(context)?;
                if end == End::Interrupted {
                    return Ok(None);
                }
                folder
            }
        };
        let set = generation::open(&folder).of(context)?;
        let hash = kept::hash_of(&folder.join("index.json"))?;
        all.push(StudyData {
            name: name.clone(),
            set,
            hash,
        });
    }
    Ok(Some(all))
}

/// Makes a data set, or finds it made from the same preset.
fn make(
    name: &str,
    folder: &Path,
    threads: Option<usize>,
    reporter: &Reporter<'_>,
) -> Result<End, StudyError> {
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
        return Ok(generation::make_dataset(order, threads, reporter)?.end());
    }
    let plan = preset.plan()?;
    let made = generation::open(folder)?;
    if let Some(difference) = plan.difference(made.index()) {
        return Err(StudyError::new(format!(
            "{}: the data set that is there was not made from the preset {name}, since it {difference}: remove the folder, or choose another",
            folder.display()
        )));
    }
    Ok(End::Complete)
}
