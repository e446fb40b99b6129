//! All numbers of a study as CSV: SI units, every digit.

use super::super::deviation::Deviation;
use super::super::method::Method;
use super::super::outcome::{Outcome, Series};
use super::super::whole::WholeRun;
use crate::csv::Csv;

/// A line per case, method and horizon; the case "all" is their mean, and the method that has half
/// the reference's substeps is the second reference run.
pub(super) fn means(outcome: &Outcome) -> String {
    let measures = Deviation::NAMES.join(",");
    let mut csv = Csv::new(&format!(
        "case,integrator,substeps,starts,frames,{measures}"
    ));
    let horizons = || outcome.settings.horizons.iter().enumerate();
    let mut add = |place: Place<'_>, deviation: Option<Deviation>| {
        place.write(&mut csv);
        csv.numbers(deviation.as_ref().map(Deviation::values));
        csv.end();
    };
    for case in &outcome.cases {
        for series in outcome.series(case) {
            for (number, &horizon) in horizons() {
                let starts = case.starts.len();
                let place = Place {
                    case: &case.name,
                    method: &series.method,
                    starts,
                    horizon,
                };
                add(place, series.mean(number));
            }
        }
    }
    let half = outcome.settings.half();
    let starts = outcome.cases.iter().map(|case| case.starts.len()).sum();
    let is_rival = outcome.settings.rivals.contains(&half);
    for (number, &horizon) in horizons().filter(|_| !is_rival) {
        let place = Place {
            case: "all",
            method: &half,
            starts,
            horizon,
        };
        add(place, outcome.half(number));
    }
    for (rival, method) in outcome.settings.rivals.iter().enumerate() {
        for (number, &horizon) in horizons() {
            let place = Place {
                case: "all",
                method,
                starts,
                horizon,
            };
            add(place, outcome.mean(rival, number));
        }
    }
    csv.text()
}

/// The beginning of a line of means.
struct Place<'a> {
    case: &'a str,
    method: &'a Method,
    starts: usize,
    horizon: usize,
}

impl Place<'_> {
    fn write(&self, csv: &mut Csv) {
        csv.texts([self.case, &self.method.integrator.to_string()]);
        csv.number(Some(f64::from(self.method.substeps)));
        csv.number(Some(self.starts as f64));
        csv.number(Some(self.horizon as f64));
    }
}

/// A line per case, method, start and horizon that was reached.
pub(super) fn starts(outcome: &Outcome) -> String {
    let measures = Deviation::NAMES.join(",");
    let head = format!("case,integrator,substeps,start,frames,{measures},familiar,failure");
    let mut csv = Csv::new(&head);
    let mut add = |case: &str, series: &Series| {
        for run in &series.runs {
            for (number, horizon) in outcome.settings.horizons.iter().enumerate() {
                let deviation = run.deviations.get(number);
                csv.texts([case, &series.method.integrator.to_string()]);
                csv.number(Some(f64::from(series.method.substeps)));
                csv.number(Some(run.start as f64));
                csv.number(Some(*horizon as f64));
                csv.numbers(deviation.map(Deviation::values));
                csv.number(run.familiar);
                let failure = run.failure.as_deref().filter(|_| deviation.is_none());
                csv.texts([failure.unwrap_or_default()]);
                csv.end();
            }
        }
    };
    for case in &outcome.cases {
        for series in outcome.series(case) {
            add(&case.name, series);
        }
    }
    csv.text()
}

/// A line per case and method with a whole run; the case "all" is their mean.
pub(super) fn wholes(outcome: &Outcome) -> String {
    let measures = WholeRun::NAMES.join(",");
    let mut csv = Csv::new(&format!("case,integrator,substeps,{measures},failure"));
    let mut add = |case: &str, method: &Method, run: Option<WholeRun>, failure: &str| {
        csv.texts([case, &method.integrator.to_string()]);
        csv.number(Some(f64::from(method.substeps)));
        csv.numbers(run.as_ref().map(WholeRun::values));
        csv.texts([failure]);
        csv.end();
    };
    if outcome.settings.whole {
        for case in &outcome.cases {
            for series in outcome.series(case) {
                let failure = series.whole.as_ref().and_then(|run| run.as_ref().err());
                let failure = failure.map_or("", String::as_str);
                add(&case.name, &series.method, series.whole(), failure);
            }
        }
        for (rival, method) in outcome.settings.rivals.iter().enumerate() {
            add("all", method, outcome.whole(rival), "");
        }
    }
    csv.text()
}

/// A line per case and method.
pub(super) fn times(outcome: &Outcome) -> String {
    let mut csv = Csv::new("case,integrator,substeps,ms_per_frame");
    for case in &outcome.cases {
        for series in &case.rivals {
            csv.texts([&case.name, &series.method.integrator.to_string()]);
            csv.number(Some(f64::from(series.method.substeps)));
            csv.number(series.ms_per_frame);
            csv.end();
        }
    }
    csv.text()
}
