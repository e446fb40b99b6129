//! The order of a method from its errors, the error of a reference from two runs, and the price of
//! an error.

/// Errors less than so many times the reference's own are not the method's alone: they are marked,
/// and left out of regressions.
pub(super) const FAR: f64 = 5.0;

/// The slope of ln e over ln h by least squares, with h in inverse proportion to the substeps;
/// none for fewer than two errors that are positive. `[eq:observed-order]`
///
/// `errors` are (substeps, error).
pub(super) fn observed_order(errors: &[(u32, f64)]) -> Option<f64> {
    let positive = errors.iter().filter(|(_, error)| *error > 0.0);
    let points: Vec<(f64, f64)> = positive
        .map(|(substeps, error)| (-f64::from(*substeps).ln(), error.ln()))
        .collect();
    let count = points.len() as f64;
    let mean = |of: fn(&(f64, f64)) -> f64| points.iter().map(of).sum::<f64>() / count;
    let (x, y) = (mean(|p| p.0), mean(|p| p.1));
    let along: f64 = points.iter().map(|p| (p.0 - x) * (p.0 - x)).sum();
    let both: f64 = points.iter().map(|p| (p.0 - x) * (p.1 - y)).sum();
    (along > 0.0).then(|| both / along)
}

/// The error of a run with steps h/2, from its difference to one with steps h, for a method of this
/// order p: |x_h - x_{h/2}| / (2^p - 1). `[eq:richardson]`
pub(super) fn richardson(difference: f64, order: u32) -> f64 {
    difference / (2_f64.powi(order as i32) - 1.0)
}

/// The price at which a method whose `points` are (price, error) has `error`: a straight line
/// between the two points around it, in logarithms of both. None outside of all of them.
pub(super) fn price_of(points: &[(f64, f64)], error: f64) -> Option<f64> {
    let is_usable = |(price, error): &&(f64, f64)| *price > 0.0 && *error > 0.0;
    let points: Vec<(f64, f64)> = points.iter().filter(is_usable).copied().collect();
    let around = points.windows(2).find(|pair| {
        let (a, b) = (pair[0].1, pair[1].1);
        a != b && a.min(b) <= error && error <= a.max(b)
    })?;
    let [a, b] = [around[0], around[1]].map(|(price, error)| (price.ln(), error.ln()));
    let part = (error.ln() - a.1) / (b.1 - a.1);
    Some((a.0 + part * (b.0 - a.0)).exp())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_of_a_power_of_the_step_have_its_order() {
        let errors = |order: i32| -> Vec<(u32, f64)> {
            let of = |substeps: u32| 3e-3 / f64::from(substeps).powi(order);
            [1, 2, 4, 8, 16].map(|n| (n, of(n))).to_vec()
        };
        for order in [1, 2, 3] {
            // A few roundings of logarithms of order 10, over a span of 2.8.
            let found = observed_order(&errors(order)).unwrap();
            assert!((found - f64::from(order)).abs() < 1e-13, "{found}");
        }
        // An order that no error shows is not made up.
        assert_eq!(observed_order(&[]), None);
        assert_eq!(observed_order(&[(4, 1.0)]), None);
        assert_eq!(observed_order(&[(4, 1.0), (4, 2.0)]), None);
        assert_eq!(observed_order(&[(1, 1.0), (2, 0.0)]), None);
    }

    #[test]
    fn two_runs_tell_the_error_of_the_finer() {
        // x(h) = x + c hᵖ: the difference is c hᵖ (1 - 2⁻ᵖ), the error of the finer run c hᵖ 2⁻ᵖ.
        for order in [1, 2] {
            let error = |h: f64| 0.7 * h.powi(order);
            let found = richardson(error(0.1) - error(0.05), order as u32);
            assert!((found - error(0.05)).abs() < 1e-16);
        }
    }

    #[test]
    fn the_price_of_an_error_is_between_those_of_its_neighbours() {
        // An error of 1/price.
        let points = [(1.0, 1.0), (2.0, 0.5), (8.0, 0.125)];
        for error in [1.0, 0.7, 0.5, 0.2, 0.125] {
            let price = price_of(&points, error).unwrap();
            assert!((price * error - 1.0).abs() < 1e-14, "{price}");
        }
        assert_eq!(price_of(&points, 1.1), None);
        assert_eq!(price_of(&points, 0.1), None);
        assert_eq!(price_of(&points[..1], 1.0), None);
    }
}
