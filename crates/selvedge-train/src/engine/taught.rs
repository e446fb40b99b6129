//! The engine of a training that corrects physics, whose samples are made while it learns.
//!
//! A **teacher**, converged physics, is asked for the frame after a state that cheap physics has
//! just predicted from; the difference is what the network has to add. The states are the teacher's
//! own at first and those that the corrected physics gets itself into later, so that the network
//! learns what to do there. There is no data set: the latest samples are kept, and each is learned
//! from several times. Checkpoints leave them out: they are hundreds of megabytes, and are made
//! anew in seconds, so that a resumed training goes on with other samples.

mod sample;

use std::error::Error;
use std::ops::{ControlFlow, Range};
use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use selvedge_cloth::Stop;
use selvedge_model::{
    Domain, Instructions, Model, PackedWeights, Purpose, RunningStatistics, Stopped,
    correction_groups,
};
use thiserror::Error;

pub use self::sample::CorrectionSample;
use self::sample::{SampleWork, Shared};
use super::{Batch, Engine, EngineError, Learned, Setup, Update};
use crate::config::{SampleConfig, TrainConfig};
use crate::fit_normalizers::{FitProgress, Statistics};
use crate::losses::{LossTerms, RunningLossStatistics};

/// A maker of samples: cloths that move by cheap physics, corrected or not, and a teacher.
pub trait SampleSource: Send {
    /// Moves every cloth by a frame and returns their samples. With a `model` the cloths may go on
    /// from its own frames, up to `own_frames` in a row with the one that the sample is of. None
    /// where a stop was wanted meanwhile.
    ///
    /// # Errors
    /// What went wrong, for people.
    fn samples(
        &mut self,
        model: Option<&Arc<Model>>,
        own_frames: usize,
    ) -> Result<Option<Vec<CorrectionSample>>, Box<dyn Error + Send + Sync>>;

    /// Lets samples be given up within a frame from when `stop` is wanted.
    fn stop_by(&mut self, stop: Stop);

    /// The domain of the samples; none where it is not known.
    fn domain(&self) -> Option<&Domain>;
}

/// Samples that could not be made.
#[derive(Debug, Error)]
#[error("making samples: {0}")]
struct SamplesError(Box<dyn Error + Send + Sync>);

/// The latest samples, and where they come from.
pub(crate) struct Samples {
    pub(crate) source: Box<dyn SampleSource>,
    kept: Vec<CorrectionSample>,
    /// The oldest one, once all places are taken.
    oldest: usize,
    /// Samples that were ever added.
    added: u64,
    /// Samples that were drawn to learn from.
    drawn: u64,
}

impl Samples {
    /// None yet.
    pub(crate) fn new(source: Box<dyn SampleSource>) -> Self {
        Self {
            source,
            kept: Vec::new(),
            oldest: 0,
            added: 0,
            drawn: 0,
        }
    }

    /// The first ones, enough for statistics; none where `observe`, which hears of each, or the
    /// source was stopped.
    pub(crate) fn gather(
        source: Box<dyn SampleSource>,
        cfg: &TrainConfig,
        observe: &mut dyn FnMut(FitProgress) -> ControlFlow<()>,
    ) -> Result<Option<Self>, EngineError> {
        let (mut all, samples) = (Self::new(source), cfg.samples.statistics);
        while all.kept.len() < samples {
            let before = all.kept.len();
            if all.make(cfg, None, 0)?.is_break() {
                return Ok(None);
            }
            for done in before + 1..=all.kept.len().min(samples) {
                if observe(FitProgress { done, samples }).is_break() {
                    return Ok(None);
                }
            }
        }
        Ok(Some(all))
    }

    /// True where more are due before the next step.
    fn are_due(&self, cfg: &SampleConfig) -> bool {
        self.kept.len() < cfg.statistics || self.drawn as f64 >= cfg.uses * self.added as f64
    }

    /// Makes those of a frame. Breaks where a stop was wanted.
    fn make(
        &mut self,
        cfg: &TrainConfig,
        model: Option<&Arc<Model>>,
        step: u64,
    ) -> Result<ControlFlow<()>, EngineError> {
        let made = self.source.samples(model, cfg.own_frames.at(step));
        let made = made.map_err(|error| EngineError(Box::new(SamplesError(error))))?;
        let Some(made) = made else {
            return Ok(ControlFlow::Break(()));
        };
        self.add(&cfg.samples, made);
        Ok(ControlFlow::Continue(()))
    }

    /// Adds samples; the oldest ones go where there are too many.
    fn add(&mut self, cfg: &SampleConfig, samples: impl IntoIterator<Item = CorrectionSample>) {
        for sample in samples {
            self.added += 1;
            if self.kept.len() < cfg.kept {
                self.kept.push(sample);
            } else {
                self.kept[self.oldest] = sample;
                self.oldest = (self.oldest + 1) % cfg.kept;
            }
        }
        if self.kept.len() <= cfg.statistics {
            // Those of the statistics are no debt.
            self.drawn = (self.added as f64 * cfg.uses) as u64;
        }
    }

