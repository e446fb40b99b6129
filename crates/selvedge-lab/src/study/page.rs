//! The report of a study: its models and their trainings above that of its evaluation.

use super::error::StudyError;
use super::file::{Budget, Study};
use super::training::Record;
use crate::report::{self, Cells, Heading};

/// What the report of a study says beside the numbers.
pub(super) fn heading(study: &Study, trained: &[Record]) -> Result<Heading, StudyError> {
    Ok(Heading {
        title: study.title.clone(),
        note: study.text.clone(),
        tables: vec![models(study, trained)?],
        reference_order: None,
        times: vec![training_times(study, trained)],
    })
}

/// A table of the models and of their trainings.
fn models(study: &Study, trained: &[Record]) -> Result<String, StudyError> {
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
    let cells = |(entry, record): (&super::file::Training, &Record)| {
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
