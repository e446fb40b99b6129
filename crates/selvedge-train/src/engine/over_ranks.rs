//! An engine on each of several ranks: the pieces of a batch are shared over them in a row, their
//! gradients are summed in the order of the pieces, and every rank takes the same step.
//!
//! A piece is a micro-batch on the processor, one slot on a device. On the processor the sum is, to
//! the last bit, that of one rank with all pieces; a device sums its own slots by itself, so that
//! numbers of ranks differ by rounding there.

use std::hash::{DefaultHasher, Hash, Hasher};
use std::ops::Range;

use selvedge_cluster::{ClusterError, Ranks, share_of};

use super::{Engine, EngineError, EngineMaker, Learned, Setup, SlotRun, Update};
use crate::config::TrainConfig;
use crate::losses::LossTerms;

/// An engine on every rank.
pub struct OverRanks<'a> {
    /// The engine of this one.
    pub engine: &'a dyn EngineMaker,
    /// The ranks.
    pub ranks: Ranks,
}

impl OverRanks<'_> {
    /// Slots of a piece.
    fn piece(&self) -> usize {
        self.engine.micro_batch().unwrap_or(1)
    }
}

impl EngineMaker for OverRanks<'_> {
    fn micro_batch(&self) -> Option<usize> {
        self.engine.micro_batch()
    }

    fn make(&self, setup: Setup<'_>) -> Result<Box<dyn Engine>, EngineError> {
        if !self.ranks.are_several() {
            return self.engine.make(setup);
        }
        let (samples, piece) = (setup.cfg.batch.samples, self.piece());
        let (pieces, ranks) = (samples.div_ceil(piece), self.ranks.count());
        if pieces < ranks {
            let idle = match ranks - pieces {
                1 => format!("rank {pieces}"),
                _ => format!("ranks {pieces} to {}", ranks - 1),
            };
            let enough = ranks * piece;
            let problem = format!(
                "batch.samples = {samples} in micro-batches of {piece} gives work to {pieces} of {ranks} ranks: {idle} would have none; start {pieces}, or take --set batch.samples={enough} or more (another training, with a larger learning rate)"
            );
            return Err(EngineError(problem.into()));
        }
        let start = (format!("{:?}", setup.cfg), bits(&setup.learned.weights));
        check_same(&self.ranks, &start, "configuration or checkpoint")?;
        let own = self.own_slots(samples);
        let mut cfg: TrainConfig = setup.cfg.clone();
        cfg.batch.samples = own.len();
        // Of the size of its own slots.
        let engine = self.engine.make(Setup { cfg: &cfg, ..setup })?;
        Ok(Box::new(RankEngine {
            engine,
            ranks: self.ranks.clone(),
            own,
            gradient: vec![0.0; setup.learned.weights.len()],
        }))
    }

    fn ranks(&self) -> Ranks {
        self.ranks.clone()
    }

    fn own_slots(&self, samples: usize) -> Range<usize> {
        let piece = self.piece();
        let own = share_of(
            samples.div_ceil(piece),
            self.ranks.rank(),
            self.ranks.count(),
        );
        own.start * piece..samples.min(own.end * piece)
    }
}

struct RankEngine {
    engine: Box<dyn Engine>,
    ranks: Ranks,
    /// Its slots.
    own: Range<usize>,
    /// The sum over all ranks.
    gradient: Vec<f32>,
}

impl Engine for RankEngine {
    fn learn(
        &mut self,
        setup: Setup<'_>,
        slots: &mut [SlotRun<'_>],
    ) -> Result<Vec<LossTerms>, EngineError> {
        let own = self.engine.learn(setup, &mut slots[self.own.clone()])?;
        // Every rank has slots, and so terms: who sends none gives the step up, and so do all.
        let packed = if setup.stop.is_wanted() {
            Vec::new()
        } else {
            own.into_iter().flat_map(LossTerms::to_bytes).collect()
        };
        let all = self.ranks.gather_for_all(packed)?;
        if all.iter().any(Vec::is_empty) {
            return Ok(Vec::new());
        }
        let mut terms = Vec::new();
        for (rank, packed) in all.iter().enumerate() {
            let theirs = LossTerms::from_bytes(packed);
            let problem = || {
                let problem = format!(
                    "rank {rank} sent losses that are none of this program's: start one program on all ranks"
                );
                EngineError(problem.into())
            };
            terms.extend(theirs.ok_or_else(problem)?);
        }
        let engine = &mut self.engine;
        let add = &mut |range: Range<usize>, sum: &mut [f32]| engine.add_gradient(range, sum);
        self.ranks.sum_in_order(&mut self.gradient, add)?;
        self.engine.set_gradient(&self.gradient)?;
        Ok(terms)
    }

    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError> {
        self.engine.update(learned, update)
    }

    fn add_gradient(&mut self, range: Range<usize>, sum: &mut [f32]) -> Result<(), EngineError> {
        let part = self.gradient[range].iter();
        sum.iter_mut().zip(part).for_each(|(s, g)| *s += g);
        Ok(())
    }

    fn set_gradient(&mut self, gradient: &[f32]) -> Result<(), EngineError> {
        self.engine.set_gradient(gradient)
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        self.engine.gradient()
    }

    fn collect(&mut self, learned: &mut Learned) -> Result<(), EngineError> {
        self.engine.collect(learned)?;
        check_same(&self.ranks, &bits(&learned.weights), "weights")
    }
}

impl From<ClusterError> for EngineError {
    fn from(error: ClusterError) -> Self {
        Self(Box::new(error))
    }
}

fn bits(numbers: &[f32]) -> Vec<u32> {
    numbers.iter().map(|number| number.to_bits()).collect()
}

fn check_same(ranks: &Ranks, own: &impl Hash, what: &str) -> Result<(), EngineError> {
    let mut hasher = DefaultHasher::new();
    own.hash(&mut hasher);
    let digest = hasher.finish().to_le_bytes().to_vec();
    let all = ranks.gather_for_all(digest)?;
    match all.iter().position(|other| *other != all[0]) {
        None => Ok(()),
        Some(rank) => {
            let problem = format!(
                "rank {rank} has another {what} than rank 0: start the same program with the same files on every rank, on processors of one kind"
            );
            Err(EngineError(problem.into()))
        }
    }
}

#[cfg(test)]
mod tests;
