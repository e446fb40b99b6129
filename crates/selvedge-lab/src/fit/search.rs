//! L-BFGS within a box: the matrix is that of the crate `lbfgs`, steps are projected (Bertsekas 1982)
//! and shortened until the value falls by enough (Armijo 1966).

use lbfgs::Lbfgs;

use super::identifiability::eigen;

/// Pairs that the matrix is made of.
const PAIRS: usize = 12;
/// Longest step of any coordinate.
const LONGEST: f64 = 0.3;
/// Part of the expected fall that a step must reach.
const ENOUGH: f64 = 1e-4;
/// Part of its value to which a search falls before it asks for its metric anew.
const FALLEN: f64 = 0.1;
/// Steps that are tried along a direction, and the relative fall below which two steps end the search.
const TRIES: usize = 8;
const STILL: f64 = 1e-3;

/// A place in the box of [0, 1], its value, and the derivatives of that.
#[derive(Debug)]
pub(super) struct Point {
    pub(super) at: Vec<f64>,
    pub(super) value: f64,
    pub(super) slope: Vec<f64>,
}

/// The matrix of second derivatives that a search begins from: V Λ Vᵀ, by the rows of Λ^½ Vᵀ, which
/// takes places to those of the search, and of Λ^-½ Vᵀ, which takes slopes there.
pub(super) struct Metric([Vec<Vec<f64>>; 2]);

impl Metric {
    /// A symmetric matrix. No eigenvalue is below that of a parabola which falls by the whole `value` from
    /// the middle of the box to its border: far from the least value a matrix knows no better.
    pub(super) fn of(matrix: Vec<Vec<f64>>, value: f64) -> Self {
        let least = (8.0 * value).max(f64::MIN_POSITIVE);
        let found = eigen(matrix).into_iter();
        let found = found.map(|(own, way)| (own.max(least).sqrt(), way));
        let found: Vec<_> = found.collect();
        let rows = |power: i32| {
            let row =
                |(root, way): &(f64, Vec<f64>)| way.iter().map(|w| w * root.powi(power)).collect();
            found.iter().map(row).collect()
        };
        Self([rows(1), rows(-1)])
    }

    fn places(&self, at: &[f64]) -> Vec<f64> {
        self.0[0].iter().map(|row| dot(row, at)).collect()
    }

    fn slopes(&self, slope: &[f64]) -> Vec<f64> {
        self.0[1].iter().map(|row| dot(row, slope)).collect()
    }

