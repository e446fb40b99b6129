//! Models against physics: of the same price, and against the physics that they correct.

use super::super::deviation::Deviation;
use super::super::method::Method;
use super::super::order::price_of;
use super::super::outcome::{CaseOutcome, Outcome, Run, Series};
use super::reading::families;
use super::tables::{DASH, significant};
use crate::report::{Cells, table};

/// The least error of physics at the price of each model, over the model's own; empty where there
/// is no model or no physics.
pub(super) fn at_equal_price(outcome: &Outcome) -> String {
    let settings = &outcome.settings;
    let is_model = |rival: &usize| settings.rivals[*rival].integrator.model().is_some();
    let models: Vec<usize> = (0..settings.rivals.len()).filter(is_model).collect();
    if models.is_empty() || models.len() == settings.rivals.len() {
        return String::new();
    }
    let position = |rival, number| Some(outcome.mean(rival, number)?.position_rmse);
    let whole = |rival| Some(outcome.whole(rival)?.position_rmse);
    let ratio = |rival: usize, error: &dyn Fn(usize) -> Option<f64>| {
        let best = best_at_price(outcome, outcome.ms_per_frame(rival)?, error)?;
        Some(format!("{:.2}", best / error(rival)?))
    };
    let row = |&rival: &usize| -> Cells {
        let numbers = 0..settings.horizons.len();
        let cells = numbers.map(|number| ratio(rival, &|other| position(other, number)));
        let whole = settings.whole.then(|| ratio(rival, &whole));
        let cells = cells
            .chain(whole)
            .map(|cell| cell.unwrap_or_else(|| DASH.to_owned()));
        let name = settings.rivals[rival].to_string();
        std::iter::once(name).chain(cells).collect()
    };
    let mut headings = vec!["times nearer".to_owned()];
    headings.extend(settings.horizons.iter().map(|k| format!("k = {k}")));
    headings.extend(settings.whole.then(|| "whole runs".to_owned()));
    let rows: Vec<Cells> = models.iter().map(row).collect();
    format!(
        "Position error of the best physics at a model's price, over the model's: above 1 the model \
         is nearer. Between its substeps the physics' error is by a straight line in logarithms; \
         \"–\" where none of them is as cheap or as dear.\n\n{}",
        table(&headings, &rows)
    )
}

/// The least error of all integrators at this price; none where none of them has it.
fn best_at_price(
    outcome: &Outcome,
    price: f64,
    error: &dyn Fn(usize) -> Option<f64>,
) -> Option<f64> {
    let rivals = &outcome.settings.rivals;
    let physics = families(rivals).into_iter();
    let physics = physics.filter(|family| family.integrator.model().is_none());
    let errors = physics.filter_map(|family| {
        let points = family.rivals.iter();
        // The price as a function of the error, read the other way round.
        let points =
            points.filter_map(|&rival| Some((error(rival)?, outcome.ms_per_frame(rival)?)));
        price_of(&points.collect::<Vec<_>>(), price)
    });
    errors.min_by(f64::total_cmp)
}

/// A case by a model, by the physics that it corrects alone, and by that with a substep more.
struct Corrected<'a> {
    case: &'a CaseOutcome,
    series: [&'a Series; 3],
}

impl<'a> Corrected<'a> {
    /// None where one of `methods` is not measured.
    fn of(case: &'a CaseOutcome, methods: [&Method; 3]) -> Option<Self> {
        let series = |method: &Method| case.rivals.iter().find(|series| series.method == *method);
        let [model, base, dearer] = methods.map(series);
        Some(Self {
            case,
            series: [model?, base?, dearer?],
        })
    }

    /// Runs of the model that are no farther from the truth than those of the physics alone at the
    /// horizon of this number, of all. One that failed is farther.
    fn no_farther(&self, number: usize) -> Share {
        let [model, base, _] = self.series;
        let error = |run: &Run| {
            let deviation = run.deviations.get(number);
            deviation.map_or(f64::INFINITY, |deviation| deviation.position_rmse)
        };
        let pairs = model.runs.iter().zip(&base.runs);
        let is_near = |(own, base): &(&Run, &Run)| {
            let own = error(own);
            own.is_finite() && own <= error(base)
        };
        Share {
            runs: pairs.clone().filter(is_near).count(),
            of: pairs.count(),
        }
    }

    /// The cells of a table with so many `horizons`.
    fn row(&self, horizons: usize) -> Cells {
        let [model, ..] = self.series;
        let mut row = vec![
            self.case.name.clone(),
            self.case.vertices.to_string(),
            beyond(model),
            percent(model.familiar()),
        ];
        for number in 0..horizons {
            row.push(three(self.means(number), millimetres));
            let Share { runs, of } = self.no_farther(number);
            row.push(format!("{runs} of {of}"));
        }
        row.push(three(self.means(horizons.saturating_sub(1)), folds));
        row
    }

    fn means(&self, number: usize) -> [Option<Deviation>; 3] {
        self.series.map(|series| series.mean(number))
    }
}

/// So many of so many runs.
#[derive(Clone, Copy, Default)]
struct Share {
    runs: usize,
    of: usize,
}

