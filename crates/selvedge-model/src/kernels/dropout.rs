//! Dropout between the layers of the recurrent encoders: a value becomes 0 with probability `rate`
//! and is divided by 1 - `rate` otherwise.
//!
//! Value `column` of a row in frame `step` becomes 0 where the upper half of the hash (SplitMix64)
//! of seed + (row · steps + step) · latent + column is below `rate`. The seed belongs to the row's
//! cloth, and rows are counted within that cloth. The mask of a cloth is therefore the same alone
//! and in any union.

use std::ops::Range;

use crate::kernels::real::Real;

/// Dropout of a training pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dropout<'a> {
    /// Probability of a zero.
    pub rate: f64,
    /// Seed of each cloth of the graph, `[cloths]`.
    pub seeds: &'a [u64],
}

impl Dropout<'_> {
    /// Seeds of the vertices and of the arcs of a cloth with this seed.
    pub fn row_seeds(seed: u64) -> [u64; 2] {
        [seed, split_mix(!seed)]
    }
}

/// Masks of all rows of one kind, vertices or arcs.
#[derive(Clone, Debug, Default)]
pub(crate) struct RowMasks {
    rate: f64,
    /// Hashed number of the first value of each row, `[rows]`; empty without dropout.
    first: Vec<u64>,
}

impl RowMasks {
    /// Prepares the masks of the rows of `cloths`, of each its seed and the number of its rows; a row
    /// has `values` values in all its frames.
    pub(crate) fn fit(
        &mut self,
        rate: f64,
        cloths: impl Iterator<Item = (u64, usize)>,
        values: usize,
    ) {
        self.rate = rate;
        self.first.clear();
        if rate <= 0.0 {
            return;
        }
        for (seed, rows) in cloths {
            let numbers = (0..rows).map(|row| seed.wrapping_add((row * values) as u64));
            self.first.extend(numbers);
        }
    }

    /// These masks, unless they keep every value.
    pub(crate) fn active(&self) -> Option<&Self> {
        (self.rate > 0.0).then_some(self)
    }

    /// Multiplies `values`, those of `rows` in frame `step`, by their mask.
    pub(crate) fn apply<T: Real>(&self, values: &mut [T], rows: Range<usize>, step: usize) {
        let scale = T::from_f64(1.0 / (1.0 - self.rate));
        let threshold = (self.rate * (1u64 << 32) as f64) as u64;
        let width = values.len() / rows.len().max(1);
        let values = values.chunks_exact_mut(width.max(1));
        for (&first, values) in self.first[rows].iter().zip(values) {
            let first = first.wrapping_add((step * width) as u64);
            for (column, value) in values.iter_mut().enumerate() {
                let hash = split_mix(first.wrapping_add(column as u64));
                let kept = hash >> 32 >= threshold;
                *value *= if kept { scale } else { T::ZERO };
            }
        }
    }
}

/// A hash of 64 bits to 64 bits (Steele, Lea and Flood 2014).
fn split_mix(number: u64) -> u64 {
    let z = number.wrapping_mul(0x9E37_79B9_7F4A_7C15);
    let z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
    let z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
    z ^ (z >> 31)
}

#[cfg(test)]
mod tests {
    use super::*;

    const RATE: f64 = 0.3;

    /// The masks of a cloth of so many rows with this seed, all steps of all rows.
    fn masks(seed: u64, rows: usize, steps: usize, width: usize) -> Vec<f64> {
        let mut masks = RowMasks::default();
        masks.fit(RATE, [(seed, rows)].into_iter(), steps * width);
        let all = (0..steps).map(|step| {
            let mut values = vec![1.0; rows * width];
            masks.apply(&mut values, 0..rows, step);
            values
        });
        all.flatten().collect()
    }

    #[test]
    fn the_part_of_zeros_is_the_rate_and_the_mean_is_kept() {
        let rows = if cfg!(miri) { 20 } else { 500 };
        let values = masks(3, rows, 4, 16);
        let count = values.len() as f64;
        let zeros = values.iter().filter(|&&x| x == 0.0).count() as f64 / count;
        // Six deviations of the mean of all draws: 0.015 for 32000.
        let bound = 6.0 * (RATE * (1.0 - RATE) / count).sqrt();
        assert!((zeros - RATE).abs() < bound, "{zeros}");
        let mean = values.iter().sum::<f64>() / count;
        assert!((mean - 1.0).abs() < bound / (1.0 - RATE), "{mean}");
        assert_ne!(values, masks(4, rows, 4, 16));
    }
}
