//! Adam (Kingma and Ba 2015) over one flat array of parameters, and clipping of a gradient by its
//! norm.
//!
//! m ← β₁ m + (1 - β₁) g, v ← β₂ v + (1 - β₂) g²,
//! θ ← θ - η (m / (1 - β₁ᵗ)) / (√(v / (1 - β₂ᵗ)) + ε) `[eq:adam]`
//!
//! Moments are f32 as the parameters; the corrections 1 - βᵗ are f64. Every parameter is treated
//! alone, so that the number of threads changes no bit. The rate η comes with each step, from a
//! schedule. A gradient that is not finite must be refused before it gets here.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Parameters that one thread updates at a time.
const CHUNK: usize = 1 << 15;

/// The constants of Adam.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct AdamSettings {
    /// Memory of the first moment, in [0, 1).
    pub beta1: f64,
    /// Memory of the second moment, in [0, 1).
    pub beta2: f64,
    /// Added to the root of the second moment.
    pub epsilon: f64,
}

/// The state of the optimiser.
#[derive(Clone, Debug, PartialEq)]
pub struct Adam {
    settings: AdamSettings,
    first_moment: Vec<f32>,
    second_moment: Vec<f32>,
    steps: u64,
}

/// Settings or a saved state that Adam cannot go on from.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum AdamError {
    #[error("optimizer.{field} must be {expected}, found {found}")]
    Setting {
        field: &'static str,
        expected: &'static str,
        found: f64,
    },
    #[error("the optimiser's {field} has {found} entries for {expected} parameters")]
    Count {
        field: &'static str,
        expected: usize,
        found: usize,
    },
    #[error("the optimiser's {field} must be {expected}, found {found} at entry {entry}")]
    Moment {
        field: &'static str,
        expected: &'static str,
        entry: usize,
        found: f32,
    },
}

impl Default for AdamSettings {
    fn default() -> Self {
        Self {
            beta1: 0.9,
            beta2: 0.999,
            epsilon: 1e-8,
        }
    }
}

impl AdamSettings {
    /// Checks the range of each constant.
    ///
    /// # Errors
    /// [`AdamError::Setting`] names the field.
    pub fn validate(&self) -> Result<(), AdamError> {
        let error = |field, expected, found| {
            Err(AdamError::Setting {
                field,
                expected,
                found,
            })
        };
        for (field, beta) in [("beta1", self.beta1), ("beta2", self.beta2)] {
            if !(0.0..1.0).contains(&beta) {
                return error(field, "at least 0 and below 1", beta);
            }
        }
        if !(self.epsilon.is_finite() && self.epsilon > 0.0) {
            return error("epsilon", "finite and positive", self.epsilon);
        }
        Ok(())
    }
}

impl Adam {
    /// Before the first step of `parameter_count` parameters.
    ///
    /// # Errors
    /// [`AdamError::Setting`].
    pub fn new(settings: AdamSettings, parameter_count: usize) -> Result<Self, AdamError> {
        settings.validate()?;
        Ok(Self {
            settings,
            first_moment: vec![0.0; parameter_count],
            second_moment: vec![0.0; parameter_count],
            steps: 0,
        })
    }

    /// The optimiser of a checkpoint: moments `[parameters]` after `steps` steps.
    ///
    /// # Errors
    /// [`AdamError`] when the settings or a moment cannot be used.
    pub fn resume(
        settings: AdamSettings,
        first_moment: Vec<f32>,
        second_moment: Vec<f32>,
        steps: u64,
    ) -> Result<Self, AdamError> {
        settings.validate()?;
        if first_moment.len() != second_moment.len() {
            return Err(AdamError::Count {
                field: "second moment",
                expected: first_moment.len(),
                found: second_moment.len(),
            });
        }
        check("first moment", &first_moment, "finite", f32::is_finite)?;
        check(
            "second moment",
            &second_moment,
            "finite and not negative",
            |x| x.is_finite() && x >= 0.0,
        )?;
        Ok(Self {
            settings,
            first_moment,
            second_moment,
            steps,
        })
    }

    /// The first moment m, `[parameters]`.
    #[must_use]
    pub fn first_moment(&self) -> &[f32] {
        &self.first_moment
    }

    /// The second moment v, `[parameters]`.
    #[must_use]
    pub fn second_moment(&self) -> &[f32] {
        &self.second_moment
    }

    /// Steps taken.
    #[must_use]
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The constants of the next step, for a machine that takes it by itself and then says so by
    /// [`Self::count_step`].
    #[must_use]
    pub fn next_rates(&self, learning_rate: f64) -> AdamRates {
        AdamRates::new(&self.settings, self.steps + 1, learning_rate)
    }

    /// Counts a step that was taken.
    pub fn count_step(&mut self) {
        self.steps += 1;
    }

    /// Both moments, for those that another machine has brought further, `[parameters]` each.
    pub fn moments_mut(&mut self) -> [&mut [f32]; 2] {
        [&mut self.first_moment, &mut self.second_moment]
    }

