//! Anderson's acceleration of a fixed point iteration x ← x + f(x) (Anderson 1965, Iterative
//! procedures for nonlinear integral equations). The next step is the one that would cancel f if f
//! were linear in the last few steps.

use std::collections::VecDeque;

use glam::DVec3;

/// The last steps and the changes of f over them.
#[derive(Clone, Debug)]
pub(crate) struct Anderson {
    depth: usize,
    /// Each step with the change of f over it.
    history: VecDeque<[Vec<DVec3>; 2]>,
    /// The last step, and f at its start.
    last: Option<[Vec<DVec3>; 2]>,
}

/// Regularisation of the normal equations, relative to their largest diagonal entry: below it,
/// directions are lost in rounding.
const REGULARISATION: f64 = 1e-12;

impl Anderson {
    /// An acceleration that stores up to `depth` steps.
    pub(crate) fn new(depth: usize) -> Self {
        Self {
            depth,
            history: VecDeque::new(),
            last: None,
        }
    }

    /// Discards all stored steps.
    pub(crate) fn restart(&mut self) {
        self.history.clear();
        self.last = None;
    }

    /// The step s = f - (ΔX + ΔF) γ, γ = argmin |f - ΔF γ|, with f the `correction` at the end of
    /// the last step. `[eq:anderson]`
    pub(crate) fn step(&mut self, correction: &[DVec3]) -> Vec<DVec3> {
        if let Some([step, before]) = self.last.take() {
            let change = correction.iter().zip(&before).map(|(now, f)| *now - *f);
            let record = [step, change.collect()];
            if self.history.len() == self.depth {
                self.history.pop_front();
            }
            self.history.push_back(record);
        }
        let mut step = correction.to_vec();
        for (weight, [x, f]) in self.weights(correction).into_iter().zip(&self.history) {
            for (entry, (x, f)) in step.iter_mut().zip(x.iter().zip(f)) {
                *entry -= (*x + *f) * weight;
            }
        }
        step
    }

    /// Stores the step that was taken from the point with this `correction`.
    pub(crate) fn taken(&mut self, step: Vec<DVec3>, correction: Vec<DVec3>) {
        self.last = Some([step, correction]);
    }

    fn weights(&self, correction: &[DVec3]) -> Vec<f64> {
        let changes = || self.history.iter().map(|[_, change]| change);
        let row = |a: &Vec<DVec3>| changes().map(|b| dot(a, b)).collect();
        let mut matrix: Vec<Vec<f64>> = changes().map(row).collect();
        let largest = (0..matrix.len()).map(|k| matrix[k][k]).fold(0.0, f64::max);
        for (k, row) in matrix.iter_mut().enumerate() {
            row[k] += REGULARISATION * largest;
        }
        let right_side = changes().map(|change| dot(change, correction));
        solve_positive(matrix, right_side.collect())
    }
}

fn dot(a: &[DVec3], b: &[DVec3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum()
}

/// Solves a small symmetric positive definite system by elimination. A direction without a positive
/// pivot gets the weight 0.
fn solve_positive(mut matrix: Vec<Vec<f64>>, mut right_side: Vec<f64>) -> Vec<f64> {
    let count = right_side.len();
    for k in 0..count {
        if matrix[k][k] <= 0.0 {
            continue;
        }
        let pivot_row = matrix[k].clone();
        for row in k + 1..count {
            let factor = matrix[row][k] / pivot_row[k];
            for (entry, pivot) in matrix[row].iter_mut().zip(&pivot_row).skip(k) {
                *entry -= factor * pivot;
            }
            right_side[row] -= factor * right_side[k];
        }
    }
    for k in (0..count).rev() {
        let known: f64 = (k + 1..count).map(|j| matrix[k][j] * right_side[j]).sum();
        right_side[k] =
            if matrix[k][k] > 0.0 { (right_side[k] - known) / matrix[k][k] } else { 0.0 };
    }
    right_side
}

#[cfg(test)]
mod tests {
    use super::*;

    /// f(x) = -R (x - X) with the rates R on the diagonal.
    fn correction(x: &[DVec3], rates: &[DVec3], goal: &[DVec3]) -> Vec<DVec3> {
        (0..x.len()).map(|k| (goal[k] - x[k]) * rates[k]).collect()
    }

    #[test]
    fn linear_problem_is_solved_once_as_many_steps_as_rates_are_known() {
        let rates = [DVec3::new(0.9, 0.5, 0.02), DVec3::new(0.5, 0.02, 0.9)];
        let goal = [DVec3::new(1.0, -2.0, 3.0), DVec3::new(0.5, 0.1, -4.0)];
        let mut x = vec![DVec3::ZERO; 2];
        let mut anderson = Anderson::new(5);
        // Three different rates: after three steps the least squares problem has no residual.
        for _ in 0..4 {
            let f = correction(&x, &rates, &goal);
            let step = anderson.step(&f);
            for (x, step) in x.iter_mut().zip(&step) {
                *x += *step;
            }
            anderson.taken(step, f);
        }
        for (x, goal) in x.iter().zip(goal) {
            // Without help, four steps leave 0.98⁴ of the slowest part. The normal equations square
            // the ratio of the rates, so that half the digits are lost.
            assert!(x.distance(goal) < 1e-4);
        }
    }

    #[test]
    fn repeated_directions_do_no_harm() {
        let f = vec![DVec3::X];
        let mut anderson = Anderson::new(3);
        for _ in 0..6 {
            let step = anderson.step(&f);
            assert_eq!(step, f);
            anderson.taken(step, f.clone());
        }
    }
}
