//! The engine of this machine's processor. Threads share micro-batches of slots, and the gradients
//! of micro-batches are added in order. Neither a micro-batch nor the order of the sums depends on
//! the number of threads, so the same seed gives the same bytes with any number of them.

use std::ops::Range;

use rayon::prelude::*;
use selvedge_model::{Instructions, PackedWeights, Purpose};

use super::micro_batch::{MicroBatch, Shared};
use super::{Engine, EngineError, EngineMaker, Learned, Setup, SlotRun, Update};
use crate::losses::LossTerms;

/// Settings of the engine of this machine's processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct OnProcessor {
    /// Slots of a micro-batch, at least 1, whose gradients are summed in one buffer. In a step of
    /// one frame they go through the network together, as one disjoint union; in a step of several
    /// frames one after the other. Threads share micro-batches; a larger one saves memory for
    /// gradients and leaves less to share.
    pub micro_batch: usize,
}

impl Default for OnProcessor {
    fn default() -> Self {
        Self { micro_batch: 1 }
    }
}

impl EngineMaker for OnProcessor {
    fn micro_batch(&self) -> Option<usize> {
        Some(self.micro_batch.max(1))
    }

    fn make(&self, setup: Setup<'_>) -> Result<Box<dyn Engine>, EngineError> {
        let (weights, micro_batch) = (&setup.learned.weights, self.micro_batch.max(1));
        let count = setup.cfg.batch.samples.div_ceil(micro_batch);
        let batch = |_| MicroBatch::new(setup.cfg.losses, weights.len());
        let (purpose, using) = (Purpose::Training, Instructions::Detected);
        Ok(Box::new(CpuEngine {
            packed: setup.network.pack(weights, purpose, using),
            micro_batch,
            batches: (0..count).map(batch).collect(),
            gradient: vec![0.0; weights.len()],
            is_summed: true,
        }))
    }
}

/// The engine: its micro-batches and what they share.
struct CpuEngine {
    packed: PackedWeights<f32>,
    micro_batch: usize,
    batches: Vec<MicroBatch>,
    /// Gradient of the mean over the batch, `[parameters]`.
    gradient: Vec<f32>,
    /// True where that is of the latest batch.
    is_summed: bool,
}

impl CpuEngine {
    /// Adds the gradients of the micro-batches in their order, whatever the number of threads.
    fn sum_gradients(&mut self) {
        if self.is_summed {
            return;
        }
        self.is_summed = true;
        const CHUNK: usize = 16 * 1024;
        let batches = &self.batches;
        let chunks = self.gradient.par_chunks_mut(CHUNK).enumerate();
        chunks.for_each(|(chunk, sum)| {
            sum.fill(0.0);
            for batch in batches {
                let part = &batch.gradient[chunk * CHUNK..][..sum.len()];
                sum.iter_mut().zip(part).for_each(|(s, g)| *s += g);
            }
        });
    }
}

impl Engine for CpuEngine {
    fn learn(
        &mut self,
        setup: Setup<'_>,
        slots: &mut [SlotRun<'_>],
    ) -> Result<Vec<LossTerms>, EngineError> {
        let weights = &setup.learned.weights;
        setup.network.repack(weights, &mut self.packed);
        let shared = Shared {
            setup,
            frames: slots.first().map_or(1, SlotRun::frames),
            weights: &self.packed,
        };
        slots
            .par_chunks_mut(self.micro_batch)
            .zip(&mut self.batches)
            .for_each(|(slots, batch)| batch.learn(&shared, slots));
        self.is_summed = false;
        if self.batches.iter().any(|batch| batch.terms.is_empty()) {
            return Ok(Vec::new());
        }
        let terms = self.batches.iter().flat_map(|batch| &batch.terms);
        Ok(terms.copied().collect())
    }

    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError> {
        self.sum_gradients();
        Ok(learned.update(&mut self.gradient, update))
    }

    fn add_gradient(&mut self, range: Range<usize>, sum: &mut [f32]) -> Result<(), EngineError> {
        for batch in &self.batches {
            let part = &batch.gradient[range.clone()];
            sum.iter_mut().zip(part).for_each(|(s, g)| *s += g);
        }
        Ok(())
    }

    fn set_gradient(&mut self, gradient: &[f32]) -> Result<(), EngineError> {
        self.gradient.copy_from_slice(gradient);
        self.is_summed = true;
        Ok(())
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        self.sum_gradients();
        Ok(self.gradient.clone())
    }

    fn collect(&mut self, _: &mut Learned) -> Result<(), EngineError> {
        Ok(())
    }
}
