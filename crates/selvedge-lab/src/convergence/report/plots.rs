//! Plots of a study: errors by substeps and by the time of a frame, a line per integrator.

use selvedge_view::plot::{Axis, Line, LineChart, PlotError, Role, Scale};

use super::super::outcome::{Measure, Outcome};
use super::reading::{Family, families, own};
use crate::report::{Plot, both_forms};

/// Position errors at the horizon of this number by substeps, beside the reference's own.
///
/// # Errors
/// A value that is not finite.
pub(super) fn by_substeps(outcome: &Outcome, number: usize) -> Result<Option<Plot>, PlotError> {
    let price = |rival: usize| Some(f64::from(outcome.settings.rivals[rival].substeps));
    let mut chart = chart(outcome, number, price);
    "substeps per frame".clone_into(&mut chart.x.label);
    chart.title.push_str(" by substeps");
    both_forms(&chart)
}

/// Position errors at the horizon of this number by the time of a frame.
///
/// # Errors
/// A value that is not finite.
pub(super) fn by_time(outcome: &Outcome, number: usize) -> Result<Option<Plot>, PlotError> {
    let mut chart = chart(outcome, number, |rival| outcome.ms_per_frame(rival));
    "time of a frame (ms)".clone_into(&mut chart.x.label);
    chart.title.push_str(" by the time of a frame");
    both_forms(&chart)
}

/// A line per integrator through its rivals by their `price`.
fn chart(outcome: &Outcome, number: usize, price: impl Fn(usize) -> Option<f64>) -> LineChart {
    let settings = &outcome.settings;
    let error = |rival: usize| Some(1e3 * outcome.mean(rival, number)?.position_rmse);
    let point = |&rival: &usize| Some([price(rival)?, error(rival)?]);
    let line = |family: Family<'_>| Line {
        name: family.integrator.to_string(),
        role: Role::Subject,
        points: family.rivals.iter().filter_map(point).collect(),
    };
    let families = families(&settings.rivals).into_iter();
    let mut lines: Vec<Line> = families.map(line).collect();
    let prices = || lines.iter().flat_map(|line| &line.points).map(|p| p[0]);
    let ends = [
        prices().fold(f64::INFINITY, f64::min),
        prices().fold(0.0, f64::max),
    ];
    let own = own(outcome, number, Measure::Position);
    // A line needs a place from left to right.
    if let Some(error) = own.filter(|_| ends[0] < ends[1]) {
        lines.push(Line {
            name: "the reference".to_owned(),
            role: Role::Rival,
            points: ends.map(|end| [end, 1e3 * error]).to_vec(),
        });
    }
    let axis = |label: &str| Axis {
        label: label.to_owned(),
        scale: Scale::Logarithmic,
    };
    LineChart {
        title: format!("Position error at frame {}", settings.horizons[number]),
        x: axis(""),
        y: axis("position RMSE (mm)"),
        lines,
    }
}
