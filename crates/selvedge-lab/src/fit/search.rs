//! L-BFGS within a box: the matrix is that of the crate `lbfgs`, steps are projected (Bertsekas 1982)
//! and shortened until the value falls by enough (Armijo 1966).

use anyhow::Result;
use lbfgs::Lbfgs;

use super::told::eigen;

/// Pairs that the matrix is made of.
const PAIRS: usize = 12;
/// Longest first step without a metric and longest step otherwise, of any coordinate.
const LONGEST: [f64; 2] = [0.1, 0.3];
/// Part of the expected fall that a step must reach.
const ENOUGH: f64 = 1e-4;
/// Part of its value to which a search falls before it asks for its metric anew.
const FALLEN: f64 = 0.1;
/// Steps that are tried along a direction, and the relative fall below which two steps end the search.
const TRIES: usize = 8;
const STILL: f64 = 1e-3;

/// A place in the box of [0, 1], its value, and the derivatives of that.
#[derive(Clone, Debug)]
pub(super) struct Point {
    pub(super) at: Vec<f64>,
    pub(super) value: f64,
    pub(super) slope: Vec<f64>,
}

/// What was found at a place.
pub(super) enum Look {
    /// No more is to be looked for.
    Stop,
    /// There is no value.
    Failed,
    /// The value is above the bound: derivatives were not asked for.
    Above(f64),
    Reached(Point),
}

/// The matrix of second derivatives that a search begins from, by its eigenvectors.
pub(super) struct Metric {
    roots: Vec<f64>,
    vectors: Vec<Vec<f64>>,
}

impl Metric {
    /// A symmetric matrix. No eigenvalue is below that of a parabola which falls by the whole `value` from
    /// the middle of the box to its border: far from the least value a matrix knows no better.
    pub(super) fn of(matrix: Vec<Vec<f64>>, value: f64) -> Self {
        let (values, vectors): (Vec<f64>, _) = eigen(matrix).into_iter().unzip();
        let least = (8.0 * value).max(f64::MIN_POSITIVE);
        let roots = values.iter().map(|value| value.max(least).sqrt()).collect();
        Self { roots, vectors }
    }

    fn place(&self, at: &[f64]) -> Vec<f64> {
        let pairs = self.vectors.iter().zip(&self.roots);
        pairs.map(|(vector, root)| root * dot(vector, at)).collect()
    }

    fn slope(&self, slope: &[f64]) -> Vec<f64> {
        let pairs = self.vectors.iter().zip(&self.roots);
        pairs
            .map(|(vector, root)| dot(vector, slope) / root)
            .collect()
    }