    fn back(&self, way: &[f64]) -> Vec<f64> {
        let column = |k| {
            let parts = self.0[1].iter().zip(way).map(|(row, way)| row[k] * way);
            parts.sum()
        };
        (0..way.len()).map(column).collect()
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A value over the box.
pub(super) trait Objective {
    /// The value at a place, infinite where there is none, and its derivatives, which are of no use
    /// above `bound`. None ends the search.
    fn evaluate(&mut self, at: &[f64], bound: f64) -> Option<(f64, Vec<f64>)>;

    /// The metric at the last place that was reached.
    fn metric(&mut self) -> Metric;
}

/// Searches for a least value from `at` on. None where there is no value there.
pub(super) fn search(at: Vec<f64>, objective: &mut dyn Objective) -> Option<Point> {
    let (value, slope) = objective.evaluate(&at, f64::MAX)?;
    if value.is_infinite() {
        return None;
    }
    let mut best = Point { at, value, slope };
    let mut memory = Lbfgs::new(best.at.len(), PAIRS).with_sy_epsilon(f64::MIN_POSITIVE);
    let (mut metric, mut measured, mut still) = (objective.metric(), best.value, 0);
    while still < 2 {
        if best.value < FALLEN * measured {
            (metric, measured) = (objective.metric(), best.value);
            memory.reset();
        }
        let Some(next) = step(&best, &metric, &mut memory, objective) else {
            break;
        };
        still = if best.value - next.value <= STILL * best.value { still + 1 } else { 0 };
        best = next;
    }
    Some(best)
}

fn step(
    from: &Point,
    metric: &Metric,
    memory: &mut Lbfgs,
    objective: &mut dyn Objective,
) -> Option<Point> {
    // Coordinates at a bound from which the value falls outwards stay there.
    let free = |mut way: Vec<f64>| {
        for ((way, at), slope) in way.iter_mut().zip(&from.at).zip(&from.slope) {
            if *at <= 0.0 && *slope > 0.0 || *at >= 1.0 && *slope < 0.0 {
                *way = 0.0;
            }
        }
        way
    };
    let steepest = free(from.slope.clone());
    let mut way = metric.slopes(&steepest);
    memory.update_hessian(&metric.slopes(&from.slope), &metric.places(&from.at));
    memory.apply_hessian(&mut way);
    way = free(metric.back(&way));
    if dot(&way, &steepest) <= 0.0 {
        memory.reset();
        way = steepest;
    }
    let largest = way
        .iter()
        .fold(f64::MIN_POSITIVE, |most, w| most.max(w.abs()));
    let mut length = (LONGEST / largest).min(1.0);
    for _ in 0..TRIES {
        let moved = from.at.iter().zip(&way);
        let to = moved.map(|(at, way)| (at - length * way).clamp(0.0, 1.0));
        let to: Vec<f64> = to.collect();
        let moves: Vec<f64> = to.iter().zip(&from.at).map(|(to, at)| to - at).collect();
        let fall = dot(&from.slope, &moves);
        if fall >= 0.0 {
            return None;
        }
        let bound = from.value + ENOUGH * fall;
        let (value, slope) = objective.evaluate(&to, bound)?;
        if value <= bound {
            return Some(Point {
                at: to,
                value,
                slope,
            });
        }
        // The least of the parabola through what is known.
        length *= (-0.5 * fall / (value - from.value - fall)).clamp(0.1, 0.5);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A valley that curves (Rosenbrock 1960), in the box [0, 1] for [-2, 2].
    fn valley(at: &[f64]) -> (f64, Vec<f64>) {
        let [x, y] = [4.0 * at[0] - 2.0, 4.0 * at[1] - 2.0];
        let (a, b) = (1.0 - x, y - x * x);
        let slope = [-2.0 * a - 40.0 * x * b, 20.0 * b].map(|s| 4.0 * s);
        (a * a + 10.0 * b * b, slope.to_vec())
    }

    struct Counted<F> {
        of: F,
        metric: Option<Vec<Vec<f64>>>,
        count: usize,
    }

    impl<F: Fn(&[f64]) -> Option<(f64, Vec<f64>)>> Objective for Counted<F> {
        fn evaluate(&mut self, at: &[f64], _: f64) -> Option<(f64, Vec<f64>)> {
            self.count += 1;
            Some((self.of)(at).unwrap_or((f64::INFINITY, Vec::new())))
        }

        fn metric(&mut self) -> Metric {
            let unit = vec![vec![1.0, 0.0], vec![0.0, 1.0]];
            Metric::of(self.metric.clone().unwrap_or(unit), 0.0)
        }
    }

    fn least(from: [f64; 2], of: impl Fn(&[f64]) -> Option<(f64, Vec<f64>)>) -> (Point, usize) {
        let mut calls = Counted {
            of,
            metric: None,
            count: 0,
        };
        let found = search(from.to_vec(), &mut calls);
        (found.unwrap(), calls.count)
    }

    #[test]
    fn the_end_of_a_valley_is_found() {
        let (found, calls) = least([0.2, 0.8], |at| Some(valley(at)));
        assert!(found.value < 1e-8 && calls < 120, "{found:?} after {calls}");
        assert!(
            found.at.iter().all(|at| (at - 0.75).abs() < 1e-4),
            "{found:?}"
        );
    }

    #[test]
    fn a_bound_holds_and_the_rest_goes_on() {
        // The least value is outside, at (-0.5, 0.7).
        let of = |at: &[f64]| {
            let [a, b] = [at[0] + 0.5, at[1] - 0.7];
            Some((a * a + 3.0 * b * b + 1.0, vec![2.0 * a, 6.0 * b]))
        };
        let (found, _) = least([0.9, 0.1], of);
        assert_eq!(found.at[0], 0.0);
        assert!((found.at[1] - 0.7).abs() < 1e-2, "{found:?}");
    }

    #[test]
    fn steps_into_what_has_no_value_are_shortened() {
        let of = |at: &[f64]| (at[0] < 0.8).then(|| valley(at));
        let (found, _) = least([0.2, 0.8], of);
        assert!(found.value < 1e-6, "{found:?}");
        let mut none = Counted {
            of: |_: &[f64]| None,
            metric: None,
            count: 0,
        };
        assert!(search(vec![0.5, 0.5], &mut none).is_none());
    }

    #[test]
    fn a_metric_of_the_right_matrix_leads_there_at_once() {
        // A valley a thousand times as long as wide, across both axes.
        let matrix = [[1000.5, 999.5], [999.5, 1000.5]];
        let of = |at: &[f64]| {
            let from = [at[0] - 0.55, at[1] - 0.45];
            let slope = matrix.map(|row| dot(&row, &from));
            Some((0.5 * dot(&slope, &from), slope.to_vec()))
        };
        let count = |metric| {
            let mut calls = Counted {
                of,
                metric,
                count: 0,
            };
            let found = search(vec![0.45, 0.56], &mut calls).unwrap();
            (calls.count, found.value)
        };
        let known = count(Some(matrix.map(Vec::from).to_vec()));
        assert!(known.0 <= 4 && known.1 < 1e-20, "{known:?}");
        assert!(count(None).0 > known.0);
    }
}
