//! Gusts: a smooth random velocity of the air that is a pure function of seed and time, so that a
//! run can be repeated, and begun again anywhere, without any state being kept.
//!
//! Each component is a sum of eight sines with incommensurate frequencies, whose amplitudes fall
//! with the -5/6th power of the frequency (Kolmogorov's spectrum, f^(-5/3), for equal steps of f).
//! The air is the same everywhere on the cloth: this is no turbulence in space.

use std::f64::consts::TAU;

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::geometry::{sin_cos, unit};

/// Gusts on top of a constant wind.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Gust {
    /// Root mean square over a long time of each component `[m/s]`, not negative.
    pub speed: DVec3,
    /// The longest of its periods `[s]`; the shortest is a ninth of it.
    pub period: f64,
    /// Decides the phases and the exact frequencies.
    pub seed: u64,
}

/// Sines per component.
const SINES: usize = 8;

impl Gust {
    /// Velocity of the air beside the constant wind at `time` `[s]`, `[m/s]`:
    /// w(t) = s Σ a_k sin(2π r_k t/T + φ_k), r_0 = 1, r_k in [k + ½, k + 1), a_k ∝ r_k^(-5/6),
    /// Σ a_k² = 2. `[eq:gust]`
    #[must_use]
    pub fn velocity(&self, time: f64) -> DVec3 {
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut component = || {
            let (mut sum, mut squares) = (0.0, 0.0);
            for k in 0..SINES {
                let (place, phase) = (unit(&mut rng), TAU * unit(&mut rng));
                let frequency = match k {
                    0 => 1.0,
                    k => k as f64 + 0.5 + 0.5 * place,
                };
                let amplitude = libm::pow(frequency, -5.0 / 6.0);
                // Whole turns are taken off before they cost digits.
                let turns = (frequency * time / self.period).fract();
                sum += amplitude * sin_cos(TAU * turns + phase).0;
                squares += amplitude * amplitude;
            }
            sum * (2.0 / squares).sqrt()
        };
        self.speed * DVec3::new(component(), component(), component())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const GUST: Gust = Gust {
        speed: DVec3::new(2.0, 0.5, 0.0),
        period: 3.0,
        seed: 7,
    };

    #[test]
    fn components_have_their_mean_squares() {
        // 6000 periods, sampled 9 times in the shortest. Of two sines at least period/2 apart in
        // frequency the mean product over N periods is below 2/(2π N 0.5) = 1e-4 of a², and there
        // are 28 pairs and as many sums; so also for the mean itself.
        let samples = 486_000;
        let (mut mean, mut square) = (DVec3::ZERO, DVec3::ZERO);
        for k in 0..samples {
            let velocity = GUST.velocity(f64::from(k) * GUST.period / 81.0);
            mean += velocity / f64::from(samples);
            square += velocity * velocity / f64::from(samples);
        }
        assert!(mean.abs().max_element() < 1e-3 * 2.0, "{mean}");
        let relative = square / (GUST.speed * GUST.speed) - 1.0;
        assert!(
            relative.x.abs() < 6e-3 && relative.y.abs() < 6e-3,
            "{square}"
        );
        assert_eq!(square.z, 0.0);
    }

    #[test]
    fn time_and_seed_alone_decide_and_time_does_so_smoothly() {
        assert_eq!(GUST.velocity(12.5), GUST.velocity(12.5));
        let other = Gust { seed: 8, ..GUST };
        assert!(other.velocity(12.5).distance(GUST.velocity(12.5)) > 1e-3);
        // |dw/dt| ≤ s √2 Σ a_k 2π r_k/T / √Σ a_k² < s · 2π/T · √2 · Σ r^(1/6) < 2 · 2.1 · 16.
        let h = 1e-6;
        for k in 0..1000 {
            let time = 0.037 * f64::from(k);
            let change = GUST.velocity(time + h) - GUST.velocity(time);
            assert!(change.length() < 68.0 * h * 1.01);
        }
    }
}
