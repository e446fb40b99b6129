//! Tables in Markdown. Lengths are in millimetres with the digits that matter.

use std::collections::BTreeSet;
use std::fmt::Write;

use indexmap::IndexMap;
use selvedge_data::metrics::Character;

use super::ms_per_frame;
use crate::evaluation::{FrameErrors, Kind, Run, Summary, Timing, summaries, time_of};
use crate::numbers::percent;

/// A row of a table.
pub type Cells = Vec<String>;
/// The headings and rows of a table.
pub type Columns = (Vec<String>, Vec<Cells>);

/// A table: the first column to the left, the others to the right.
pub fn table<S: AsRef<str>>(headings: &[S], rows: &[Cells]) -> String {
    let line = |cells: &mut dyn Iterator<Item = &str>| {
        let escaped: Vec<String> = cells.map(escape).collect();
        format!("| {} |\n", escaped.join(" | "))
    };
    let mut text = line(&mut headings.iter().map(AsRef::as_ref));
    text.push_str("|---|");
    text.push_str(&"---:|".repeat(headings.len().saturating_sub(1)));
    text.push('\n');
    for row in rows {
        text.push_str(&line(&mut row.iter().map(String::as_str)));
    }
    text
}

/// A text that is a cell, whatever is in it.
fn escape(text: &str) -> String {
    text.replace('|', "\\|").replace('\n', " ")
}

/// The cases, in words.
pub(super) fn cases(runs: &[Run]) -> String {
    let mut sets: IndexMap<&str, BTreeSet<&str>> = IndexMap::new();
    for run in runs {
        sets.entry(&run.set).or_default().insert(&run.case);
    }
    let words = sets.iter().map(|(set, cases)| match cases.len() {
        1 => format!("{set} (1 case)"),
        count => format!("{set} ({count} cases)"),
    });
    format!("Measured on {}.", words.collect::<Vec<_>>().join(", "))
}

/// Position errors after each number of frames, and over whole runs.
pub fn after(summaries: &[Summary]) -> Columns {
    let frames = summaries.iter().flat_map(|summary| &summary.after);
    let frames: BTreeSet<usize> = frames.map(|at| at.frame).collect();
    let mut headings = vec!["position RMSE (mm)".to_owned()];
    headings.extend(frames.iter().map(|k| format!("k = {k}")));
    headings.push("whole runs".to_owned());
    let position = |at: FrameErrors| Some(millimetres(at.errors?.position_rmse));
    let rows = summaries.iter().map(|summary| {
        let mut cells = vec![named(summary)];
        cells.extend(frames.iter().map(|k| {
            let at = summary.after.iter().find(|at| at.frame == *k).copied();
            at.and_then(position).unwrap_or_else(dash)
        }));
        cells.push(summary.whole.and_then(position).unwrap_or_else(dash));
        cells
    });
    let rows = rows.collect();
    (headings, rows)
}

/// The reference's own error, in words.
pub(super) fn own_error(own: &[(usize, f64)], order: u32) -> String {
    if own.is_empty() {
        return "The error of the reference is unknown: a run with half its substeps failed."
            .to_owned();
    }
    let errors = own
        .iter()
        .map(|(k, error)| format!("{} mm at k = {k}", millimetres(*error)));
    format!(
        "The reference's own error is about {}: its difference from a run with half its substeps \
         from the same starts, over 2ᵖ - 1 with p = {order} (Richardson).",
        errors.collect::<Vec<_>>().join(", ")
    )
}

/// Everything about whole runs.
pub fn whole(summaries: &[Summary]) -> Columns {
    let headings = [
        "method",
        "RMSE (mm)",
        "mean (mm)",
        "largest (mm)",
        "e₃D (%)",
        "edges (mm)",
        "folds",
        "strain",
        "true strain",
        "last second (mm/s)",
        "runs",
        "diverged",
        "corrected",
        "at most (mm)",
    ];
    let shown = summaries.iter().filter(|summary| summary.whole_runs > 0);
    let rows = shown.map(|summary| {
        let mut cells = vec![named(summary)];
        match summary.whole.map(|at| (at, at.errors)) {
            Some((at, Some(errors))) => cells.extend([
                millimetres(errors.position_rmse),
                millimetres(errors.mean_vertex_error),
                millimetres(errors.largest_vertex_error),
                digits(1e2 * errors.relative_error),
                millimetres(errors.edge_length_rmse),
                errors.fold_ratio().map_or_else(dash, digits),
                percent(at.largest_strain),
                percent(errors.true_largest_strain),
            ]),
            Some((at, None)) => {
                cells.extend(vec![dash(); 6]);
                cells.extend([percent(at.largest_strain), dash()]);
            }
            None => cells.extend(vec!["failed".to_owned(); 8]),
        }
        cells.push(summary.final_speed.map_or_else(dash, millimetres));
        cells.extend([summary.whole_runs.to_string(), summary.diverged.to_string()]);
        let guarded = summary.guarded.as_ref();
        cells.push(guarded.map_or_else(dash, |g| percent(g.share())));
        cells.push(guarded.map_or_else(dash, |g| millimetres(g.largest_correction)));
        cells
    });
    (headings.map(str::to_owned).to_vec(), rows.collect())
}

