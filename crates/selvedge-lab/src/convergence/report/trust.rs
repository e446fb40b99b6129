//! Errors by trust: whether runs of which a network knew less of the cloth end farther from the
//! truth.

use selvedge_view::plot::{Axis, Line, LineChart, PlotError, Role, Scale};

use super::super::method::Method;
use super::super::outcome::Outcome;
use super::tables::{DASH, significant};
use crate::report::{Cells, drawn, table};

/// Groups of runs, by the part of the vertices that was familiar.
const GROUPS: usize = 5;

pub(super) const TRUST: &str =
    "All runs of a model from true states, in five groups by the mean part of the vertices that its
network knew: what it says before anyone knows the truth. Geometric mean of the position RMSE in mm
at the k-th frame. The last row is Spearman's rank correlation of errors with that part over all
runs: -1 where each run that was less familiar is farther off, 0 where it says nothing.";

/// A run: the familiar part of the vertices, and its position error `[m]`.
#[derive(Clone, Copy)]
struct Told {
    familiar: f64,
    error: f64,
}

/// Runs that are about as familiar as each other.
struct Group {
    runs: usize,
    familiar: f64,
    /// Geometric mean `[m]`.
    error: f64,
}

/// A table per model that says what it knows; empty where there is none, or too few runs.
pub(super) fn tables(outcome: &Outcome) -> String {
    let methods = outcome.settings.rivals.iter();
    let tables = methods.filter_map(|method| of_method(outcome, method));
    tables.collect::<Vec<_>>().join("\n\n")
}

/// Errors of the first such model by the unfamiliar part of the vertices, a line per horizon; none
/// where there is no such model.
///
/// # Errors
/// A value that is not finite.
pub(super) fn plot(outcome: &Outcome) -> Result<Option<String>, PlotError> {
    let settings = &outcome.settings;
    for method in &settings.rivals {
        let lines = settings
            .horizons
            .iter()
            .enumerate()
            .map(|(number, k)| Line {
                name: format!("frame {k}"),
                role: Role::Subject,
                points: grouped(&told(outcome, method, number))
                    .iter()
                    .rev()
                    .map(|group| [100.0 * (1.0 - group.familiar), 1e3 * group.error])
                    .collect(),
            });
        let lines: Vec<Line> = lines.filter(|line| !line.points.is_empty()).collect();
        if !lines.is_empty() {
            return drawn(&LineChart {
                title: format!("Errors of {method} by trust"),
                x: Axis {
                    label: "vertices that the network does not know (%)".to_owned(),
                    scale: Scale::Linear,
                },
                y: Axis {
                    label: "position RMSE (mm)".to_owned(),
                    scale: Scale::Logarithmic,
                },
                lines,
            });
        }
    }
    Ok(None)
}

fn of_method(outcome: &Outcome, method: &Method) -> Option<String> {
    let horizons = &outcome.settings.horizons;
    let all: Vec<Vec<Told>> = (0..horizons.len())
        .map(|number| told(outcome, method, number))
        .collect();
    let columns: Vec<Vec<Group>> = all.iter().map(|runs| grouped(runs)).collect();
    if columns.first()?.is_empty() {
        return None;
    }
    let mut headings = vec!["familiar".to_owned(), "runs".to_owned()];
    headings.extend(horizons.iter().map(|k| format!("k = {k}")));
    let mut rows: Vec<Cells> = (0..GROUPS)
        .map(|place| {
            let first = &columns[0][place];
            let errors = columns.iter().map(|groups| match groups.get(place) {
                Some(group) => significant(1e3 * group.error),
                None => DASH.to_owned(),
            });
            let told = [
                format!("{:.1} %", 100.0 * first.familiar),
                first.runs.to_string(),
            ];
            told.into_iter().chain(errors).collect()
        })
        .collect();
    let correlations = all.iter().map(|runs| match correlation(runs) {
        Some(correlation) => format!("{correlation:.2}"),
        None => DASH.to_owned(),
    });
    let last = ["*rank correlation*".to_owned(), all[0].len().to_string()];
    rows.push(last.into_iter().chain(correlations).collect());
    Some(format!("{method}:\n\n{}", table(&headings, &rows)))
}

