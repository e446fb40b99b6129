//! Reports of evaluations: a page of Markdown, and one table of all numbers (.csv).
//!
//! Everything but the times is a pure function of the runs: the same runs, the same bytes. Times
//! depend on the machine and stand in files of their own.

mod numbers;
mod tables;
#[cfg(test)]
mod tests;
mod training;

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use selvedge_data::{Split, write_atomically};
use serde::Serialize;

pub(crate) use self::numbers::csv_of;
pub use self::numbers::{errors_csv, write_errors};
pub use self::tables::{Cells, Columns, after, character, failures, table, whole};
pub use self::training::training_log;

use crate::evaluation::{Evaluation, Run, Summary, own_errors, summaries};
use crate::folder::{self, ERRORS};
use crate::machine::Machine;

/// The tables that every report has.
pub const TABLES: [&str; 2] = [ERRORS, "times.csv"];

/// What a report says beside the numbers.
#[derive(Default)]
pub struct Heading {
    /// The title.
    pub title: String,
    /// A paragraph under it; empty where there is nothing to say.
    pub note: String,
    /// Tables under that, such as one of the models.
    pub tables: Vec<String>,
    /// The order of the reference's integrator, where there is a reference.
    pub reference_order: Option<u32>,
    /// Lines above the times.
    pub times: Vec<String>,
}

/// A model that was measured.
#[derive(Clone, Debug, Serialize)]
pub struct ModelFile {
    /// Its name in tables.
    pub name: String,
    /// Its file.
    pub file: PathBuf,
    /// The number of its weights.
    pub parameters: usize,
}

impl Heading {
    /// The heading of an evaluation of `models` on `machine`, on a split of data sets or on what
    /// has none; complete, or interrupted.
    pub fn new(
        split: Option<Split>,
        models: &[ModelFile],
        machine: &Machine,
        is_complete: bool,
    ) -> Self {
        let title = split.map_or_else(String::new, |split| format!(", {} split", split.name()));
        let mut heading = Self {
            title: format!("Evaluation{title}"),
            times: vec![format!("Models ran on: {}.", machine.name())],
            ..Self::default()
        };
        if !is_complete {
            heading.note = "**Interrupted: only the starts until then are here.**".to_owned();
        }
        let cells = |model: &ModelFile| {
            let file = model.file.display().to_string();
            vec![model.name.clone(), file, model.parameters.to_string()]
        };
        let rows: Vec<_> = models.iter().map(cells).collect();
        if !rows.is_empty() {
            heading
                .tables
                .push(table(&["model", "file", "parameters"], &rows));
        }
        heading
    }
}

/// Writes the report of an evaluation into `folder`, each file whole or not at all and the page
/// last, and says where they are.
pub fn write(folder: &Path, heading: &Heading, evaluation: &Evaluation) -> Result<Vec<PathBuf>> {
    let files = files(heading, evaluation);
    folder::make_folder(folder)?;
    let mut wrote = Vec::with_capacity(files.len());
    for (name, content) in &files {
        let path = folder.join(name);
        write_atomically(&path, |out| out.write_all(content))?;
        wrote.push(path);
    }
    Ok(wrote)
}

/// Names and contents of the files of a report.
fn files(heading: &Heading, evaluation: &Evaluation) -> [(&'static str, Vec<u8>); 4] {
    [
        (TABLES[0], errors_csv(&evaluation.runs)),
        (TABLES[1], numbers::times_csv(&evaluation.timings)),
        ("times.md", times_page(heading, evaluation).into_bytes()),
        ("report.md", errors_page(heading, evaluation).into_bytes()),
    ]
}

/// Adds a paragraph or a table to a page; nothing where there is none.
fn say(page: &mut String, text: &str) {
    if !text.trim().is_empty() {
        page.extend(["\n", text.trim(), "\n"]);
    }
}

fn errors_page(heading: &Heading, evaluation: &Evaluation) -> String {
    let runs: Vec<&Run> = evaluation.runs.iter().collect();
    let summaries = summaries(&runs);
    let columns = |(headings, rows): Columns| table(&headings, &rows);
    let mut page = format!("# {}\n", heading.title);
    say(&mut page, &heading.note);
    heading
        .tables
        .iter()
        .for_each(|table| say(&mut page, table));
    say(&mut page, &tables::cases(&evaluation.runs));
    say(&mut page, "## Errors after k frames");
    say(&mut page, &columns(after(&summaries)));
    if let Some(order) = heading.reference_order {
        let own = own_errors(&evaluation.runs, order);
        say(&mut page, &tables::own_error(&own, order));
    }
    say(&mut page, "## Whole runs");
    say(&mut page, &columns(whole(&summaries)));
    let character = character(&summaries);
    if !character.1.is_empty() {
        say(&mut page, &columns(character));
    }
    for (title, table) in [
        ("Case by case", tables::by_case(&evaluation.runs)),
        ("Mesh by mesh", tables::by_mesh(&evaluation.runs)),
        ("What failed", failures(&evaluation.runs)),
    ] {
        if !table.is_empty() {
            say(&mut page, &format!("## {title}"));
            say(&mut page, &table);
        }
    }
    say(&mut page, NOTES);
    page
}

fn times_page(heading: &Heading, evaluation: &Evaluation) -> String {
    let runs: Vec<&Run> = evaluation.runs.iter().collect();
    let timings = &evaluation.timings;
    let mut page = TIMES.to_owned();
    heading.times.iter().for_each(|line| say(&mut page, line));
    say(&mut page, &tables::times(timings));
    say(&mut page, &tables::equal_time(&summaries(&runs), timings));
    page
}

/// The times of a frame of a method over all meshes, as their mean `[ms]`.
fn ms_per_frame(summary: &Summary, timings: &[crate::evaluation::Timing]) -> Option<f64> {
    let own = timings
        .iter()
        .filter(|timing| timing.method == summary.method && timing.kind == summary.kind);
    let times: Vec<f64> = own.map(|timing| timing.ms_per_frame).collect();
    (!times.is_empty()).then(|| times.iter().sum::<f64>() / times.len() as f64)
}

const TIMES: &str = "# Times

Milliseconds per frame on one thread: the median over up to 120 frames of a run that has the machine
for itself, as far as this program is concerned. They depend on the machine.
";

const NOTES: &str = "## What was measured

The error after k frames is that at the k-th frame of runs that start in true states; means over
starts, then over cases. Whole runs start in the first frame and are fed with their own output; their
measures are over all frames, then means over cases: of the distances of vertices the RMSE, the mean and
the largest, of edges the RMSE of their lengths, and the mean speed in the last second; *at most* is the
largest correction by a guard. None is given where a run failed: a mean over the others would flatter.
Baseline: rigid, the rest pose moved with the handles. A run diverges where some edge strains over 30 %
and over 1.5 times the truth's largest strain for more than 10 frames in a row, or where it fails.
Folds and the other ratios are parts of the truth's: 1 is as the truth. A trajectory has no velocities:
physics takes those between the first two frames. Where a scene's converged physics is the truth, the
method *reference* is a second run with half the reference's substeps, whose difference tells the reference's own error. All numbers are in
errors.csv, in SI units, a row for each run and frame; the time of a frame is in
[times.md](times.md).";