/// The character of whole runs, as ratios to their truths; no rows where nobody knows them.
pub fn character(summaries: &[Summary]) -> Columns {
    let with = summaries
        .iter()
        .filter_map(|summary| Some((summary, summary.ratios?)));
    let rows = with.map(|(summary, ratios)| {
        let ratios = ratios.map(|ratio| ratio.map_or_else(dash, digits));
        std::iter::once(named(summary)).chain(ratios).collect()
    });
    let rows = rows.collect();
    let headings = std::iter::once("ratio to the truth").chain(Character::NAMES);
    (headings.map(str::to_owned).collect(), rows)
}

/// Position / edge-length RMSE of whole runs case by case; empty where there is but one, or no truth.
pub(super) fn by_case(runs: &[Run]) -> String {
    both_errors("case", runs, |run| match run.set.as_str() {
        "scenes" => run.case.clone(),
        set => format!("{set}: {}", run.case),
    })
}

/// The same mesh by mesh.
pub(super) fn by_mesh(runs: &[Run]) -> String {
    both_errors("mesh", runs, |run| run.mesh.clone())
}

fn both_errors(what: &str, runs: &[Run], of: impl Fn(&Run) -> String) -> String {
    let known = runs
        .iter()
        .filter(|run| run.frames.iter().any(|at| at.errors.is_some()));
    let known: Vec<&Run> = known.filter(|run| run.is_whole).collect();
    let mut values: IndexMap<String, Vec<&Run>> = IndexMap::new();
    for &run in &known {
        values.entry(of(run)).or_default().push(run);
    }
    if values.len() < 2 {
        return String::new();
    }
    let methods = summaries(&known);
    let mut headings = vec![what.to_owned()];
    headings.extend(methods.iter().map(named));
    let row = |(value, here): (&String, &Vec<&Run>)| {
        let here = summaries(here);
        let cells = methods.iter().map(|method| {
            let own = here
                .iter()
                .find(|own| own.method == method.method && own.kind == method.kind);
            let errors = own.and_then(|own| own.whole?.errors);
            errors.map_or_else(dash, |errors| {
                let [position, edge] = [errors.position_rmse, errors.edge_length_rmse];
                format!("{} / {}", millimetres(position), millimetres(edge))
            })
        });
        std::iter::once(value.clone()).chain(cells).collect()
    };
    let rows: Vec<Cells> = values.iter().map(row).collect();
    format!(
        "Position / edge-length RMSE of whole runs in mm.\n\n{}",
        table(&headings, &rows)
    )
}

/// A list of the runs that failed, and why; empty where none did.
pub fn failures(runs: &[Run]) -> String {
    let mut text = String::new();
    for run in runs {
        if let Some(failure) = &run.failure {
            let span = if run.is_whole {
                "whole run".to_owned()
            } else {
                format!("from frame {}", run.start)
            };
            // Writing to a text cannot fail.
            let _ = writeln!(text, "- {}, {}, {span}: {failure}", run.method, run.case);
        }
    }
    text
}

/// The time of a frame by mesh and method.
pub(super) fn times(timings: &[Timing]) -> String {
    let cells = |t: &Timing| vec![t.method.clone(), t.mesh.clone(), digits(t.ms_per_frame)];
    let rows: Vec<Cells> = timings.iter().map(cells).collect();
    table(&["method", "mesh", "time per frame (ms)"], &rows)
}

/// The time that the physics needs for the error of each model, over the model's own; empty where
/// there is no model or no physics.
pub(super) fn equal_time(summaries: &[Summary], timings: &[Timing]) -> String {
    let all_of = |kind| summaries.iter().filter(move |summary| summary.kind == kind);
    let physics: Vec<&Summary> = all_of(Kind::Physics).collect();
    let models: Vec<&Summary> = all_of(Kind::Model).collect();
    let frames = models.first().map_or(Vec::new(), |model| {
        model.after.iter().map(|at| at.frame).collect::<Vec<_>>()
    });
    if physics.len() < 2 || frames.is_empty() {
        return String::new();
    }
    let error = |summary: &Summary, frame: usize| {
        let at = summary.after.iter().find(|at| at.frame == frame)?;
        Some(at.errors?.position_rmse)
    };
    let row = |model: &&Summary| {
        let own = ms_per_frame(model, timings);
        let cells = frames.iter().map(|&frame| {
            let points = physics
                .iter()
                .filter_map(|method| Some((ms_per_frame(method, timings)?, error(method, frame)?)));
            let time = time_of(&points.collect::<Vec<_>>(), error(model, frame)?)?;
            Some(digits(time / own?))
        });
        let cells = cells.map(|cell| cell.unwrap_or_else(dash));
        std::iter::once(named(model)).chain(cells).collect()
    };
    let rows: Vec<Cells> = models.iter().map(row).collect();
    let mut headings = vec!["run time of physics at equal error, over the model's".to_owned()];
    headings.extend(frames.iter().map(|k| format!("k = {k}")));
    format!(
        "Between numbers of substeps by a straight line in logarithms; \"–\" where no physics here \
         has so large or so small an error.\n\n{}",
        table(&headings, &rows)
    )
}

/// The name of a method in tables.
pub(super) fn named(summary: &Summary) -> String {
    match summary.kind {
        Kind::Reference => format!("reference ({})", summary.method),
        _ => summary.method.clone(),
    }
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
        0.0 => "0".to_owned(),
        1e5.. => format!("{value:.1e}"),
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        1.0.. => format!("{value:.2}"),
        0.01.. => format!("{value:.3}"),
        _ => format!("{value:.2e}"),
    }
}
