//! What the last step of a fixed point iteration x ← x + f(x) says about the next: on a slow way a
//! part of it is added (Polyak 1964, heavy ball); where f has turned against it, the iteration has
//! gone too far and the step is halved.
//!
//! Without halving, an iteration whose f falls twice as steeply as x rises steps to and fro over the
//! solution for ever: across a kink of the material law the cloth is stiffer than the matrix knows,
//! which holds the looked-up stiffness constant.

use glam::DVec3;

/// The last step.
#[derive(Clone, Debug)]
pub(crate) struct Inertia {
    last_step: Vec<DVec3>,
}

/// Part of the last step that is added to the next one.
const KEPT: f64 = 0.95;
/// What a step is multiplied by that turns against the last one.
const TURNED: f64 = 0.5;

impl Inertia {
    /// Before the first step of a cloth of so many vertices.
    pub(crate) fn new(vertices: usize) -> Self {
        Self {
            last_step: vec![DVec3::ZERO; vertices],
        }
    }

    /// Changes `step` by what the last one was, f being `correction`: with d = s₋·f, s₋ the last
    /// step, s ← s + 0.95 s₋ where d > 0, s ← s/2 where d < 0. `[eq:sag-inertia]`
    pub(crate) fn apply(&self, correction: &[DVec3], step: &mut [DVec3]) {
        let pairs = self.last_step.iter().zip(correction);
        let forward: f64 = pairs.map(|(last, next)| last.dot(*next)).sum();
        if forward > 0.0 {
            for (entry, last) in step.iter_mut().zip(&self.last_step) {
                *entry += *last * KEPT;
            }
        } else if forward < 0.0 {
            step.iter_mut().for_each(|entry| *entry *= TURNED);
        }
    }

    /// Remembers what step was taken.
    pub(crate) fn taken(&mut self, step: &[DVec3]) {
        self.last_step.copy_from_slice(step);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Where `count` steps lead from (1, 1, 1), with f(x) = -rate x.
    fn iterated(rate: f64, count: usize) -> DVec3 {
        let (mut x, mut inertia) = (DVec3::ONE, Inertia::new(1));
        for _ in 0..count {
            let correction = [x * -rate];
            let mut step = correction;
            inertia.apply(&correction, &mut step);
            inertia.taken(&step);
            x += step[0];
        }
        x
    }

    #[test]
    fn an_iteration_that_steps_to_and_fro_comes_to_its_end() {
        for rate in [2.0_f64, 2.4, 3.6] {
            // The first step leads to 1 - r. Each later one turns against the last, because the one
            // before it led past the solution (r > 2: 1 - r/2 < 0) or, with r = 2, onto it.
            let expected = (1.0 - rate) * (1.0 - 0.5 * rate).powi(7);
            assert!((iterated(rate, 8).x - expected).abs() < 1e-14, "{rate}");
        }
    }

    #[test]
    fn on_a_slow_way_steps_grow_by_what_the_last_one_was() {
        // s₁ = r, s₂ = r (1 - r) + 0.95 s₁.
        let rate = 0.01;
        let expected = 1.0 - rate - (rate * (1.0 - rate) + 0.95 * rate);
        assert!((iterated(rate, 2).x - expected).abs() < 1e-15);
    }

    #[test]
    fn the_first_step_is_the_correction() {
        let mut step = [DVec3::new(0.3, -0.2, 0.1)];
        let correction = step;
        Inertia::new(1).apply(&correction, &mut step);
        assert_eq!(step, correction);
    }
}
