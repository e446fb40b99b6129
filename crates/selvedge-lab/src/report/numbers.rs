//! All numbers as CSV: SI units, every digit. A number that is not there is an empty field.

use std::io::Write;
use std::path::Path;

use selvedge_data::{WriteError, write_atomically};

use crate::evaluation::{Errors, FrameErrors, Run, Timing};

/// A row for each run and frame in which it was measured; one without a frame for a run that failed
/// before.
pub fn errors_csv(runs: &[Run]) -> Vec<u8> {
    let head = [
        "set", "case", "mesh", "method", "kind", "start", "whole", "frame",
    ];
    let end = [
        "diverged_frame",
        "final_speed",
        "frames_corrected",
        "frames_lost",
        "largest_correction",
        "failure",
    ];
    let measures = Errors::NAMES.iter().copied();
    let head = head.into_iter().chain(["largest_strain"]);
    let head = head.chain(measures).chain(end);
    let rows = runs.iter().flat_map(|run| {
        if run.frames.is_empty() {
            vec![row(run, None)]
        } else {
            run.frames.iter().map(|at| row(run, Some(at))).collect()
        }
    });
    csv_of(head, rows)
}

fn row(run: &Run, at: Option<&FrameErrors>) -> Vec<String> {
    let number = |value: Option<f64>| value.map_or_else(String::new, |value| value.to_string());
    let count = |value: Option<usize>| value.map_or_else(String::new, |value| value.to_string());
    let kind = serde_json::to_value(run.kind).unwrap_or_default();
    let mut row = vec![
        run.set.clone(),
        run.case.clone(),
        run.mesh.clone(),
        run.method.clone(),
        kind.as_str().unwrap_or_default().to_owned(),
        run.start.to_string(),
        run.is_whole.to_string(),
        count(at.map(|at| at.frame)),
        number(at.map(|at| at.largest_strain)),
    ];
    match at.and_then(|at| at.errors) {
        Some(errors) => row.extend(errors.values().into_iter().map(|value| number(Some(value)))),
        None => row.extend(vec![String::new(); Errors::NAMES.len()]),
    }
    row.extend([
        count(run.diverged_frame),
        number(run.final_speed),
        count(run.guarded.map(|guarded| guarded.corrected)),
        count(run.guarded.map(|guarded| guarded.lost)),
        number(run.guarded.map(|guarded| guarded.largest_correction)),
        run.failure.clone().unwrap_or_default(),
    ]);
    row
}

/// Writes [`errors_csv`].
pub fn write_errors(path: &Path, runs: &[Run]) -> Result<(), WriteError> {
    let text = errors_csv(runs);
    write_atomically(path, |out| out.write_all(&text))
}

/// A row for each method and mesh.
pub(super) fn times_csv(timings: &[Timing]) -> Vec<u8> {
    let row = |timing: &Timing| {
        let ms = timing.ms_per_frame.to_string();
        vec![timing.method.clone(), timing.mesh.clone(), ms]
    };
    csv_of(["method", "mesh", "ms_per_frame"], timings.iter().map(row))
}

/// A table as CSV.
pub(crate) fn csv_of<'a>(
    head: impl IntoIterator<Item = &'a str>,
    rows: impl Iterator<Item = Vec<String>>,
) -> Vec<u8> {
    let mut csv = csv::Writer::from_writer(Vec::new());
    // Writing to memory cannot fail, nor can rows of one length.
    let _ = csv.write_record(head);
    for row in rows {
        let _ = csv.write_record(row);
    }
    csv.into_inner().unwrap_or_default()
}
