//! Normalisation of features and targets to mean 0 and deviation 1. Statistics are fitted in
//! training and then frozen. The two states are different types, so that statistics cannot change
//! in a rollout.
//!
//! Counts, means and sums of squares are f64 and merged in the order of the calls (Chan, Golub and
//! LeVeque 1983), so that the same samples in the same order give the same bytes.
//!
//! A component that did not vary in training must not blow up when it varies later: it normalises
//! to exactly 0 and denormalises to its mean. It counts as varying in comparison with the
//! components that share its unit (a vector with its length), not with an absolute floor: a kinetic
//! energy of 1e-8 varies, a vector's component of 1e-8 m beside others of 0.03 m does not.

use serde::{Deserialize, Serialize};

use crate::spec::SpecError;

/// A component whose deviation is below this part of its group's root mean square is constant:
/// f32 positions of 1 m give an edge of 0.03 m a rounding noise of 2e-6 of its length.
const LEAST_DEVIATION: f64 = 1e-4;

/// Statistics that still change. `groups` are the widths of consecutive columns that share a unit
/// and a scale.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunningStatistics {
    groups: Vec<usize>,
    count: f64,
    mean: Vec<f64>,
    /// Sums of squared differences from the mean.
    squares: Vec<f64>,
}

/// Frozen statistics of the components of a row.
#[derive(Clone, Debug, PartialEq)]
pub struct Normalizer {
    mean: Vec<f64>,
    deviation: Vec<f64>,
    shift: Vec<f32>,
    /// 1 / deviation, or 0 for a constant component.
    scale: Vec<f32>,
    spread: Vec<f32>,
}

impl RunningStatistics {
    /// Statistics of no samples, for rows whose consecutive columns form `groups` of these widths.
    pub fn new(groups: &[usize]) -> Self {
        let width = groups.iter().sum();
        Self {
            groups: groups.to_vec(),
            count: 0.0,
            mean: vec![0.0; width],
            squares: vec![0.0; width],
        }
    }

    /// Statistics that freeze to `normalizer`, as of a single row.
    ///
    /// # Panics
    /// When `groups` have another width.
    pub fn of(normalizer: &Normalizer, groups: &[usize]) -> Self {
        let width: usize = groups.iter().sum();
        assert_eq!(width, normalizer.mean.len(), "one component per column");
        Self {
            groups: groups.to_vec(),
            count: 1.0,
            mean: normalizer.mean.clone(),
            squares: normalizer.deviation.iter().map(|d| d * d).collect(),
        }
    }

    /// Checks what was read from a file: that it has `groups`, and numbers that statistics can have.
    ///
    /// # Errors
    /// Names the numbers and the first one that cannot be.
    pub fn check(&self, groups: &[usize]) -> Result<(), SpecError> {
        if self.groups != groups {
            let found = &self.groups;
            let problem = format!("groups of {found:?} columns, expected {groups:?}");
            return Err(SpecError(problem));
        }
        let width = groups.iter().sum();
        check("mean", &self.mean, width, f64::NEG_INFINITY)?;
        check("squares", &self.squares, width, 0.0)?;
        check("count", &[self.count], 1, 0.0)
    }

    /// Number of rows so far.
    pub fn count(&self) -> f64 {
        self.count
    }

    /// Adds `rows` (`[rows, width]`): their own mean and squares by two passes, then
    /// [`Self::merge`].
    ///
    /// # Panics
    /// When `rows` is not whole rows.
    pub fn add<T: Copy + Into<f64>>(&mut self, rows: &[T]) {
        let width = self.mean.len();
        if rows.is_empty() {
            return;
        }
        assert_eq!(rows.len() % width, 0, "whole rows of {width}");
        let mut batch = Self::new(&self.groups);
        batch.count = (rows.len() / width) as f64;
        for row in rows.chunks_exact(width) {
            for (mean, &x) in batch.mean.iter_mut().zip(row) {
                *mean += x.into();
            }
        }
        for mean in &mut batch.mean {
            *mean /= batch.count;
        }
        for row in rows.chunks_exact(width) {
            for ((squares, mean), &x) in batch.squares.iter_mut().zip(&batch.mean).zip(row) {
                let difference = x.into() - mean;
                *squares += difference * difference;
            }
        }
        self.merge(&batch);
    }

    /// Adds the rows of `other` `[eq:merged-statistics]`: with n = n₁ + n₂ and δ = m₂ - m₁,
    /// m = m₁ + δ n₂/n and S = S₁ + S₂ + δ² n₁ n₂/n.
    ///
    /// # Panics
    /// When `other` has other groups.
    pub fn merge(&mut self, other: &Self) {
        assert_eq!(self.groups, other.groups, "statistics of the same columns");
        if other.count == 0.0 {
            return;
        }
        let count = self.count + other.count;
        let part = other.count / count;
        for k in 0..self.mean.len() {
            let difference = other.mean[k] - self.mean[k];
            self.mean[k] += difference * part;
            self.squares[k] += other.squares[k] + difference * difference * self.count * part;
        }
        self.count = count;
    }

