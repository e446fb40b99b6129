//! Tables in Markdown. Lengths are in millimetres with the digits that matter.

use std::fmt::Write;

use selvedge_data::metrics::Character;

use super::{Contest, Subject};
use crate::evaluation::{Row, Summary, Timing, summary};
use crate::numbers::percent;

/// A row of a table.
pub type Cells = Vec<String>;

/// A table: the first column to the left, the others to the right.
pub fn table(headings: &[String], rows: &[Cells]) -> String {
    let line = |cells: &[String]| {
        let escaped: Vec<String> = cells.iter().map(|cell| escape(cell)).collect();
        format!("| {} |\n", escaped.join(" | "))
    };
    let mut text = line(headings);
    text.push_str("|---|");
    text.push_str(&"---:|".repeat(headings.len().saturating_sub(1)));
    text.push('\n');
    for row in rows {
        text.push_str(&line(row));
    }
    text
}

/// A text that is a cell, whatever is in it.
fn escape(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

fn headings(names: &[&str]) -> Vec<String> {
    names.iter().map(|&name| name.to_owned()).collect()
}

/// Everything about whole runs.
pub fn summary_table(contest: &Contest<'_>) -> String {
    let headings = headings(&[
        "who",
        "position RMSE (mm)",
        "mean vertex error (mm)",
        "largest error (mm)",
        "e₃D (%)",
        "edge-length RMSE (mm)",
        "largest strain",
        "runs under 20 % strain",
        "first frame over",
        "speed in the last second (mm/s)",
        "runs that diverge",
        "frames corrected",
        "largest correction (mm)",
    ]);
    let cells = |name: String, of: &Summary| {
        let mut cells = vec![name];
        match &of.measures {
            Some(m) => cells.extend([
                millimetres(m.position_rmse),
                millimetres(m.mean_vertex_error),
                millimetres(m.largest_vertex_error),
                digits(1e2 * m.relative_error),
                millimetres(m.edge_length_rmse),
                percent(m.largest_strain),
            ]),
            None => cells.extend(vec!["failed".to_owned(); 6]),
        }
        cells.push(format!("{} of {}", of.stable, of.motions));
        cells.push(of.unstable_frame.map_or_else(dash, |f| f.to_string()));
        let settled = of.measures.as_ref().map(|m| millimetres(m.final_speed));
        cells.push(settled.unwrap_or_else(dash));
        cells.push(of.diverged.to_string());
        let guarded = of.guarded.as_ref();
        cells.push(guarded.map_or_else(dash, |g| percent(g.share())));
        cells.push(guarded.map_or_else(dash, |g| millimetres(g.largest_correction)));
        cells
    };
    table(&headings, &by_subject(contest, cells))
}

/// The character of whole runs, as ratios to their truths.
pub(super) fn likeness_table(contest: &Contest<'_>) -> String {
    let mut headings = headings(&["who"]);
    headings.extend(Character::NAMES.map(str::to_owned));
    let cells = |name: String, of: &Summary| {
        let mut cells = vec![name];
        match &of.ratios {
            Some(ratios) => cells.extend(ratios.map(|r| r.map_or_else(dash, digits))),
            None => cells.extend(vec!["failed".to_owned(); Character::NAMES.len()]),
        }
        cells
    };
    table(&headings, &by_subject(contest, cells))
}

/// The two errors of the paper's table 1.
pub fn ablation_table(contest: &Contest<'_>) -> String {
    let headings = headings(&[
        "model",
        "position RMSE (10⁻² m)",
        "edge-length RMSE (10⁻⁴ m)",
    ]);
    let cells = |name: String, of: &Summary| {
        let [position, edge] = match &of.measures {
            Some(m) => [1e2 * m.position_rmse, 1e4 * m.edge_length_rmse].map(digits),
            None => ["failed", "failed"].map(str::to_owned),
        };
        vec![name, position, edge]
    };
    table(&headings, &by_subject(contest, cells))
}

/// Position errors over k steps, and over whole runs.
pub fn horizon_table(contest: &Contest<'_>) -> String {
    let summaries: Vec<Summary> = contest.subjects().map(|s| summary(&s.rows)).collect();
    let mut steps: Vec<usize> = summaries
        .iter()
        .flat_map(|summary| summary.horizons.iter().map(|h| h.steps))
        .collect();
    steps.sort_unstable();
    steps.dedup();
    let mut headings = vec!["position RMSE (mm)".to_owned()];
    headings.extend(steps.iter().map(|steps| match steps {
        1 => "1 step".to_owned(),
        _ => format!("{steps} steps"),
    }));
    headings.push("whole runs".to_owned());
    let cells = |name: String, of: &Summary| {
        let mut cells = vec![name];
        cells.extend(steps.iter().map(|steps| {
            let found = of.horizons.iter().find(|h| h.steps == *steps);
            found.map_or_else(dash, |h| millimetres(h.position_rmse))
        }));
        let whole = of.measures.as_ref().map(|m| millimetres(m.position_rmse));
        cells.push(whole.unwrap_or_else(|| "failed".to_owned()));
        cells
    };
    table(&headings, &by_subject(contest, cells))
}

/// Position and edge-length error of everyone along each motion.
pub fn motion_table(contest: &Contest<'_>) -> String {
    let several = contest.values(|row| &row.data).len() > 1;
    let place = |row: &Row| match several {
        true => format!("{}: {}", row.data, row.motion),
        false => row.motion.clone(),
    };
    both_errors("motion", contest, place)
}

/// Mean position and edge-length error of everyone on each mesh; none where there is but one.
pub fn mesh_table(contest: &Contest<'_>) -> Option<String> {
    let several = contest.values(|row| &row.mesh).len() > 1;
    several.then(|| both_errors("mesh", contest, |row| row.mesh.clone()))
}

/// Position and edge-length error of everyone, by what `of` says of a run.
fn both_errors(what: &str, contest: &Contest<'_>, of: impl Fn(&Row) -> String) -> String {
    let mut values: Vec<String> = Vec::new();
    for row in contest.subjects().flat_map(|subject| &subject.rows) {
        let value = of(row);
        if !values.contains(&value) {
            values.push(value);
        }
    }
    let mut headings = vec![what.to_owned()];
    headings.extend(contest.names());
    let errors = |subject: &Subject<'_>, value: &str| {
        let here = subject.rows.iter().filter(|row| of(row) == value);
        let here: Vec<&Row> = here.copied().collect();
        match summary(&here).measures {
            Some(m) => format!(
                "{} / {}",
                millimetres(m.position_rmse),
                millimetres(m.edge_length_rmse)
            ),
            None if here.is_empty() => dash(),
            None => "failed".to_owned(),
        }
    };
    let rows: Vec<Cells> = values
        .iter()
        .map(|value| {
            let cells = contest.subjects().map(|subject| errors(subject, value));
            std::iter::once(value.clone()).chain(cells).collect()
        })
        .collect();
    table(&headings, &rows)
}

