//! Inertia and damping of a fixed point iteration x ← x + f(x) by its last step. On a slow way a
//! part of the last step is added to the next (Polyak 1964, heavy ball). If f has turned against
//! the last step, the iteration has gone too far and the next step is halved.
//!
//! Without halving, an iteration whose f falls twice as steeply as x rises steps to and fro over
//! the solution for ever. This happens at a kink of the material law: across it the cloth is
//! stiffer than the matrix, which holds the looked-up stiffness constant. A kink concerns few
//! vertices, so damping works per vertex. Inertia concerns the whole cloth and keeps single
//! vertices from coming to rest. So only one of the two is used at a time.

use glam::DVec3;

/// The last step.
#[derive(Clone, Debug)]
pub(crate) struct LastStep(Vec<DVec3>);

/// Part of the last step that is added to the next one.
const KEPT: f64 = 0.95;
/// Factor of a step that turns against the last one.
const TURNED: f64 = 0.5;

impl LastStep {
    /// No step yet of a cloth with this number of vertices.
    pub(crate) fn new(vertices: usize) -> Self {
        Self(vec![DVec3::ZERO; vertices])
    }

    /// Gives `step` inertia. With f the `correction`, s₋ the last step and d = Σ s₋·f:
    /// s ← s + 0.95 s₋ if d > 0, s ← s/2 if d < 0. `[eq:sag-inertia]`
    pub(crate) fn accelerate(&self, correction: &[DVec3], step: &mut [DVec3]) {
        let pairs = self.0.iter().zip(correction);
        let forward: f64 = pairs.map(|(last, next)| last.dot(*next)).sum();
        if forward > 0.0 {
            for (entry, last) in step.iter_mut().zip(&self.0) {
                *entry += *last * KEPT;
            }
        } else if forward < 0.0 {
            step.iter_mut().for_each(|entry| *entry *= TURNED);
        }
    }

    /// Damps `step`, with f the `correction`: s ← s/2 at each vertex with s₋·f < 0.
    /// `[eq:sag-damping]`
    pub(crate) fn damp(&self, correction: &[DVec3], step: &mut [DVec3]) {
        for ((entry, last), next) in step.iter_mut().zip(&self.0).zip(correction) {
            if last.dot(*next) < 0.0 {
                *entry *= TURNED;
            }
        }
    }

    /// Stores the step that was taken.
    pub(crate) fn taken(&mut self, step: &[DVec3]) {
        self.0.copy_from_slice(step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    type Change = fn(&LastStep, &[DVec3], &mut [DVec3]);

    /// Two vertices after `count` steps from (1, 1, 1) with f(x) = -r x, each with its own rate r.
    fn iterated(change: Change, rates: [f64; 2], count: usize) -> [f64; 2] {
        let (mut x, mut last) = ([DVec3::ONE; 2], LastStep::new(2));
        for _ in 0..count {
            let correction = [x[0] * -rates[0], x[1] * -rates[1]];
            let mut step = correction;
            change(&last, &correction, &mut step);
            last.taken(&step);
            x = [x[0] + step[0], x[1] + step[1]];
        }
        x.map(|x| x.x)
    }

    /// The first step leads to 1 - r. Each later one turns against the last, because the one before
    /// it led past the solution (r > 2: 1 - r/2 < 0) or, with r = 2, onto it.
    fn damped(rate: f64, count: i32) -> f64 {
        (1.0 - rate) * (1.0 - 0.5 * rate).powi(count - 1)
    }

    #[test]
    fn an_iteration_that_steps_to_and_fro_comes_to_its_end() {
        for rate in [2.0_f64, 2.4, 3.6] {
            for change in [LastStep::accelerate as Change, LastStep::damp] {
                let [x, y] = iterated(change, [rate; 2], 8);
                assert!((x - damped(rate, 8)).abs() < 1e-14, "{rate}");
                assert_eq!(x, y);
            }
        }
    }

    #[test]
    fn damping_is_per_vertex() {
        let (steep, slow) = (2.4, 0.01);
        let [x, y] = iterated(LastStep::damp, [steep, slow], 8);
        assert!((x - damped(steep, 8)).abs() < 1e-14);
        assert!((y - (1.0_f64 - slow).powi(8)).abs() < 1e-14);
    }

    #[test]
    fn on_a_slow_way_steps_grow_by_the_last_one() {
        // s₁ = r, s₂ = r (1 - r) + 0.95 s₁.
        let rate = 0.01;
        let expected = 1.0 - rate - (rate * (1.0 - rate) + 0.95 * rate);
        let [x, y] = iterated(LastStep::accelerate, [rate; 2], 2);
        assert!((x - expected).abs() < 1e-15 && x == y);
    }
}
