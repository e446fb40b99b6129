//! Tables of a study in Markdown.

use super::super::deviation::Deviation;
use super::super::method::Method;
use super::super::order::{observed_order, price_of};
use super::super::outcome::{CaseOutcome, Measure, Outcome};
use super::super::whole::WholeRun;
use super::reading::{Found, families, found, own, shown};
use crate::report::{Cells, table};

pub(super) const DASH: &str = "–";

/// A number with three digits that matter.
pub(super) fn significant(value: f64) -> String {
    match value.abs() {
        0.0 => "0".to_owned(),
        1e5.. => format!("{value:.1e}"),
        100.0.. => format!("{value:.0}"),
        10.0.. => format!("{value:.1}"),
        1.0.. => format!("{value:.2}"),
        0.1.. => format!("{value:.3}"),
        0.01.. => format!("{value:.4}"),
        _ => format!("{value:.2e}"),
    }
}

/// Units of a measure in tables.
fn scale(measure: Measure) -> f64 {
    match measure {
        Measure::Position | Measure::Velocity | Measure::EdgeLength => 1e3,
        Measure::Fold => 1_f64.to_degrees(),
    }
}

fn headings(outcome: &Outcome, first: &str) -> Vec<String> {
    let horizons = outcome.settings.horizons.iter();
    let columns = horizons.map(|k| format!("k = {k}"));
    std::iter::once(first.to_owned()).chain(columns).collect()
}

/// A row per rival, a cell per horizon, as `cell` says of the rival's and the horizon's number.
fn by_rival(outcome: &Outcome, cell: impl Fn(usize, usize) -> Option<String>) -> Vec<Cells> {
    let rivals = outcome.settings.rivals.iter().enumerate();
    let horizons = outcome.settings.horizons.len();
    let row = |(rival, method): (usize, &Method)| {
        let cells = (0..horizons).map(|number| cell(rival, number));
        let cells = cells.map(|cell| cell.unwrap_or_else(|| "failed".to_owned()));
        std::iter::once(method.to_string()).chain(cells).collect()
    };
    rivals.map(row).collect()
}

/// Errors by rival and horizon; positions with the time of a frame.
pub(super) fn errors(outcome: &Outcome, measure: Measure) -> String {
    let mut headings = headings(outcome, "physics");
    let text = |found: Found| {
        let mark = if found.is_its_own { "" } else { "*" };
        format!("{}{mark}", significant(scale(measure) * found.error))
    };
    let cell = |rival, number| found(outcome, rival, number, measure).map(text);
    let mut rows = by_rival(outcome, cell);
    let numbers = 0..outcome.settings.horizons.len();
    let own = numbers.map(|number| match own(outcome, number, measure) {
        Some(error) => significant(scale(measure) * error),
        None => DASH.to_owned(),
    });
    let name = format!("*the reference itself, {}*", outcome.settings.reference);
    rows.push(std::iter::once(name).chain(own).collect());
    if measure == Measure::Position {
        headings.push("ms per frame".to_owned());
        for (rival, row) in rows.iter_mut().enumerate() {
            let time = outcome.ms_per_frame(rival);
            row.push(time.map_or_else(|| DASH.to_owned(), significant));
        }
    }
    table(&headings, &rows)
}

/// Errors of whole runs and folds beside the time of a frame, by rival: the comparison in short.
pub(super) fn overview(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let shown = shown(settings);
    let Some(&last) = shown.last() else {
        return String::new();
    };
    let mut headings = vec!["physics".to_owned(), "ms per frame".to_owned()];
    headings.extend(
        shown
            .iter()
            .map(|&n| format!("k = {}", settings.horizons[n])),
    );
    headings.push(format!("folds, k = {}", settings.horizons[last]));
    if settings.whole {
        headings.extend(["whole runs", "folds, whole runs"].map(str::to_owned));
    }
    let ratio = |ratio: Option<f64>| ratio.map(|ratio| format!("{ratio:.3}"));
    let row = |(rival, method): (usize, &Method)| {
        let time = outcome.ms_per_frame(rival).map(significant);
        let mut cells = vec![Some(method.to_string()), time];
        cells.extend(shown.iter().map(|&number| {
            let deviation = outcome.mean(rival, number)?;
            Some(significant(1e3 * deviation.position_rmse))
        }));
        let at_last = outcome.mean(rival, last);
        cells.push(ratio(at_last.and_then(|deviation| deviation.fold_ratio())));
        if settings.whole {
            let whole = outcome.whole(rival);
            cells.push(whole.map(|run| significant(1e3 * run.position_rmse)));
            cells.push(ratio(whole.and_then(|run| run.fold_ratio())));
        }
        let cells = cells.into_iter();
        cells
            .map(|cell| cell.unwrap_or_else(|| DASH.to_owned()))
            .collect()
    };
    let rows: Vec<Cells> = settings.rivals.iter().enumerate().map(row).collect();
    table(&headings, &rows)
}

