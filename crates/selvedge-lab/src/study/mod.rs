//! Studies: trainings, measurements, and questions about their outcome, in one file.
//!
//! `file` is what a study says, checked; `training` and `evaluation` do the work and keep what is
//! done in the study's folder, so that a study that was interrupted goes on; `page` answers the
//! questions. What is kept says what it was made from, and is only taken for that.

mod desk;
mod error;
mod evaluation;
mod file;
mod kept;
mod page;
mod training;

use std::path::{Path, PathBuf};

use selvedge_data::{DatasetPreset, shipped_presets};

use self::desk::{Desk, StudyData};
use self::error::OfPart;
use self::file::{DataSource, Study};
use crate::event::{End, OnEvent, Reporter};
use crate::generation;
use crate::machine::Machine;

pub use self::error::StudyError;
pub use self::file::open;

/// The outcome of a study.
pub struct StudyOutcome {
    /// Trainings that are finished.
    pub trained: usize,
    /// Contestants that are measured.
    pub measured: usize,
    /// The files of the report; none where it was interrupted.
    pub wrote: Vec<PathBuf>,
    /// The end that it came to.
    pub end: End,
}

/// Does what of `study` is not done yet, in `out`; models are trained and run on `machine`.
///
/// # Errors
/// What of a data set, a training, a model or a file went wrong, and what to do.
pub fn run(
    study: &Study,
    out: &Path,
    threads: Option<u16>,
    machine: &Machine,
    on_event: &mut OnEvent<'_>,
) -> Result<StudyOutcome, StudyError> {
    let mut outcome = StudyOutcome {
        trained: 0,
        measured: 0,
        wrote: Vec::new(),
        end: End::Interrupted,
    };
    let reporter = Reporter::new(on_event);
    let Some(data) = prepare(study, out, threads, &reporter)? else {
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
    let mut trained = Vec::with_capacity(study.train.len());
    for entry in &study.train {
        let Some(training) = training::train(&desk, entry)
            .of(|| format!("training {:?} of the study", entry.name))?
        else {
            outcome.trained = trained.len();
            return Ok(outcome);
        };
        trained.push(training);
    }
    outcome.trained = trained.len();
    let Some(measured) = evaluation::measure_all(&desk)? else {
        return Ok(outcome);
    };
    outcome.measured = study.train.len() + study.model.len() + study.evaluation.rivals().count();
    let report = page::report(study, &trained, &measured)?;
    outcome.wrote = report.write(&out.join("report"))?;
    outcome.end = End::Complete;
    Ok(outcome)
}

/// Opens the data sets, and makes those that are to be made. None where an end was asked for.
fn prepare(
    study: &Study,
    out: &Path,
    threads: Option<u16>,
    reporter: &Reporter<'_>,
) -> Result<Option<Vec<StudyData>>, StudyError> {
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
                let end = make(&preset, &folder, threads, reporter).of(context)?;
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
    threads: Option<u16>,
    reporter: &Reporter<'_>,
) -> Result<End, StudyError> {
    let preset = DatasetPreset::open(name)?;
    for warning in preset.warnings() {
        reporter.remark(&format!("{name}: {warning}"));
    }
    if !folder.join("index.json").is_file() {
        let threads = threads.map(usize::from);
        return Ok(generation::make_dataset(&preset, folder, threads, reporter)?.end());
    }
    let plan = preset.plan()?;
    let made = generation::open(folder)?;
    if let Some(difference) = plan.difference(made.index()) {
        return Err(StudyError::new(format!(
            "{}: the data set that is there was not made from the preset {name}, since it {difference}: remove the folder, or choose another --out",
            folder.display()
        )));
    }
    Ok(End::Complete)
}