    /// Freezes the statistics as they are.
    pub fn freeze(&self) -> Normalizer {
        let rows = self.count.max(1.0);
        let mut deviation: Vec<f64> = self.squares.iter().map(|s| (s / rows).sqrt()).collect();
        let mut first = 0;
        for &width in &self.groups {
            let group = first..first + width;
            let power: f64 = group
                .clone()
                .map(|k| self.mean[k] * self.mean[k] + self.squares[k] / rows)
                .sum();
            let least = LEAST_DEVIATION * (power / width as f64).sqrt();
            for deviation in &mut deviation[group] {
                if *deviation <= least {
                    *deviation = 0.0;
                }
            }
            first += width;
        }
        Normalizer::from_checked(self.mean.clone(), deviation)
    }
}

impl Normalizer {
    /// Statistics from a weight file: `mean` and `deviation` (0 for a constant component),
    /// `[width]`.
    ///
    /// # Errors
    /// Different widths, a value that is not finite, a negative deviation.
    pub fn new(mean: Vec<f64>, deviation: Vec<f64>) -> Result<Self, SpecError> {
        check("mean", &mean, mean.len(), f64::NEG_INFINITY)?;
        check("deviation", &deviation, mean.len(), 0.0)?;
        Ok(Self::from_checked(mean, deviation))
    }

    fn from_checked(mean: Vec<f64>, deviation: Vec<f64>) -> Self {
        let scale = |&d: &f64| if d > 0.0 { (1.0 / d) as f32 } else { 0.0 };
        Self {
            shift: mean.iter().map(|&m| m as f32).collect(),
            scale: deviation.iter().map(scale).collect(),
            spread: deviation.iter().map(|&d| d as f32).collect(),
            mean,
            deviation,
        }
    }

    /// Number of components of a row.
    pub fn width(&self) -> usize {
        self.mean.len()
    }

    /// Mean of each component, `[width]`.
    pub fn mean(&self) -> &[f64] {
        &self.mean
    }

    /// Standard deviation of each component, 0 where it counts as constant, `[width]`.
    pub fn deviation(&self) -> &[f64] {
        &self.deviation
    }

    /// x ← (x - mean) / deviation, and 0 for constant components, in every row of `rows`
    /// (`[rows, width]`).
    ///
    /// # Panics
    /// When `rows` is not whole rows.
    pub fn normalize(&self, rows: &mut [f32]) {
        for row in self.rows_of(rows) {
            for ((x, &shift), &scale) in row.iter_mut().zip(&self.shift).zip(&self.scale) {
                *x = if scale > 0.0 { (*x - shift) * scale } else { 0.0 };
            }
        }
    }

    /// g ← g / deviation, and 0 for constant components: from the gradient of normalised rows
    /// (`[rows, width]`) to that of the rows themselves.
    ///
    /// # Panics
    /// When `rows` is not whole rows.
    pub fn scale_gradient(&self, rows: &mut [f32]) {
        for row in self.rows_of(rows) {
            for (g, &scale) in row.iter_mut().zip(&self.scale) {
                *g *= scale;
            }
        }
    }

    /// x ← x deviation + mean, in every row of `rows` (`[rows, width]`).
    ///
    /// # Panics
    /// When `rows` is not whole rows.
    pub fn denormalize(&self, rows: &mut [f32]) {
        for row in self.rows_of(rows) {
            for ((x, &shift), &spread) in row.iter_mut().zip(&self.shift).zip(&self.spread) {
                *x = *x * spread + shift;
            }
        }
    }

    fn rows_of<'a>(&self, rows: &'a mut [f32]) -> std::slice::ChunksExactMut<'a, f32> {
        let width = self.width();
        assert_eq!(rows.len() % width, 0, "whole rows of {width}");
        rows.chunks_exact_mut(width)
    }
}