/// Whole runs by rival; empty where none were asked for.
pub(super) fn wholes(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    if !settings.whole {
        return String::new();
    }
    let headings = [
        "physics",
        "position RMSE (mm)",
        "edge-length RMSE (mm)",
        "folds",
        "largest strain",
        "the truth's",
    ];
    let row = |name: String, run: Option<WholeRun>| -> Cells {
        let failed = || vec!["failed".to_owned(); headings.len() - 1];
        let cells = run.map_or_else(failed, |run| {
            let strains = [run.largest_strain, run.true_largest_strain];
            let strains = strains.map(|strain| format!("{:.1} %", 100.0 * strain));
            let ratio = run.fold_ratio();
            let mut cells = vec![
                significant(1e3 * run.position_rmse),
                significant(1e3 * run.edge_length_rmse),
                ratio.map_or_else(|| DASH.to_owned(), |ratio| format!("{ratio:.3}")),
            ];
            cells.extend(strains);
            cells
        });
        std::iter::once(name).chain(cells).collect()
    };
    let rivals = settings.rivals.iter().enumerate();
    let rows = rivals.map(|(rival, method)| row(method.to_string(), outcome.whole(rival)));
    let mut rows: Vec<Cells> = rows.collect();
    let half = settings.half();
    if !settings.rivals.contains(&half) {
        rows.push(row(format!("*{half}*"), outcome.half_whole()));
    }
    table(&headings.map(str::to_owned), &rows)
}

/// A ratio to the truth by rival and horizon.
pub(super) fn ratios(outcome: &Outcome, of: impl Fn(&Deviation) -> Option<f64>) -> String {
    let cell = |rival, number| {
        let deviation = outcome.mean(rival, number)?;
        let ratio = of(&deviation);
        Some(ratio.map_or_else(|| DASH.to_owned(), |ratio| format!("{ratio:.2}")))
    };
    table(&headings(outcome, "physics"), &by_rival(outcome, cell))
}

/// Differences of energies by rival and horizon.
pub(super) fn energies(outcome: &Outcome) -> String {
    let cell = |rival, number| {
        let deviation = outcome.mean(rival, number)?;
        Some(significant(1e3 * deviation.energy_difference))
    };
    table(&headings(outcome, "physics"), &by_rival(outcome, cell))
}

/// The observed order by integrator, measure and horizon.
pub(super) fn orders(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let mut rows: Vec<Cells> = Vec::new();
    for family in families(&settings.rivals) {
        for measure in Measure::ALL {
            let cell = |number: usize| {
                let errors = family.rivals.iter().filter_map(|&rival| {
                    let found = found(outcome, rival, number, measure)?;
                    let substeps = settings.rivals[rival].substeps;
                    found.is_its_own.then_some((substeps, found.error))
                });
                let order = observed_order(&errors.collect::<Vec<_>>());
                order.map_or_else(|| DASH.to_owned(), |order| format!("{order:.2}"))
            };
            let name = match measure {
                Measure::Position => "positions",
                Measure::Velocity => "velocities",
                Measure::Fold => "folds",
                Measure::EdgeLength => "edges",
            };
            let first = format!("{}, {name}", family.integrator);
            let cells = (0..settings.horizons.len()).map(cell);
            rows.push(std::iter::once(first).chain(cells).collect());
        }
    }
    table(&headings(outcome, "order"), &rows)
}

/// The price of the error of every rival by the first integrator, as a multiple of the rival's own.
/// Empty where there is one integrator.
pub(super) fn prices(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let families = families(&settings.rivals);
    let [first, others @ ..] = families.as_slice() else {
        return String::new();
    };
    if others.is_empty() {
        return String::new();
    }
    let point = |rival: usize, number: usize| {
        let found = found(outcome, rival, number, Measure::Position)?;
        Some((outcome.ms_per_frame(rival)?, found.error))
    };
    let mut rows: Vec<Cells> = Vec::new();
    for &rival in others.iter().flat_map(|family| &family.rivals) {
        let cell = |number: usize| {
            let all = first.rivals.iter();
            let points: Vec<(f64, f64)> = all.filter_map(|&r| point(r, number)).collect();
            let (own, error) = point(rival, number)?;
            Some(format!("{:.1}", price_of(&points, error)? / own))
        };
        let cells = (0..settings.horizons.len()).map(cell);
        let cells = cells.map(|cell| cell.unwrap_or_else(|| DASH.to_owned()));
        let name = settings.rivals[rival].to_string();
        rows.push(std::iter::once(name).chain(cells).collect());
    }
    let table = table(&headings(outcome, "times cheaper"), &rows);
    format!(
        "Milliseconds that {} needs for the same position error, over the method's own; between \
         its substeps by a straight line in logarithms. \"–\" where none of its errors is as large \
         or as small.\n\n{table}",
        first.integrator
    )
}

/// Position errors by case and rival at the middle horizon.
pub(super) fn cases(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let shown = shown(settings);
    let number = shown[shown.len() / 2];
    let names = settings.rivals.iter().map(ToString::to_string);
    let headings: Vec<String> = std::iter::once("case".to_owned()).chain(names).collect();
    let row = |case: &CaseOutcome| {
        let cells = case.rivals.iter().map(|series| match series.mean(number) {
            Some(deviation) => significant(1e3 * deviation.position_rmse),
            None => "failed".to_owned(),
        });
        std::iter::once(case.name.clone()).chain(cells).collect()
    };
    let rows: Vec<Cells> = outcome.cases.iter().map(row).collect();
    format!(
        "Position RMSE in mm at k = {}.\n\n{}",
        settings.horizons[number],
        table(&headings, &rows)
    )
}

/// A list of the runs that failed, and why; empty where none did.
pub(super) fn failures(outcome: &Outcome) -> String {
    let mut text = String::new();
    for case in &outcome.cases {
        for series in outcome.series(case) {
            for run in &series.runs {
                if let Some(failure) = &run.failure {
                    let (method, start) = (&series.method, run.start);
                    let place = format!("{}, {method}, from frame {start}", case.name);
                    text.push_str(&format!("- {place}: {failure}\n"));
                }
            }
            if let Some(Err(failure)) = &series.whole {
                let place = format!("{}, {}, whole run", case.name, series.method);
                text.push_str(&format!("- {place}: {failure}\n"));
            }
        }
    }
    text
}
