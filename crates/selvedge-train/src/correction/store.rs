//! Samples, and the latest ones that are kept.

use std::sync::Arc;

use selvedge_model::ClothGraph;

/// A cheap frame of physics, and the corrections that lead to its teacher's.
#[derive(Clone, Debug)]
pub struct CorrectionSample {
    /// The cloth.
    pub graph: Arc<ClothGraph>,
    /// Columns of the vertices, `[vertices, node width]`.
    pub nodes: Vec<f32>,
    /// Corrections that lead to the teacher's frame, `[vertices, 6]`.
    pub target: Vec<f32>,
    /// Weight of each vertex in the loss, 0 where it is not corrected, `[vertices]`: the square of
    /// what its corrections are measured by, with a mean of 1 over those that are.
    pub weights: Vec<f32>,
}

/// The latest samples.
#[derive(Debug, Default)]
pub(super) struct Store {
    samples: Vec<CorrectionSample>,
    /// The oldest one, once all places are taken.
    oldest: usize,
    /// Samples that were ever added.
    pub(super) added: u64,
}

impl Store {
    /// Adds a sample; the oldest one goes when there are `most`.
    pub(super) fn add(&mut self, sample: CorrectionSample, most: usize) {
        self.added += 1;
        if self.samples.len() < most {
            self.samples.push(sample);
            return;
        }
        self.samples[self.oldest] = sample;
        self.oldest = (self.oldest + 1) % most;
    }

    pub(super) fn samples(&self) -> &[CorrectionSample] {
        &self.samples
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correction::learning::tests::sample;

    #[test]
    fn the_oldest_sample_makes_room() {
        let mut store = Store::default();
        for number in 0..5 {
            let mut sample = sample(number);
            sample.target[0] = number as f32;
            store.add(sample, 3);
        }
        let mut kept: Vec<f32> = store.samples().iter().map(|s| s.target[0]).collect();
        kept.sort_by(f32::total_cmp);
        assert_eq!(kept, [2.0, 3.0, 4.0]);
        assert_eq!(store.added, 5);
    }
}