/// The runs of a method that came to the horizon of this number, the least familiar first.
fn told(outcome: &Outcome, method: &Method, number: usize) -> Vec<Told> {
    let series = outcome.cases.iter().flat_map(|case| &case.rivals);
    let runs = series
        .filter(|series| series.method == *method)
        .flat_map(|series| &series.runs);
    let mut all: Vec<Told> = runs
        .filter_map(|run| {
            let error = run.deviations.get(number)?.position_rmse;
            let familiar = run.familiar?;
            (error.is_finite() && error > 0.0).then_some(Told { familiar, error })
        })
        .collect();
    all.sort_by(|a, b| a.familiar.total_cmp(&b.familiar));
    all
}

/// Groups of `runs`, which are in order; none where they are too few for one run each.
fn grouped(runs: &[Told]) -> Vec<Group> {
    if runs.len() < GROUPS {
        return Vec::new();
    }
    let group = |place: usize| {
        let [from, to] = [place, place + 1].map(|place| place * runs.len() / GROUPS);
        let runs = &runs[from..to];
        let mean = |of: fn(&Told) -> f64| runs.iter().map(of).sum::<f64>() / runs.len() as f64;
        Group {
            runs: runs.len(),
            familiar: mean(|run| run.familiar),
            error: mean(|run| run.error.ln()).exp(),
        }
    };
    (0..GROUPS).map(group).collect()
}

/// Spearman's rank correlation of error and familiar part; none where one of them is the same in
/// all runs.
fn correlation(runs: &[Told]) -> Option<f64> {
    let values = |of: fn(&Told) -> f64| runs.iter().map(of).collect::<Vec<f64>>();
    let familiar = ranks(&values(|run| run.familiar));
    let errors = ranks(&values(|run| run.error));
    let mean = (runs.len() as f64 - 1.0) / 2.0;
    let product = |a: &[f64], b: &[f64]| {
        let pairs = a.iter().zip(b);
        pairs.map(|(a, b)| (a - mean) * (b - mean)).sum::<f64>()
    };
    let spread = product(&familiar, &familiar) * product(&errors, &errors);
    (spread > 0.0).then(|| product(&familiar, &errors) / spread.sqrt())
}

/// Ranks from 0; equal values share the mean of theirs.
fn ranks(values: &[f64]) -> Vec<f64> {
    let rank = |value: &f64| {
        let less = values.iter().filter(|other| *other < value).count();
        let equal = values.iter().filter(|other| *other == value).count();
        less as f64 + (equal as f64 - 1.0) / 2.0
    };
    values.iter().map(rank).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn runs(pairs: &[(f64, f64)]) -> Vec<Told> {
        let told = |&(familiar, error)| Told { familiar, error };
        pairs.iter().map(told).collect()
    }

    #[test]
    fn correlations_are_those_of_ranks() {
        let falling = runs(&[(0.1, 9.0), (0.2, 8.0), (0.9, 0.1), (1.0, 0.01)]);
        assert!((correlation(&falling).unwrap() + 1.0).abs() < 1e-12);
        let rising = runs(&[(0.1, 1.0), (0.2, 2.0), (0.3, 1e6)]);
        assert!((correlation(&rising).unwrap() - 1.0).abs() < 1e-12);
        // Ranks 0, 1.5, 1.5, 3 and 0, 2, 1, 3: 4.5/√(4.5 · 5).
        let tied = runs(&[(0.1, 1.0), (0.5, 3.0), (0.5, 2.0), (0.9, 4.0)]);
        let expected = 4.5 / (4.5_f64 * 5.0).sqrt();
        assert!((correlation(&tied).unwrap() - expected).abs() < 1e-12);
        assert_eq!(correlation(&runs(&[(0.5, 1.0), (0.5, 2.0)])), None);
        assert_eq!(correlation(&[]), None);
    }

    #[test]
    fn groups_share_the_runs_and_have_geometric_means() {
        let pairs: Vec<(f64, f64)> = (0..10)
            .map(|k| (f64::from(k) / 10.0, f64::from(10 - k)))
            .collect();
        let groups = grouped(&runs(&pairs));
        assert_eq!(groups.len(), GROUPS);
        assert!(groups.iter().all(|group| group.runs == 2));
        assert!((groups[0].familiar - 0.05).abs() < 1e-12);
        assert!((groups[0].error - 90.0_f64.sqrt()).abs() < 1e-12);
        assert!(grouped(&runs(&pairs[..4])).is_empty());
    }
}
