//! Coefficients of the generalised-α method, a formula of second order that looks back.
//!
//! In the form of Jansen, Whiting and Hulbert (2000) for y' = f(y), the equations hold at a point
//! t + α Δt within the substep, and the rate that they give is blended with that at its start. The
//! spectral radius ρ of the fastest vibrations is chosen; with ρ = 0 the method is BDF2. Its error
//! grows with how much it damps: a slow vibration of ω lags by (ω Δt)³ times 1/3 per substep with
//! BDF2, 0.16 at ρ = 0.3, and 1/12 at ρ = 1, where nothing is damped.

use glam::DVec3;

/// Coefficients for substeps of one length Δt. `[eq:generalised-alpha]`
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct TwoStep {
    /// Weight of y - y' in the start of the stage.
    pub(super) weight: f64,
    /// 2 Δt/γ of the stage.
    divisor: f64,
    /// The point of the substep at which the equations hold, in (0, 1].
    pub(super) point: f64,
    /// Weight of the new rate in the change over the substep, in (0, 1]: the mean of the rates at
    /// start and end.
    new_rate: f64,
    /// Time by which the rate that a substep goes on from lags behind that of its state, over half
    /// a substep.
    lag: f64,
}

impl TwoStep {
    /// The formula of a spectral radius from 0 to 0.9.
    pub(super) fn of(radius: f64) -> Self {
        // α_m, α_f and γ of the source.
        let blend = 0.5 * (3.0 - radius) / (1.0 + radius);
        let point = 1.0 / (1.0 + radius);
        let new_rate = 0.5 + blend - point;
        let gamma = point * new_rate / blend;
        Self {
            weight: gamma * (blend / new_rate - 1.0),
            divisor: 2.0 / gamma,
            point,
            new_rate,
            lag: 2.0 * (blend - point),
        }
    }

    /// γ of the stage in a substep over `dt`, both in `[s]`.
    pub(super) fn gamma(&self, dt: f64) -> f64 {
        dt * 2.0 / self.divisor
    }

    /// The end of a substep from `start` whose equations hold with `at_point`.
    pub(super) fn end(&self, start: DVec3, at_point: DVec3) -> DVec3 {
        start + (at_point - start) / self.point
    }

    /// The y' that goes with `end`: y' = y - Δt ẏ, ẏ the rate there. `before` is that of `start`.
    pub(super) fn before(&self, start: DVec3, before: DVec3, end: DVec3) -> DVec3 {
        let old_rate = (1.0 - self.new_rate) / self.new_rate;
        end - ((end - start) / self.new_rate - (start - before) * old_rate)
    }

    /// The impulse that a `force` gives in a substep over `dt` `[s]`, `carried` being what it has of m (v - v')
    /// at the start; and what it has of that at the end.
    pub(super) fn impulse(&self, dt: f64, force: DVec3, carried: DVec3) -> [DVec3; 2] {
        let given = (carried * self.weight + force * self.gamma(dt)) / self.point;
        [given, given - self.before(DVec3::ZERO, -carried, given)]
    }

    /// Derivatives of [`Self::before`] by the end, the start and the y' of the start.
    pub(super) fn before_weights(&self) -> [f64; 3] {
        let (rate, old_rate) = (1.0 / self.new_rate, (1.0 - self.new_rate) / self.new_rate);
        [1.0 - rate, rate + old_rate, -old_rate]
    }

    /// The lag of [`Self::first_before`], in substeps.
    pub(super) fn lag(&self) -> f64 {
        self.lag
    }

    /// The y' after a substep from `start` to `end` by another formula, `change` the rate at its
    /// end times Δt. The rates of this formula lag behind those of its states, all alike where the
    /// acceleration is constant; the mean rate of the substep lags by half of it.
    pub(super) fn first_before(&self, start: DVec3, end: DVec3, change: DVec3) -> DVec3 {
        end - change - (end - start - change) * self.lag
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// y and y' after a substep of y' = rate y, in one dimension.
    fn substep(formula: TwoStep, rate: f64, [y, before]: [f64; 2]) -> [f64; 2] {
        let at = |y: f64| DVec3::new(y, 0.0, 0.0);
        let start = y + formula.weight * (y - before);
        let stage = start / (1.0 - formula.gamma(rate));
        let end = formula.end(at(y), at(stage));
        [end.x, formula.before(at(y), at(before), end).x]
    }

    #[test]
    fn without_a_radius_it_is_bdf2() {
        let bdf2 = TwoStep::of(0.0);
        assert!((bdf2.weight - 1.0 / 3.0).abs() < 1e-15, "{bdf2:?}");
        assert!((bdf2.divisor - 3.0).abs() < 1e-15, "{bdf2:?}");
        for one in [bdf2.point, bdf2.new_rate, bdf2.lag] {
            assert!((one - 1.0).abs() < 1e-15, "{bdf2:?}");
        }
        let [start, before, end] = [0.3, 0.2, 0.45].map(DVec3::splat);
        assert_eq!(bdf2.end(start, end), end);
        assert!(bdf2.before(start, before, end).distance(start) < 1e-16);
        let change = DVec3::splat(0.1);
        assert!(bdf2.first_before(start, end, change).distance(start) < 1e-16);
    }

    #[test]
    fn a_vibration_lags_by_what_the_documentation_says() {
        // y' = i ω y as two real equations, whose stage is solved by hand.
        for (radius, expected) in [(0.0, 1.0 / 3.0), (0.3, 0.155), (0.9, 0.084)] {
            let formula = TwoStep::of(radius);
            let (h, steps) = (0.02, 50);
            let (mut y, mut before) = (DVec3::X, DVec3::new(1.0, -h, 0.0));
            for _ in 0..steps {
                let start = y + formula.weight * (y - before);
                let g = formula.gamma(h);
                let stage = DVec3::new(start.x - g * start.y, start.y + g * start.x, 0.0);
                let end = formula.end(y, stage / (1.0 + g * g));
                (y, before) = (end, formula.before(y, before, end));
            }
            let lag = f64::from(steps) * h - y.y.atan2(y.x);
            let per_substep = lag / (f64::from(steps) * h.powi(3));
            assert!(
                (per_substep / expected - 1.0).abs() < 0.04,
                "{radius}: {per_substep}"
            );
        }
    }

    #[test]
    fn of_the_fastest_decay_the_spectral_radius_is_left() {
        for radius in [0.2, 0.4, 0.8] {
            let mut state = [1.0, 0.0];
            let mut sizes = Vec::new();
            for _ in 0..60 {
                state = substep(TwoStep::of(radius), -1e9, state);
                sizes.push(state[0].abs().max(state[1].abs()));
            }
            // A double root leaves a factor that grows with the number of the step.
            let left = (sizes[59] / sizes[29]).powf(1.0 / 30.0);
            assert!((left / radius - 1.0).abs() < 0.04, "{radius}: {left}");
        }
    }
}
