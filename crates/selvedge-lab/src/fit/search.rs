//! L-BFGS within a box: the matrix is that of the crate `lbfgs`, steps are projected (Bertsekas 1982)
//! and shortened until the value falls by enough (Armijo 1966).

use anyhow::Result;
use lbfgs::Lbfgs;

/// Pairs that the matrix is made of.
const PAIRS: usize = 12;
/// Longest first step and longest step after it, of any coordinate.
const LONGEST: [f64; 2] = [0.1, 0.5];
/// Part of the expected fall that a step must reach.
const ENOUGH: f64 = 1e-4;
/// Steps that are tried along a direction, and the relative fall below which two steps end the search.
const TRIES: usize = 8;
const STILL: f64 = 1e-5;

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

/// Searches for a least value from `at` on. `look` is given a place and the value above which it is of no
/// use. None where the first place has no value.
pub(super) fn search(
    at: Vec<f64>,
    look: &mut dyn FnMut(&[f64], f64) -> Result<Look>,
) -> Result<Option<Point>> {
    let Look::Reached(mut best) = look(&at, f64::INFINITY)? else {
        return Ok(None);
    };
    let mut memory = Lbfgs::new(at.len(), PAIRS).with_sy_epsilon(f64::MIN_POSITIVE);
    let mut longest = LONGEST[0];
    let mut still = 0;
    while still < 2 {
        memory.update_hessian(&best.slope, &best.at);
        let Some(next) = step(&best, &mut memory, longest, look)? else {
            break;
        };
        still = if best.value - next.value <= STILL * best.value { still + 1 } else { 0 };
        longest = LONGEST[1];
        best = next;
    }
    Ok(Some(best))
}

fn step(
    from: &Point,
    memory: &mut Lbfgs,
    longest: f64,
    look: &mut dyn FnMut(&[f64], f64) -> Result<Look>,
) -> Result<Option<Point>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
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
    let mut way = steepest.clone();
    memory.apply_hessian(&mut way);
    way = free(way);
    if dot(&way, &steepest) <= 0.0 {
        memory.reset();
        memory.update_hessian(&from.slope, &from.at);
        way = steepest;
    }
    let largest = way.iter().fold(0.0_f64, |most, w| most.max(w.abs()));
    if largest == 0.0 {
        return Ok(None);
    }
    // A first direction has no length of its own.
    let mut length =
        if longest == LONGEST[0] { longest / largest } else { (longest / largest).min(1.0) };
    for _ in 0..TRIES {
        let moved = from.at.iter().zip(&way);
        let to: Vec<f64> = moved
            .map(|(at, way)| (at - length * way).clamp(0.0, 1.0))
            .collect();
        let moves: Vec<f64> = to.iter().zip(&from.at).map(|(to, at)| to - at).collect();
        let fall = dot(&from.slope, &moves);
        if fall >= 0.0 {
            return Ok(None);
        }
        length *= match look(&to, from.value + ENOUGH * fall)? {
            Look::Stop => return Ok(None),
            Look::Reached(point) => return Ok(Some(point)),
            Look::Failed => 0.2,
            // The least of the parabola through what is known.
            Look::Above(value) => (-0.5 * fall / (value - from.value - fall)).clamp(0.1, 0.5),
        };
    }
    Ok(None)
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

    fn least(from: [f64; 2], of: impl Fn(&[f64]) -> Option<(f64, Vec<f64>)>) -> (Point, usize) {
        let mut looks = 0;
        let found = search(from.to_vec(), &mut |at, bound| {
            looks += 1;
            Ok(match of(at) {
                None => Look::Failed,
                Some((value, _)) if value > bound => Look::Above(value),
                Some((value, slope)) => Look::Reached(Point {
                    at: at.to_vec(),
                    value,
                    slope,
                }),
            })
        });
        (found.unwrap().unwrap(), looks)
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
        let mut none = |_: &[f64], _: f64| Ok(Look::Failed);
        assert!(search(vec![0.5], &mut none).unwrap().is_none());
    }
}
