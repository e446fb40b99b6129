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

use crate::bounds::{ConfigError, below_one, positive, require};

/// Parameters that one thread updates at a time.
const CHUNK: usize = 1 << 15;

const FIRST_MOMENT: &str = "the optimiser's first moment";
const SECOND_MOMENT: &str = "the optimiser's second moment";

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
    pub fn validate(&self) -> Result<(), ConfigError> {
        below_one("optimizer.beta1", self.beta1)?;
        below_one("optimizer.beta2", self.beta2)?;
        positive("optimizer.epsilon", self.epsilon)
    }
}

impl Adam {
    /// Before the first step of `parameter_count` parameters.
    pub fn new(settings: AdamSettings, parameter_count: usize) -> Result<Self, ConfigError> {
        settings.validate()?;
        Ok(Self {
            settings,
            first_moment: vec![0.0; parameter_count],
            second_moment: vec![0.0; parameter_count],
            steps: 0,
        })
    }

    /// The optimiser of a checkpoint: moments `[parameters]` after `steps` steps.
    pub fn resume(
        settings: AdamSettings,
        first_moment: Vec<f32>,
        second_moment: Vec<f32>,
        steps: u64,
    ) -> Result<Self, ConfigError> {
        settings.validate()?;
        let (count, found) = (first_moment.len(), second_moment.len());
        let expected = format!("of {count} parameters");
        require(found == count, SECOND_MOMENT, expected, found)?;
        for (field, values, expected, least) in [
            (FIRST_MOMENT, &first_moment, "finite", f32::MIN),
            (
                SECOND_MOMENT,
                &second_moment,
                "finite and not negative",
                0.0,
            ),
        ] {
            let is_bad = |x: &f32| !x.is_finite() || *x < least;
            if let Some(entry) = values.iter().position(is_bad) {
                let found = format!("{} at entry {entry}", values[entry]);
                require(false, field, expected, found)?;
            }
        }
        Ok(Self {
            settings,
            first_moment,
            second_moment,
            steps,
        })
    }

    /// The first moment m, `[parameters]`.
    pub fn first_moment(&self) -> &[f32] {
        &self.first_moment
    }

    /// The second moment v, `[parameters]`.
    pub fn second_moment(&self) -> &[f32] {
        &self.second_moment
    }

    /// Steps taken.
    pub fn steps(&self) -> u64 {
        self.steps
    }

    /// The constants of the next step, for a machine that takes it by itself and then says so by
    /// [`Self::count_step`].
    pub fn next_rates(&self, learning_rate: f64) -> AdamRates {
        let (settings, step) = (&self.settings, self.steps + 1);
        let correction = |beta: f64| 1.0 - beta.powf(step as f64);
        AdamRates {
            keep1: settings.beta1 as f32,
            take1: (1.0 - settings.beta1) as f32,
            keep2: settings.beta2 as f32,
            take2: (1.0 - settings.beta2) as f32,
            rate: (learning_rate / correction(settings.beta1)) as f32,
            root: correction(settings.beta2).sqrt().recip() as f32,
            epsilon: settings.epsilon as f32,
        }
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

#[cfg(test)]
mod tests;