/// A table per model that corrects physics: by case the model, that physics alone, and that with a
/// substep more; empty where there is none.
pub(super) fn corrections(outcome: &Outcome) -> String {
    let methods = outcome.settings.rivals.iter();
    let tables = methods.filter_map(|method| correction(outcome, method));
    let tables: Vec<String> = tables.collect();
    match tables.is_empty() {
        true => String::new(),
        false => format!("{CORRECTIONS}\n\n{}", tables.join("\n\n")),
    }
}

const CORRECTIONS: &str =
    "A model that corrects physics, that physics alone, and the same with one substep more,
which costs about what the model does: \"model / alone / one more\". Position RMSE in mm at the k-th frame;
\"no farther\" are the runs in which the model is no farther from the truth there than the physics
alone. Folds are at the last k, as a part of the truth's. \"Beyond\" is what of a case the model was
not trained on, as its file says before the first frame (\"unknown\" where it does not), and
\"familiar\" the mean part of the vertices that its network knew, where nothing of the correction
fades. The last row is the geometric mean over cases of errors as parts of the physics' alone.";

fn correction(outcome: &Outcome, method: &Method) -> Option<String> {
    let [base, dearer] = method.bases()?;
    let methods = [method, &base, &dearer];
    let cases = outcome.cases.iter();
    let cases: Vec<Corrected<'_>> = cases
        .filter_map(|case| Corrected::of(case, methods))
        .collect();
    if cases.is_empty() {
        return None;
    }
    let mut headings: Vec<String> = ["case", "vertices", "beyond", "familiar"]
        .map(str::to_owned)
        .into();
    for k in &outcome.settings.horizons {
        headings.push(format!("k = {k}"));
        headings.push("no farther".to_owned());
    }
    headings.push("folds".to_owned());
    let horizons = outcome.settings.horizons.len();
    let mut rows: Vec<Cells> = cases.iter().map(|case| case.row(horizons)).collect();
    rows.push(all_of(&cases, horizons));
    rows.push(ratios_of(&cases, horizons));
    let title = format!("{method} / {base} / {dearer}:");
    Some(format!("{title}\n\n{}", table(&headings, &rows)))
}

/// The row of all cases together.
fn all_of(cases: &[Corrected<'_>], horizons: usize) -> Cells {
    let means = |number: usize| {
        [0, 1, 2].map(|place| {
            let all = cases.iter().map(|case| case.means(number)[place]);
            Deviation::pooled(&all.collect::<Option<Vec<_>>>()?)
        })
    };
    let mut row = vec![
        "*all*".to_owned(),
        String::new(),
        String::new(),
        String::new(),
    ];
    for number in 0..horizons {
        let shares = cases.iter().map(|case| case.no_farther(number));
        let all = shares.fold(Share::default(), |all, share| Share {
            runs: all.runs + share.runs,
            of: all.of + share.of,
        });
        row.push(three(means(number), millimetres));
        row.push(percent(Some(all.runs as f64 / all.of.max(1) as f64)));
    }
    row.push(three(means(horizons.saturating_sub(1)), folds));
    row
}

/// The row of all cases as parts of the physics alone: geometric means, in which a case with large
/// errors counts as much as one with small ones.
fn ratios_of(cases: &[Corrected<'_>], horizons: usize) -> Cells {
    let ratio = |number: usize, place: usize| {
        let logarithms = cases.iter().map(|case| {
            let means = case.means(number);
            let [own, base] = [means[place]?, means[1]?].map(|mean| mean.position_rmse);
            Some((own / base).ln())
        });
        let logarithms = logarithms.collect::<Option<Vec<f64>>>()?;
        let mean = logarithms.iter().sum::<f64>() / logarithms.len() as f64;
        mean.is_finite().then(|| mean.exp())
    };
    let mut row = vec!["*times the physics alone*".to_owned()];
    row.resize(4, String::new());
    for number in 0..horizons {
        let ratios = [0, 1, 2].map(|place| match ratio(number, place) {
            Some(ratio) => format!("{ratio:.2}"),
            None => DASH.to_owned(),
        });
        row.push(ratios.join(" / "));
        row.push(String::new());
    }
    row.push(String::new());
    row
}

fn three(means: [Option<Deviation>; 3], cell: fn(Option<Deviation>) -> String) -> String {
    means.map(cell).join(" / ")
}

fn millimetres(deviation: Option<Deviation>) -> String {
    let error = deviation.map(|deviation| significant(1e3 * deviation.position_rmse));
    error.unwrap_or_else(|| "failed".to_owned())
}

fn folds(deviation: Option<Deviation>) -> String {
    let ratio = deviation.and_then(|deviation| deviation.fold_ratio());
    ratio.map_or_else(|| DASH.to_owned(), |ratio| format!("{ratio:.2}"))
}

fn percent(part: Option<f64>) -> String {
    part.map_or_else(|| DASH.to_owned(), |part| format!("{:.1} %", 100.0 * part))
}

/// Names of what of a case a model was not trained on.
fn beyond(series: &Series) -> String {
    match &series.beyond {
        None => "unknown".to_owned(),
        Some(aspects) if aspects.is_empty() => DASH.to_owned(),
        Some(aspects) => {
            let names: Vec<&str> = aspects.iter().map(|aspect| aspect.name()).collect();
            names.join(", ")
        }
    }
}