    /// Statistics of columns and corrections, of vertices that no handle holds.
    pub(crate) fn statistics(&self, outputs: usize) -> Statistics {
        let [mut nodes, mut targets] =
            correction_groups().map(|groups| RunningStatistics::new(&groups));
        for sample in &self.kept {
            nodes.add(&sample.nodes);
            let rows = sample.target.chunks_exact(outputs);
            for (row, _) in rows.zip(&sample.weights).filter(|(_, w)| **w > 0.0) {
                targets.add(row);
            }
        }
        Statistics {
            inputs: [nodes, RunningStatistics::new(&[])],
            targets: RunningLossStatistics::of_outputs(targets),
        }
    }
}

/// The engine: samples, and room for each of a batch.
pub(crate) struct TaughtEngine {
    samples: Samples,
    packed: PackedWeights<f32>,
    work: Vec<SampleWork>,
    /// Gradient of the mean over the batch, `[parameters]`.
    gradient: Vec<f32>,
}

impl TaughtEngine {
    pub(crate) fn new(setup: Setup<'_>, samples: Samples) -> Self {
        let weights = &setup.learned.weights;
        let (purpose, using) = (Purpose::Training, Instructions::Detected);
        let work = (0..setup.cfg.batch.samples).map(|_| SampleWork::new(weights.len()));
        Self {
            samples,
            packed: setup.network.pack(weights, purpose, using),
            work: work.collect(),
            gradient: vec![0.0; weights.len()],
        }
    }

    /// Makes the samples that are due. Breaks where a stop was wanted.
    fn make_samples(
        &mut self,
        setup: Setup<'_>,
        step: u64,
    ) -> Result<ControlFlow<()>, EngineError> {
        let (cfg, learned) = (setup.cfg, setup.learned);
        self.samples.source.stop_by(setup.stop.clone());
        let mut model = None;
        while self.samples.are_due(&cfg.samples) {
            if model.is_none() && cfg.own_frames.at(step) > 1 {
                let made = learned.model(&cfg.model, setup.normalizers, String::new());
                let made = made.map_err(|error| EngineError(Box::new(error)))?;
                model = Some(Arc::new(made));
            }
            if self.samples.make(cfg, model.as_ref(), step)?.is_break() {
                return Ok(ControlFlow::Break(()));
            }
        }
        Ok(ControlFlow::Continue(()))
    }
}

impl Engine for TaughtEngine {
    fn learn(&mut self, batch: Batch<'_>) -> Result<Vec<LossTerms>, EngineError> {
        let (setup, step) = (batch.setup, batch.step);
        if self.make_samples(setup, step)?.is_break() {
            return Ok(Vec::new());
        }
        let kept = &self.samples.kept;
        let mut rng = ChaCha8Rng::seed_from_u64(setup.cfg.seed);
        rng.set_stream(1 + step);
        let draw = |_| rng.random_range(0..kept.len());
        let picks: Vec<usize> = (0..self.work.len()).map(draw).collect();
        let weights = &setup.learned.weights;
        setup.network.repack(weights, &mut self.packed);
        let shared = Shared {
            setup,
            weights: &self.packed,
        };
        let work = self.work.par_iter_mut().zip(&picks);
        let losses: Result<Vec<f64>, Stopped> = work
            .map(|(work, &pick)| work.learn(shared, &kept[pick]))
            .collect();
        let Ok(losses) = losses else {
            return Ok(Vec::new());
        };
        self.samples.drawn += picks.len() as u64;
        self.gradient.fill(0.0);
        for work in &self.work {
            let pairs = self.gradient.iter_mut().zip(&work.gradient);
            pairs.for_each(|(sum, g)| *sum += g);
        }
        Ok(losses.into_iter().map(LossTerms::of_total).collect())
    }

    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError> {
        Ok(learned.update(&mut self.gradient, update))
    }

    fn add_gradient(&mut self, range: Range<usize>, sum: &mut [f32]) -> Result<(), EngineError> {
        let part = self.gradient[range].iter();
        sum.iter_mut().zip(part).for_each(|(s, g)| *s += g);
        Ok(())
    }

    fn set_gradient(&mut self, gradient: &[f32]) -> Result<(), EngineError> {
        self.gradient.copy_from_slice(gradient);
        Ok(())
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        Ok(self.gradient.clone())
    }

    fn collect(&mut self, _: &mut Learned) -> Result<(), EngineError> {
        Ok(())
    }

    fn samples_made(&self) -> Option<u64> {
        Some(self.samples.added)
    }
}

#[cfg(test)]
mod tests;