/// A list of the runs that failed, and why; empty where none did.
pub fn failures(contest: &Contest<'_>) -> String {
    let mut text = String::new();
    for (subject, name) in contest.subjects().zip(contest.names()) {
        for row in &subject.rows {
            if let Some(failure) = &row.failure {
                // Writing to a text cannot fail.
                let _ = writeln!(text, "- {name}, {}: {failure}", row.motion);
            }
        }
    }
    text
}

/// The time of a frame by mesh and contestant.
pub(super) fn times_table(timings: &[Timing]) -> String {
    let headings = headings(&["who", "mesh", "time per frame (ms)"]);
    let cells = |t: &Timing| vec![t.name.clone(), t.mesh.clone(), digits(t.ms_per_frame)];
    let rows: Vec<Cells> = timings.iter().map(cells).collect();
    table(&headings, &rows)
}

fn by_subject(contest: &Contest<'_>, cells: impl Fn(String, &Summary) -> Cells) -> Vec<Cells> {
    let subjects = contest.subjects().zip(contest.names());
    subjects
        .map(|(subject, name)| cells(name, &summary(&subject.rows)))
        .collect()
}

fn dash() -> String {
    "–".to_owned()
}

fn millimetres(metres: f64) -> String {
    digits(1e3 * metres)
}

/// A number with three or four digits that matter.
fn digits(value: f64) -> String {
    match value.abs() {
        1e5.. => format!("{value:.1e}"),
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        1.0.. => format!("{value:.2}"),
        _ => format!("{value:.3}"),
    }
}
