//! Gravity and air, which may come in gusts.
//!
//! A gust is a smooth random velocity of the air that is a pure function of seed and time, so that a
//! run can be repeated, and begun again anywhere, without any state being kept. Each component is a
//! sum of eight sines with incommensurate frequencies, whose amplitudes fall with the -5/6th power of
//! the frequency (Kolmogorov's spectrum, f^(-5/3), for equal steps of f). The air is the same
//! everywhere on the cloth: this is no turbulence in space.

use std::f64::consts::TAU;

use glam::DVec3;
use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::error::{SceneError, require, require_positive};
use crate::geometry::{sin_cos, unit};

/// Fastest wind `[m/s]`, some ten hurricanes, and its gusts.
const FASTEST_WIND: f64 = 1e3;
/// Strongest gravity `[m/s²]`.
const STRONGEST_GRAVITY: f64 = 1e6;
/// Part of its gravity with which an onset begins.
const ONSET: f64 = 0.05;

/// Gravity, air and wind around the cloth. Defaults: gravity (0, -9.8, 0), still air of density 1.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Environment {
    /// Acceleration of gravity `[m/s²]`.
    pub gravity: DVec3,
    /// Time in which gravity grows, ever faster, from a twentieth of its value `[s]`: a cloth is then
    /// laid down rather than dropped, and folds as one that is laid. The rest pose knows none.
    #[serde(skip_serializing_if = "is_zero")]
    pub onset: f64,
    /// Velocity of the wind `[m/s]`.
    pub wind: DVec3,
    /// Density of the air `[kg/m³]`: drag along a face's normal.
    pub air_density: f64,
    /// Drag along a face `[kg/(m² s)]`.
    pub air_drag: f64,
    /// Gusts, which are added to the constant wind.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub gust: Option<Gust>,
}

impl Default for Environment {
    fn default() -> Self {
        Self {
            gravity: DVec3::new(0.0, -9.8, 0.0),
            onset: 0.0,
            wind: DVec3::ZERO,
            air_density: 1.0,
            air_drag: 0.0,
            gust: None,
        }
    }
}

#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks for it")]
fn is_zero(seconds: &f64) -> bool {
    *seconds == 0.0
}

impl Environment {
    /// The environment during the step from `frame` to the next, at `frame_rate` frames per
    /// second: its wind is constant, wind + gust at the middle of the step. Held over a step, so
    /// that who sees a frame knows the air that acts until the next.
    pub fn during_step(&self, frame: usize, frame_rate: f64) -> Self {
        let time = (frame as f64 + 0.5) / frame_rate;
        let mut now = *self;
        if let Some(gust) = now.gust.take() {
            now.wind += gust.velocity(time);
        }
        if time < self.onset {
            now.gravity *= libm::pow(ONSET, 1.0 - time / self.onset);
        }
        now.onset = 0.0;
        now
    }

    /// Checks that every value is finite and within reason, no density negative, and a gust's
    /// period positive.
    ///
    /// # Errors
    /// Names the field, what it must be and what was found.
    pub fn validate(&self) -> Result<(), SceneError> {
        let within = |vector: DVec3, most: f64| (0.0..=most).contains(&vector.length());
        let holds = within(self.gravity, STRONGEST_GRAVITY);
        let expected = "finite, of at most 1e6 m/s²";
        require(holds, "environment.gravity", expected, self.gravity)?;
        let holds = within(self.wind, FASTEST_WIND);
        let expected = "finite, of at most 1000 m/s";
        require(holds, "environment.wind", expected, self.wind)?;
        for (field, value) in [
            ("environment.onset", self.onset),
            ("environment.air_density", self.air_density),
            ("environment.air_drag", self.air_drag),
        ] {
            let holds = value.is_finite() && value >= 0.0;
            require(holds, field, "finite and not negative", value)?;
        }
        let Some(gust) = &self.gust else {
            return Ok(());
        };
        require(
            within(gust.speed, FASTEST_WIND) && gust.speed.min_element() >= 0.0,
            "environment.gust.speed",
            "finite, not negative along each axis, and of at most 1000 m/s",
            gust.speed,
        )?;
        require_positive("environment.gust.period", gust.period)
    }
}

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
    use crate::error::refuses_toml;

    #[test]
    fn wrong_values_are_named() {
        refuses_toml(
            Environment::validate,
            "gravity = [0, nan, 0] | environment.gravity
             gravity = [1e7, 0, 0] | environment.gravity
             gravty = [0, 0, 0] | gravty
             onset = -1 | environment.onset
             wind = [inf, 0, 0] | environment.wind
             wind = [-1001, 0, 0] | environment.wind
             air_density = -1.0 | environment.air_density
             air_density = nan | environment.air_density
             air_drag = -0.1 | environment.air_drag
             gust = { speed = [1e4, 0, 0], period = 1, seed = 1 } | environment.gust.speed
             gust = { speed = [-1, 0, 0], period = 1, seed = 1 } | environment.gust.speed
             gust = { speed = [1, 0, 0], period = 0, seed = 1 } | environment.gust.period
             gust = { speed = [1, 0, 0], period = nan, seed = 1 } | environment.gust.period",
        );
    }

    #[test]
    fn gravity_grows_in_its_onset() {
        let laid = Environment {
            onset: 2.0,
            ..Environment::default()
        };
        let down = |frame| -laid.during_step(frame, 60.0).gravity.y;
        assert!((down(0) / 9.8 - 0.05).abs() < 1e-3, "{}", down(0));
        assert!((1..120).all(|frame| down(frame) > down(frame - 1)));
        assert!(down(119) < 9.8 && down(120) == 9.8 && down(1000) == 9.8);
    }

    #[test]
    fn a_step_has_the_wind_of_its_middle() {
        let still = Environment::default();
        assert_eq!(still.during_step(30, 60.0), still);
        let windy = Environment {
            wind: DVec3::new(3.0, 0.0, 0.0),
            gust: Some(GUST),
            ..still
        };
        let step = windy.during_step(30, 60.0);
        assert_eq!(step.wind, windy.wind + GUST.velocity(30.5 / 60.0));
        assert_eq!((step.gust, step.gravity), (None, still.gravity));
    }

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
        assert!(relative.truncate().abs().max_element() < 6e-3, "{square}");
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
