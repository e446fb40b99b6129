//! What data determine of numbers: the eigenvalues of a Gauss-Newton matrix.

use serde::Serialize;

/// Standard error above which data do not tell a combination of numbers, in parts of their bounds.
const UNIDENTIFIED: f64 = 0.1;

/// A combination of numbers, each in parts of its bounds.
#[derive(Clone, Debug, Serialize)]
pub struct Direction {
    /// Eigenvalue of the Gauss-Newton matrix: the inverse square of `error`.
    pub eigenvalue: f64,
    /// Standard error along the direction, in parts of the bounds; infinite (null in JSON) where nothing
    /// changes along it.
    pub error: f64,
    /// False where the data do not tell it: an error above a tenth of the bounds.
    pub is_identified: bool,
    /// Part of each number, `[numbers]`, of length one.
    pub way: Vec<f64>,
}

/// The eigenvectors of JᵀJ/σ², the best known first, and the standard error of each number in parts of its
/// bounds. `changes` has J by columns, `[numbers][coordinates]`; σ is `noise`. `[eq:gauss-newton]`
pub(super) fn directions(changes: &[Vec<f64>], noise: f64) -> (Vec<Direction>, Vec<f64>) {
    let mut found = eigen(gauss_newton(changes, noise));
    found.sort_by(|a, b| b.0.total_cmp(&a.0));
    // Below is rounding.
    let least = 1e-13 * found.first().map_or(0.0, |first| first.0);
    let direction = |(eigenvalue, way): (f64, Vec<f64>)| {
        let error = if eigenvalue > least { 1.0 / eigenvalue.sqrt() } else { f64::INFINITY };
        Direction {
            eigenvalue: eigenvalue.max(0.0),
            error,
            is_identified: error <= UNIDENTIFIED,
            way,
        }
    };
    let directions: Vec<Direction> = found.into_iter().map(direction).collect();
    let error = |number: usize| {
        let parts = directions.iter().map(|one| (one.error, one.way[number]));
        let parts = parts.filter(|(_, part)| part.abs() > 1e-6);
        let squares = parts.map(|(error, part)| (error * part).powi(2));
        squares.sum::<f64>().sqrt()
    };
    let errors = (0..changes.len()).map(error).collect();
    (directions, errors)
}

/// JᵀJ/σ².
pub(super) fn gauss_newton(changes: &[Vec<f64>], noise: f64) -> Vec<Vec<f64>> {
    let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
    let row = |a: &Vec<f64>| {
        let row = changes.iter().map(|b| dot(a, b) / (noise * noise));
        row.collect()
    };
    changes.iter().map(row).collect()
}

/// Eigenvalues and eigenvectors of a symmetric matrix, by rotations (Jacobi 1846).
pub(super) fn eigen(mut a: Vec<Vec<f64>>) -> Vec<(f64, Vec<f64>)> {
    let n = a.len();
    // Rows are the vectors.
    let mut vectors: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| f64::from(u8::from(i == j))).collect())
        .collect();
    for _ in 0..60 {
        let mut is_diagonal = true;
        for p in 0..n {
            for q in p + 1..n {
                if a[p][q].abs() <= 1e-16 * (a[p][p] * a[q][q]).abs().sqrt() {
                    continue;
                }
                is_diagonal = false;
                let theta = (a[q][q] - a[p][p]) / (2.0 * a[p][q]);
                let t = theta.signum() / (theta.abs() + (theta * theta + 1.0).sqrt());
                let c = 1.0 / (t * t + 1.0).sqrt();
                let s = t * c;
                for row in &mut a {
                    (row[p], row[q]) = (c * row[p] - s * row[q], s * row[p] + c * row[q]);
                }
                for k in 0..n {
                    (a[p][k], a[q][k]) = (c * a[p][k] - s * a[q][k], s * a[p][k] + c * a[q][k]);
                    let (x, y) = (vectors[p][k], vectors[q][k]);
                    (vectors[p][k], vectors[q][k]) = (c * x - s * y, s * x + c * y);
                }
            }
        }
        if is_diagonal {
            break;
        }
    }
    (0..n).map(|k| a[k][k]).zip(vectors).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn eigenvectors_are_those_of_the_matrix() {
        let matrix = vec![
            vec![4.0, 1.0, -2.0, 0.0],
            vec![1.0, 3.0, 0.5, 0.1],
            vec![-2.0, 0.5, 5.0, 0.0],
            vec![0.0, 0.1, 0.0, 1e-6],
        ];
        for (value, vector) in eigen(matrix.clone()) {
            for (row, of) in matrix.iter().zip(&vector) {
                let product: f64 = row.iter().zip(&vector).map(|(a, b)| a * b).sum();
                assert!((product - value * of).abs() < 1e-12, "{value}");
            }
            let length: f64 = vector.iter().map(|v| v * v).sum();
            assert!((length - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn what_data_see_as_a_sum_only_is_identified_as_a_sum_only() {
        // Two numbers of which only the sum is seen, and a third.
        let changes = [
            vec![1.0, 1.0, 0.0],
            vec![1.0, 1.0, 0.0],
            vec![0.0, 0.0, 2.0],
        ];
        let (directions, errors) = directions(&changes, 0.01);
        assert_eq!(
            directions
                .iter()
                .map(|d| d.is_identified)
                .collect::<Vec<_>>(),
            [true, true, false]
        );
        assert!((directions[0].error - 0.01 / 2.0).abs() < 1e-12);
        let [a, b, c] = [0, 1, 2].map(|k| directions[2].way[k]);
        assert!((a + b).abs() < 1e-12 && c == 0.0, "{a} {b} {c}");
        assert!(errors[0].is_infinite() && errors[1].is_infinite());
        assert!((errors[2] - 0.005).abs() < 1e-12);
    }
}
