//! Reports of evaluations and the curves of trainings: a page of Markdown with plots (.svg), and one
//! table of all numbers (.csv).
//!
//! Everything but the times is a pure function of the runs: the same runs, the same bytes. Times
//! depend on the machine and stand in files of their own.

mod numbers;
mod plots;
mod tables;
#[cfg(test)]
mod tests;
mod training;

use std::io::Write;
use std::path::{Path, PathBuf};

use anyhow::Result;
use selvedge_data::write_atomically;
use selvedge_view::plot::PlotError;

pub(crate) use self::numbers::csv_of;
pub use self::numbers::{errors_csv, write_errors};
pub use self::tables::{Cells, Columns, after, character, failures, table, whole};
pub use self::training::{TrainingLog, training_chart};

use self::plots::{by_frames, by_time, over_time};
use crate::evaluation::{Evaluation, Run, Summary, own_errors, summaries};
use crate::folder::{self, ERRORS};

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

/// The measure that a plot shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Measure {
    Position,
    EdgeLength,
}

/// Writes the report of an evaluation into `folder`, each file whole or not at all and the page
/// last, and says where they are.
pub fn write(folder: &Path, heading: &Heading, evaluation: &Evaluation) -> Result<Vec<PathBuf>> {
    let files = files(heading, evaluation)?;
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
fn files(heading: &Heading, evaluation: &Evaluation) -> Result<Vec<(String, Vec<u8>)>, PlotError> {
    let runs: Vec<&Run> = evaluation.runs.iter().collect();
    let summaries = summaries(&runs);
    let page = errors_page(heading, &runs, &summaries, evaluation)?;
    let times = times_page(heading, &summaries, evaluation)?;
    let csv = [
        errors_csv(&evaluation.runs),
        numbers::times_csv(&evaluation.timings),
    ];
    let mut files = page.plots;
    files.extend(times.plots);
    files.extend(TABLES.map(str::to_owned).into_iter().zip(csv));
    files.push(("times.md".to_owned(), times.text.into_bytes()));
    files.push(("report.md".to_owned(), page.text.into_bytes()));
    Ok(files)
}

/// A page, and the files of its plots.
struct Page {
    text: String,
    plots: Vec<(String, Vec<u8>)>,
}

impl Page {
    fn new(text: String) -> Self {
        let plots = Vec::new();
        Self { text, plots }
    }

    /// Adds a paragraph or a table; nothing where there is none.
    fn say(&mut self, text: &str) {
        if !text.trim().is_empty() {
            self.text.push('\n');
            self.text.push_str(text.trim());
            self.text.push('\n');
        }
    }

    fn table(&mut self, (headings, rows): &Columns) {
        self.say(&table(headings, rows));
    }

    fn plot(&mut self, file: &str, what: &str, svg: Option<String>) {
        if let Some(svg) = svg {
            self.say(&format!("![{what}]({file})"));
            self.plots.push((file.to_owned(), svg.into_bytes()));
        }
    }
}

fn errors_page(
    heading: &Heading,
    runs: &[&Run],
    summaries: &[Summary],
    evaluation: &Evaluation,
) -> Result<Page, PlotError> {
    let mut page = Page::new(format!("# {}\n", heading.title));
    page.say(&heading.note);
    heading.tables.iter().for_each(|table| page.say(table));
    page.say(&tables::cases(&evaluation.runs));
    page.say("## Errors after k frames");
    page.table(&after(summaries));
    if let Some(order) = heading.reference_order {
        let own = own_errors(&evaluation.runs, order);
        page.say(&tables::own_error(&own, order));
    }
    page.plot("after.svg", "errors by frames", by_frames(summaries)?);
    page.say("## Whole runs");
    page.table(&whole(summaries));
    for (measure, file) in [
        (Measure::Position, "time-position.svg"),
        (Measure::EdgeLength, "time-edge-length.svg"),
    ] {
        page.plot(file, "errors by time", over_time(runs, measure)?);
    }
    let character = character(summaries);
    if !character.1.is_empty() {
        page.table(&character);
    }
    for (title, table) in [
        ("Case by case", tables::by_case(&evaluation.runs)),
        ("Mesh by mesh", tables::by_mesh(&evaluation.runs)),
        ("What failed", failures(&evaluation.runs)),
    ] {
        if !table.is_empty() {
            page.say(&format!("## {title}"));
            page.say(&table);
        }
    }
    page.say(NOTES);
    Ok(page)
}

fn times_page(
    heading: &Heading,
    summaries: &[Summary],
    evaluation: &Evaluation,
) -> Result<Page, PlotError> {
    let timings = &evaluation.timings;
    let mut page = Page::new(TIMES.to_owned());
    heading.times.iter().for_each(|line| page.say(line));
    page.say(&tables::times(timings));
    page.say(&tables::equal_time(summaries, timings));
    let plot = by_time(summaries, timings)?;
    page.plot("times.svg", "errors by the time of a frame", plot);
    Ok(page)
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
Baselines: rigid, the rest pose moved with the handles; mirror, the physics
in the mirrored buckling mode (whole runs only). A run diverges where some edge strains over 30 %
and over 1.5 times the truth's largest strain for more than 10 frames in a row, or where it fails.
Folds and the other ratios are parts of the truth's: 1 is as the truth. A trajectory has no velocities:
physics takes those between the first two frames. Where a scene's converged physics is the truth, the
method *reference* is a second run with half the reference's substeps, whose difference tells the reference's own error. All numbers are in
errors.csv, in SI units, a row for each run and frame; the time of a frame is in
[times.md](times.md).";