    /// One step of `parameters` against `gradient` (`[parameters]` both) at `learning_rate`.
    ///
    /// # Panics
    /// When a slice does not have the size of the moments.
    pub fn step(&mut self, parameters: &mut [f32], gradient: &[f32], learning_rate: f64) {
        assert_eq!(parameters.len(), self.first_moment.len(), "parameters");
        assert_eq!(gradient.len(), self.first_moment.len(), "gradient");
        let rates = self.next_rates(learning_rate);
        self.count_step();
        parameters
            .par_chunks_mut(CHUNK)
            .zip(gradient.par_chunks(CHUNK))
            .zip(self.first_moment.par_chunks_mut(CHUNK))
            .zip(self.second_moment.par_chunks_mut(CHUNK))
            .for_each(|(((parameters, gradient), first), second)| {
                rates.apply(parameters, gradient, first, second);
            });
    }
}

/// The constants of one step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AdamRates {
    /// β₁.
    pub keep1: f32,
    /// 1 - β₁.
    pub take1: f32,
    /// β₂.
    pub keep2: f32,
    /// 1 - β₂.
    pub take2: f32,
    /// η / (1 - β₁ᵗ).
    pub rate: f32,
    /// 1 / √(1 - β₂ᵗ).
    pub root: f32,
    /// ε.
    pub epsilon: f32,
}

impl AdamRates {
    fn new(settings: &AdamSettings, step: u64, learning_rate: f64) -> Self {
        let correction = |beta: f64| 1.0 - beta.powf(step as f64);
        Self {
            keep1: settings.beta1 as f32,
            take1: (1.0 - settings.beta1) as f32,
            keep2: settings.beta2 as f32,
            take2: (1.0 - settings.beta2) as f32,
            rate: (learning_rate / correction(settings.beta1)) as f32,
            root: correction(settings.beta2).sqrt().recip() as f32,
            epsilon: settings.epsilon as f32,
        }
    }

    fn apply(
        &self,
        parameters: &mut [f32],
        gradient: &[f32],
        first: &mut [f32],
        second: &mut [f32],
    ) {
        let moments = first.iter_mut().zip(second);
        for ((parameter, &g), (m, v)) in parameters.iter_mut().zip(gradient).zip(moments) {
            *m = self.keep1 * *m + self.take1 * g;
            *v = self.keep2 * *v + self.take2 * g * g;
            *parameter -= self.rate * *m / (v.sqrt() * self.root + self.epsilon);
        }
    }
}

/// Scales `gradient` down to the Euclidean norm `limit` if it is longer, and returns the norm that
/// it had. A gradient whose norm is not finite is left as it is: the caller must refuse it.
pub fn clip_norm(gradient: &mut [f32], limit: f64) -> f64 {
    // One sum per chunk, added in order: the same for any number of threads.
    let sums: Vec<f64> = gradient
        .par_chunks(CHUNK)
        .map(|chunk| chunk.iter().map(|&g| f64::from(g) * f64::from(g)).sum())
        .collect();
    let norm = sums.iter().sum::<f64>().sqrt();
    if norm.is_finite() && norm > limit {
        let scale = (limit / norm) as f32;
        gradient.par_chunks_mut(CHUNK).for_each(|chunk| {
            for g in chunk {
                *g *= scale;
            }
        });
    }
    norm
}