/// Checks that there are `width` finite values, none of them below `least`.
fn check(field: &str, values: &[f64], width: usize, least: f64) -> Result<(), SpecError> {
    let found = values.len();
    if found != width {
        return Err(SpecError(format!(
            "{field} has {found} components, expected {width}"
        )));
    }
    let expected = if least < 0.0 { "finite" } else { "finite and not negative" };
    match values.iter().position(|x| !x.is_finite() || *x < least) {
        Some(component) => Err(SpecError(format!(
            "{field} of component {component} must be {expected}, found {}",
            values[component]
        ))),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    fn rows(count: usize, scales: &[f64], seed: u64) -> Vec<f32> {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        (0..count)
            .flat_map(|_| {
                scales
                    .iter()
                    .map(|s| (s * (rng.random::<f64>() + 3.0)) as f32)
                    .collect::<Vec<_>>()
            })
            .collect()
    }

    #[test]
    fn statistics_match_two_passes_over_everything() {
        let data = rows(1000, &[1.0, 1e-8, 300.0], 1);
        let mut running = RunningStatistics::new(&[1, 1, 1]);
        for part in data.chunks(3 * 77) {
            running.add(part);
        }
        let frozen = running.freeze();
        assert_eq!(running.count(), 1000.0);
        for k in 0..3 {
            let column = || data.iter().skip(k).step_by(3).map(|&x| f64::from(x));
            let mean = column().sum::<f64>() / 1000.0;
            let variance = column().map(|x| (x - mean).powi(2)).sum::<f64>() / 1000.0;
            assert!((frozen.mean()[k] / mean - 1.0).abs() < 1e-13);
            assert!((frozen.deviation()[k] / variance.sqrt() - 1.0).abs() < 1e-13);
        }
    }

    #[test]
    fn many_small_batches_far_from_zero_lose_nothing() {
        let mut running = RunningStatistics::new(&[1]);
        for k in 0..100_000 {
            running.add(&[1e4 + f64::from(k % 2)]);
        }
        let frozen = running.freeze();
        // Half of 1 and half of 0 about 1e4; 1e5 roundings of 1e-16 · 1e4 at the very most.
        assert!((frozen.mean()[0] - 1e4 - 0.5).abs() < 1e-7);
        assert!((running.squares[0] / 1e5 - 0.25).abs() < 1e-7);
    }

    #[test]
    fn normalised_rows_have_mean_0_and_deviation_1_and_come_back() {
        let data = rows(500, &[2e-8, 5.0], 2);
        let mut running = RunningStatistics::new(&[1, 1]);
        running.add(&data);
        let frozen = running.freeze();
        let mut normal = data.clone();
        frozen.normalize(&mut normal);
        let mut after = RunningStatistics::new(&[1, 1]);
        after.add(&normal);
        for k in 0..2 {
            // The mean is 12 deviations from 0: f32 rounding is 12 · 6e-8 of a deviation.
            assert!(after.freeze().mean()[k].abs() < 2e-6);
            assert!((after.freeze().deviation()[k] - 1.0).abs() < 2e-6);
        }
        frozen.denormalize(&mut normal);
        for (found, expected) in normal.iter().zip(&data) {
            assert!((found / expected - 1.0).abs() < 1e-6);
        }
    }

    #[test]
    fn a_component_that_did_not_vary_gives_0_and_its_mean_whatever_comes() {
        // A vector of 0.03 m whose first component is rounding noise, a constant, and an energy.
        let data: Vec<f64> = rows(200, &[1e-9, 0.03, 0.02, 1e-8], 3)
            .chunks(4)
            .flat_map(|r| [r[0], r[1], r[2], 0.7, r[3]].map(f64::from))
            .collect();
        let mut running = RunningStatistics::new(&[3, 1, 1]);
        running.add(&data);
        let frozen = running.freeze();
        let constant: Vec<bool> = frozen.deviation().iter().map(|&d| d == 0.0).collect();
        assert_eq!(constant, [true, false, false, true, false]);
        let mut row = [0.05, 0.1, 0.1, f32::INFINITY, 3.5e-8];
        frozen.normalize(&mut row);
        assert_eq!((row[0], row[3]), (0.0, 0.0));
        assert!(row[4].abs() < 2.0);
        let mut row = [9.0; 5];
        frozen.denormalize(&mut row);
        assert_eq!(row[3], 0.7);
        assert!(row[0] < 5e-9);
    }

    #[test]
    fn no_samples_and_one_sample_do_not_divide_by_zero() {
        let mut running = RunningStatistics::new(&[2]);
        assert_eq!(running.freeze().deviation(), [0.0, 0.0]);
        running.add::<f32>(&[]);
        assert_eq!(running.count(), 0.0);
        running.add(&[1.0_f32, -4.0]);
        assert_eq!(running.freeze().mean(), [1.0, -4.0]);
        assert_eq!(running.freeze().deviation(), [0.0, 0.0]);
    }

    #[test]
    fn a_checkpoint_keeps_every_bit_and_a_damaged_one_is_refused() {
        let mut running = RunningStatistics::new(&[2, 1]);
        running.add(&rows(1001, &[0.1, 1e-9, 1e5], 4));
        let text = serde_json::to_string(&running).expect("plain numbers");
        let back: RunningStatistics = serde_json::from_str(&text).expect("what was written");
        assert_eq!(back, running);
        assert_eq!(back.check(&[2, 1]), Ok(()));
        for (from, to, expected) in [
            (
                "[2,1]",
                "[2,2]",
                "groups of [2, 2] columns, expected [2, 1]",
            ),
            (
                "\"mean\":[",
                "\"mean\":[0.5,",
                "mean has 4 components, expected 3",
            ),
            ("1001.0", "-1.0", "count of component 0"),
            ("\"squares\":[", "\"squares\":[-", "squares of component 0"),
        ] {
            let damaged = serde_json::from_str::<RunningStatistics>(&text.replace(from, to));
            let error = damaged
                .expect("numbers")
                .check(&[2, 1])
                .expect_err(expected);
            assert!(error.to_string().contains(expected), "{error}");
        }
    }
}
