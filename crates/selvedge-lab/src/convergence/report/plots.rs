//! Plots of a study: errors by substeps and by the time of a frame, a line per integrator.

use selvedge_view::plot::{Axis, Line, LineChart, PlotError, Role, Scale};

use super::super::outcome::{Measure, Outcome};
use super::reading::{Family, families, own};
use crate::report::drawn;

/// Position errors at the horizon of this number by substeps, beside the reference's own.
///
/// # Errors
/// A value that is not finite.
pub(super) fn by_substeps(outcome: &Outcome, number: usize) -> Result<Option<String>, PlotError> {
    let price = |rival: usize| Some(f64::from(outcome.settings.rivals[rival].substeps));
    let mut chart = chart(outcome, number, price);
    "substeps per frame".clone_into(&mut chart.x.label);
    chart.title.push_str(" by substeps");
    drawn(&chart)
}

/// Position errors at the horizon of this number by the time of a frame.
///
/// # Errors
/// A value that is not finite.
pub(super) fn by_time(outcome: &Outcome, number: usize) -> Result<Option<String>, PlotError> {
    let mut chart = chart(outcome, number, |rival| outcome.ms_per_frame(rival));
    "time of a frame (ms)".clone_into(&mut chart.x.label);
    chart.title.push_str(" by the time of a frame");
    drawn(&chart)
}

/// Position errors of whole runs by the time of a frame; none where none were asked for.
///
/// # Errors
/// A value that is not finite.
pub(super) fn wholes(outcome: &Outcome) -> Result<Option<String>, PlotError> {
    let error = |rival| Some(1e3 * outcome.whole(rival)?.position_rmse);
    let lines = lines(outcome, |rival| outcome.ms_per_frame(rival), error);
    by_time_of(
        lines,
        "Position error of whole runs",
        logarithmic("position RMSE (mm)"),
    )
}

/// Folds at the last horizon, as a part of the truth's, by the time of a frame.
///
/// # Errors
/// A value that is not finite.
pub(super) fn folds(outcome: &Outcome) -> Result<Option<String>, PlotError> {
    let horizons = &outcome.settings.horizons;
    let (Some(last), Some(k)) = (horizons.len().checked_sub(1), horizons.last()) else {
        return Ok(None);
    };
    let ratio = |rival| outcome.mean(rival, last)?.fold_ratio();
    fold_chart(outcome, ratio, &format!("Folds at frame {k}"))
}

/// The same over whole runs; none where none were asked for.
///
/// # Errors
/// A value that is not finite.
pub(super) fn whole_folds(outcome: &Outcome) -> Result<Option<String>, PlotError> {
    let ratio = |rival| outcome.whole(rival)?.fold_ratio();
    fold_chart(outcome, ratio, "Folds of whole runs")
}

fn fold_chart(
    outcome: &Outcome,
    ratio: impl Fn(usize) -> Option<f64>,
    title: &str,
) -> Result<Option<String>, PlotError> {
    let mut lines = lines(outcome, |rival| outcome.ms_per_frame(rival), ratio);
    across(&mut lines, "the truth", Some(1.0));
    let y = Axis {
        label: "mean |dihedral angle| / the truth's".to_owned(),
        scale: Scale::Linear,
    };
    by_time_of(lines, title, y)
}

fn by_time_of(lines: Vec<Line>, title: &str, y: Axis) -> Result<Option<String>, PlotError> {
    if lines.iter().all(|line| line.points.is_empty()) {
        return Ok(None);
    }
    drawn(&LineChart {
        title: format!("{title} by the time of a frame"),
        x: logarithmic("time of a frame (ms)"),
        y,
        lines,
    })
}

fn logarithmic(label: &str) -> Axis {
    Axis {
        label: label.to_owned(),
        scale: Scale::Logarithmic,
    }
}

/// Position errors at the horizon of this number by their `price`.
fn chart(outcome: &Outcome, number: usize, price: impl Fn(usize) -> Option<f64>) -> LineChart {
    let error = |rival: usize| Some(1e3 * outcome.mean(rival, number)?.position_rmse);
    let mut lines = lines(outcome, price, error);
    let own = own(outcome, number, Measure::Position);
    across(&mut lines, "the reference", own.map(|error| 1e3 * error));
    let k = outcome.settings.horizons[number];
    LineChart {
        title: format!("Position error at frame {k}"),
        x: logarithmic(""),
        y: logarithmic("position RMSE (mm)"),
        lines,
    }
}

/// A line per integrator through the values of its rivals by their `price`.
fn lines(
    outcome: &Outcome,
    price: impl Fn(usize) -> Option<f64>,
    value: impl Fn(usize) -> Option<f64>,
) -> Vec<Line> {
    let point = |&rival: &usize| Some([price(rival)?, value(rival)?]);
    let line = |family: Family<'_>| Line {
        name: family.integrator.to_string(),
        role: Role::Subject,
        points: family.rivals.iter().filter_map(point).collect(),
    };
    let families = families(&outcome.settings.rivals).into_iter();
    families.map(line).collect()
}

/// Adds a level line from the cheapest rival to the dearest.
fn across(lines: &mut Vec<Line>, name: &str, height: Option<f64>) {
    let prices = || lines.iter().flat_map(|line| &line.points).map(|p| p[0]);
    let ends = [
        prices().fold(f64::INFINITY, f64::min),
        prices().fold(0.0, f64::max),
    ];
    // A line needs a place from left to right.
    if let Some(height) = height.filter(|_| ends[0] < ends[1]) {
        lines.push(Line {
            name: name.to_owned(),
            role: Role::Rival,
            points: ends.map(|end| [end, height]).to_vec(),
        });
    }
}