fn check(
    field: &'static str,
    values: &[f32],
    expected: &'static str,
    accept: impl Fn(f32) -> bool,
) -> Result<(), AdamError> {
    match values.iter().position(|&x| !accept(x)) {
        Some(entry) => Err(AdamError::Moment {
            field,
            expected,
            entry,
            found: values[entry],
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn adam(count: usize) -> Adam {
        Adam::new(AdamSettings::default(), count).expect("valid settings")
    }

    #[test]
    fn the_first_step_moves_by_the_rate_against_the_sign_of_the_gradient() {
        // m / (1 - β₁) = g and √(v / (1 - β₂)) = |g|: θ moves by η g / (|g| + ε).
        let gradient = [3.0_f32, -1e-3, 1e-8, 0.0];
        let mut parameters = [0.0_f32; 4];
        adam(4).step(&mut parameters, &gradient, 0.01);
        for (found, &g) in parameters.iter().zip(&gradient) {
            let expected = -0.01 * f64::from(g) / (f64::from(g).abs() + 1e-8);
            assert!(
                (f64::from(*found) - expected).abs() < 1e-8,
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn a_constant_gradient_moves_by_the_rate_at_every_step() {
        // Bias correction makes m̂ = g and v̂ = g² at every step.
        let (mut parameters, mut adam) = ([1.0_f32], adam(1));
        for _ in 0..1000 {
            adam.step(&mut parameters, &[0.37], 1e-4);
        }
        // 1000 roundings of numbers of about 1.
        assert!((parameters[0] - 0.9).abs() < 1000.0 * 6e-8);
        assert_eq!(adam.steps(), 1000);
    }

    #[test]
    fn steps_match_the_obvious_version_in_f64() {
        // More than a chunk, and gradients of very different size.
        let count = CHUNK + 77;
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        let sizes: Vec<f32> = (0..count)
            .map(|_| 10_f32.powf(8.0 * rng.random::<f32>() - 7.0))
            .collect();
        let mut parameters: Vec<f32> = (0..count).map(|_| rng.random::<f32>() - 0.5).collect();
        let mut slow: Vec<[f64; 3]> = parameters
            .iter()
            .map(|&p| [f64::from(p), 0.0, 0.0])
            .collect();
        let mut adam = adam(count);
        for step in 1..=30 {
            let gradient: Vec<f32> = sizes
                .iter()
                .map(|s| s * (rng.random::<f32>() - 0.4))
                .collect();
            adam.step(&mut parameters, &gradient, 1e-3);
            for ([p, m, v], &g) in slow.iter_mut().zip(&gradient) {
                let g = f64::from(g);
                *m = 0.9 * *m + 0.1 * g;
                *v = 0.999 * *v + 0.001 * g * g;
                let corrected = (*v / (1.0 - 0.999_f64.powi(step))).sqrt();
                *p -= 1e-3 * (*m / (1.0 - 0.9_f64.powi(step))) / (corrected + 1e-8);
            }
        }
        for (found, [expected, ..]) in parameters.iter().zip(&slow) {
            // 30 roundings of a parameter below 1, and 1e-6 of moves of 1e-3.
            assert!((f64::from(*found) - expected).abs() < 1e-6);
        }
    }

    #[test]
    fn it_finds_the_minimum_of_a_badly_scaled_valley() {
        // f = (x - 1)² / 2 + 1e6 (y + 2)² / 2: Adam does not see the scale.
        let (mut at, mut adam) = ([0.0_f32, 0.0], adam(2));
        for step in 0..4000 {
            let gradient = [at[0] - 1.0, 1e6 * (at[1] + 2.0)];
            adam.step(&mut at, &gradient, 0.01 * (1.0 - f64::from(step) / 4000.0));
        }
        assert!(
            (at[0] - 1.0).abs() < 1e-3 && (at[1] + 2.0).abs() < 1e-3,
            "{at:?}"
        );
    }

    #[test]
    fn a_resumed_run_gives_the_same_bytes() {
        let gradient = |k: u64| {
            let mut rng = ChaCha8Rng::seed_from_u64(k);
            [(); 5].map(|()| rng.random::<f32>() - 0.5)
        };
        let (mut whole, mut parts) = ([0.5_f32; 5], [0.5_f32; 5]);
        let (mut one, mut first) = (adam(5), adam(5));
        for k in 0..20 {
            one.step(&mut whole, &gradient(k), 1e-2);
        }
        for k in 0..7 {
            first.step(&mut parts, &gradient(k), 1e-2);
        }
        let (m, v) = (
            first.first_moment().to_vec(),
            first.second_moment().to_vec(),
        );
        let settings = AdamSettings::default();
        let mut second = Adam::resume(settings, m, v, first.steps()).expect("its own moments");
        for k in 7..20 {
            second.step(&mut parts, &gradient(k), 1e-2);
        }
        assert_eq!((whole, one), (parts, second));
    }

    #[test]
    fn clipping_keeps_direction_and_caps_length() {
        let count = 2 * CHUNK + 5;
        let start: Vec<f32> = (0..count).map(|k| (k % 7) as f32 - 3.0).collect();
        let exact = start.iter().map(|&g| f64::from(g * g)).sum::<f64>().sqrt();
        let mut gradient = start.clone();
        assert_eq!(clip_norm(&mut gradient, 2.0 * exact), exact);
        assert_eq!(gradient, start);
        clip_norm(&mut gradient, 1.0);
        let factor = 1.0 / exact;
        for (found, &g) in gradient.iter().zip(&start) {
            assert!((f64::from(*found) - factor * f64::from(g)).abs() <= 2e-7 * factor * 3.0);
        }
        let mut broken = [f32::NAN, 5.0];
        assert!(clip_norm(&mut broken, 1.0).is_nan());
        assert_eq!(broken[1], 5.0);
    }

    #[test]
    fn settings_and_saved_moments_are_checked() {
        let settings = |beta2| AdamSettings {
            beta2,
            ..AdamSettings::default()
        };
        let message = Adam::new(settings(1.0), 3)
            .expect_err("no memory")
            .to_string();
        assert_eq!(
            message,
            "optimizer.beta2 must be at least 0 and below 1, found 1"
        );
        let resume = |m: &[f32], v: &[f32]| {
            let result = Adam::resume(AdamSettings::default(), m.to_vec(), v.to_vec(), 1);
            result.expect_err("a defect").to_string()
        };
        assert!(resume(&[0.0], &[]).contains("second moment has 0 entries for 1"));
        assert!(resume(&[f32::NAN], &[0.0]).contains("first moment must be finite"));
        assert!(resume(&[0.0], &[-1.0]).contains("not negative, found -1 at entry 0"));
    }
}