    fn back(&self, way: &[f64]) -> Vec<f64> {
        let mut back = vec![0.0; way.len()];
        for ((vector, root), way) in self.vectors.iter().zip(&self.roots).zip(way) {
            back.iter_mut()
                .zip(vector)
                .for_each(|(sum, v)| *sum += way / root * v);
        }
        back
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// A value over the box.
pub(super) trait Landscape {
    /// Looks at a place, whose value is of no use above `bound`.
    fn look(&mut self, at: &[f64], bound: f64) -> Result<Look>;

    /// The metric at the last place that was reached, where one is to be had.
    fn metric(&mut self) -> Result<Option<Metric>>;
}

/// Searches for a least value from `at` on. None where there is no value there.
pub(super) fn search(at: Vec<f64>, land: &mut dyn Landscape) -> Result<Option<Point>> {
    let Look::Reached(best) = land.look(&at, f64::INFINITY)? else {
        return Ok(None);
    };
    let memory = Lbfgs::new(at.len(), PAIRS).with_sy_epsilon(f64::MIN_POSITIVE);
    let mut search = Search {
        memory,
        metric: None,
        best,
        is_first: true,
    };
    let (mut still, mut looked) = (0, f64::INFINITY);
    while still < 2 {
        let before = search.best.value;
        if before < FALLEN * looked {
            looked = before;
            if let Some(metric) = land.metric()? {
                search.memory.reset();
                search.metric = Some(metric);
            }
        }
        if !search.step(land)? {
            break;
        }
        still = if before - search.best.value <= STILL * before { still + 1 } else { 0 };
    }
    Ok(Some(search.best))
}

struct Search {
    memory: Lbfgs,
    metric: Option<Metric>,
    best: Point,
    is_first: bool,
}

impl Search {
    /// Goes one step down; false where there is none.
    fn step(&mut self, land: &mut dyn Landscape) -> Result<bool> {
        let (memory, from) = (&mut self.memory, &self.best);
        let metric = self.metric.as_ref();
        let turned = |slope: &[f64]| metric.map_or(slope.to_vec(), |metric| metric.slope(slope));
        let slope = turned(&from.slope);
        let place = metric.map_or(from.at.clone(), |metric| metric.place(&from.at));
        memory.update_hessian(&slope, &place);
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
        let mut way = turned(&steepest);
        memory.apply_hessian(&mut way);
        way = free(metric.map_or(way.clone(), |metric| metric.back(&way)));
        if dot(&way, &steepest) <= 0.0 {
            memory.reset();
            memory.update_hessian(&slope, &place);
            way = steepest;
        }
        let largest = way.iter().fold(0.0_f64, |most, w| most.max(w.abs()));
        if largest == 0.0 {
            return Ok(false);
        }
        // A first direction has no length of its own.
        let is_bare = metric.is_none() && std::mem::take(&mut self.is_first);
        let mut length =
            if is_bare { LONGEST[0] / largest } else { (LONGEST[1] / largest).min(1.0) };
        for _ in 0..TRIES {
            let moved = from.at.iter().zip(&way);
            let to: Vec<f64> = moved
                .map(|(at, way)| (at - length * way).clamp(0.0, 1.0))
                .collect();
            let moves: Vec<f64> = to.iter().zip(&from.at).map(|(to, at)| to - at).collect();
            let fall = dot(&from.slope, &moves);
            if fall >= 0.0 {
                return Ok(false);
            }
            length *= match land.look(&to, from.value + ENOUGH * fall)? {
                Look::Stop => return Ok(false),
                Look::Reached(point) => {
                    self.best = point;
                    return Ok(true);
                }
                Look::Failed => 0.2,
                // The least of the parabola through what is known.
                Look::Above(value) => (-0.5 * fall / (value - from.value - fall)).clamp(0.1, 0.5),
            };
        }
        Ok(false)
    }
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

    struct Looks<F> {
        of: F,
        metric: Option<Vec<Vec<f64>>>,
        count: usize,
    }

    impl<F: Fn(&[f64]) -> Option<(f64, Vec<f64>)>> Landscape for Looks<F> {
        fn look(&mut self, at: &[f64], bound: f64) -> Result<Look> {
            self.count += 1;
            Ok(match (self.of)(at) {
                None => Look::Failed,
                Some((value, _)) if value > bound => Look::Above(value),
                Some((value, slope)) => Look::Reached(Point {
                    at: at.to_vec(),
                    value,
                    slope,
                }),
            })
        }

        fn metric(&mut self) -> Result<Option<Metric>> {
            Ok(self.metric.take().map(|metric| Metric::of(metric, 0.0)))
        }
    }

    fn least(from: [f64; 2], of: impl Fn(&[f64]) -> Option<(f64, Vec<f64>)>) -> (Point, usize) {
        let mut looks = Looks {
            of,
            metric: None,
            count: 0,
        };
        let found = search(from.to_vec(), &mut looks);
        (found.unwrap().unwrap(), looks.count)
    }

    #[test]
    fn the_end_of_a_valley_is_found() {
        let (found, looks) = least([0.2, 0.8], |at| Some(valley(at)));
        assert!(found.value < 1e-8 && looks < 60, "{found:?} after {looks}");
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
        let mut none = Looks {
            of: |_: &[f64]| None,
            metric: None,
            count: 0,
        };
        assert!(search(vec![0.5], &mut none).unwrap().is_none());
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
            let mut looks = Looks {
                of,
                metric,
                count: 0,
            };
            let found = search(vec![0.45, 0.56], &mut looks).unwrap().unwrap();
            (looks.count, found.value)
        };
        let known = count(Some(matrix.map(Vec::from).to_vec()));
        assert!(known.0 <= 4 && known.1 < 1e-20, "{known:?}");
        assert!(count(None).0 > known.0);
    }
}
