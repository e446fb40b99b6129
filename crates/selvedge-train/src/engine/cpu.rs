//! The engine on this machine's processor: threads share shards of slots, and the shards' gradients are
//! added in order. What a shard computes and the order of the sums do not depend on the number of threads,
//! so that the same seed gives the same bytes with any number of them.

use rayon::prelude::*;
use selvedge_model::{Instructions, Network, PackedWeights, Purpose};

use crate::config::TrainConfig;
use crate::engine::micro_batch::{Context, MicroBatch};
use crate::engine::{Batch, Engine, EngineError, Learned, Setup, Update};
use crate::losses::LossTerms;
use crate::optimizer::clip_norm;

/// CpuEngine and what they share.
pub(crate) struct CpuEngine {
    packed: PackedWeights<f32>,
    shards: Vec<MicroBatch>,
    /// The mean over the batch, `[parameters]`.
    gradient: Vec<f32>,
    samples: usize,
}

impl CpuEngine {
    pub(crate) fn new(cfg: &TrainConfig, network: &Network, weights: &[f32]) -> Self {
        let (samples, shard) = (cfg.batch.samples, cfg.batch.shard);
        let shards = (0..samples.div_ceil(shard))
            .map(|k| MicroBatch::new(cfg, weights.len(), samples - k * shard))
            .collect();
        let (purpose, using) = (Purpose::Training, Instructions::Detected);
        Self {
            packed: PackedWeights::new(network, weights, purpose, using),
            shards,
            gradient: vec![0.0; weights.len()],
            samples,
        }
    }

    /// The mean over the batch of the shards' gradients, added in their order whatever the number
    /// of threads.
    fn sum_gradients(&mut self) {
        const CHUNK: usize = 16 * 1024;
        let share = 1.0 / self.samples as f32;
        let shards = &self.shards;
        let chunks = self.gradient.par_chunks_mut(CHUNK).enumerate();
        chunks.for_each(|(chunk, sum)| {
            sum.fill(0.0);
            for shard in shards {
                let part = &shard.gradient[chunk * CHUNK..][..sum.len()];
                sum.iter_mut().zip(part).for_each(|(s, g)| *s += share * g);
            }
        });
    }
}

impl Engine for CpuEngine {
    fn learn(&mut self, batch: Batch<'_>) -> Result<Vec<LossTerms>, EngineError> {
        let Setup {
            cfg,
            network,
            normalizers,
            statistics,
            learned,
            set,
        } = batch.setup;
        self.packed.update(network, &learned.weights);
        let context = Context {
            cfg,
            set,
            network,
            weights: &self.packed,
            normalizers,
            statistics,
            step: batch.step,
        };
        batch
            .slots
            .par_chunks_mut(cfg.batch.shard)
            .zip(&mut self.shards)
            .enumerate()
            .for_each(|(number, (slots, shard))| match batch.frames {
                1 => shard.learn(&context, number, slots),
                frames => shard.learn_unrolled(&context, (number, frames), slots),
            });
        self.sum_gradients();
        let terms = self.shards.iter().flat_map(|shard| &shard.terms);
        Ok(terms.copied().collect())
    }

    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError> {
        let norm = clip_norm(&mut self.gradient, update.clip);
        if !norm.is_finite() {
            return Ok(norm);
        }
        let Learned {
            weights,
            averaged,
            adam,
        } = learned;
        adam.step(weights, &self.gradient, update.learning_rate);
        if let (Some(part), Some(averaged)) = (update.average, averaged) {
            let share = Learned::averaging(adam.steps(), part);
            for (mean, &weight) in averaged.iter_mut().zip(&*weights) {
                *mean += share * (weight - *mean);
            }
        }
        Ok(norm)
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        Ok(self.gradient.clone())
    }

    fn collect(&mut self, _: &mut Learned) -> Result<(), EngineError> {
        Ok(())
    }
}
