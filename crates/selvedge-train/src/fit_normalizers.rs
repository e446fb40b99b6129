//! Fits the normalisers: statistics of inputs and targets over samples drawn as in training, before
//! the first step. The fit goes sample by sample, so that a caller can report each and stop.

use std::ops::ControlFlow;

use selvedge_model::{Place, RunningStatistics, Window, edge_groups, node_groups};

use crate::config::TrainConfig;
use crate::losses::RunningLossStatistics;
use crate::slot::{ShownSample, Slot, rng_of};
use crate::training_set::TrainingSet;

/// Progress of the fit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FitProgress {
    /// Samples so far.
    pub done: usize,
    /// Samples in all.
    pub samples: usize,
}

/// A fit in progress.
pub(crate) struct NormalizerFit<'a> {
    cfg: &'a TrainConfig,
    set: &'a TrainingSet,
    done: usize,
    nodes: RunningStatistics,
    edges: RunningStatistics,
    targets: RunningLossStatistics,
    shown: ShownSample,
    window: Window,
}

/// Statistics of inputs and targets.
pub(crate) struct Statistics {
    /// Features of vertices and of arcs.
    pub(crate) inputs: [RunningStatistics; 2],
    pub(crate) targets: RunningLossStatistics,
}

impl<'a> NormalizerFit<'a> {
    /// Statistics of no sample yet.
    pub(crate) fn new(cfg: &'a TrainConfig, set: &'a TrainingSet) -> Self {
        Self {
            cfg,
            set,
            done: 0,
            nodes: RunningStatistics::new(&node_groups(&cfg.model)),
            edges: RunningStatistics::new(&edge_groups(&cfg.model)),
            targets: RunningLossStatistics::default(),
            shown: ShownSample::default(),
            window: Window::default(),
        }
    }

    /// Takes the next sample. Returns nothing when the samples of the configuration are done.
    pub(crate) fn advance(&mut self) -> Option<FitProgress> {
        let (cfg, spec) = (self.cfg, &self.cfg.model);
        if self.done >= cfg.statistics_samples {
            return None;
        }
        // The last streams: no training reaches them. The bounds of both counts leave room.
        let last = u64::MAX / cfg.batch.samples as u64 - 1;
        let stream = last - cfg.statistics_samples as u64 + self.done as u64;
        let mut rng = rng_of(cfg.seed, stream, 0, cfg.batch.samples);
        Slot::new().show(cfg, self.set, &mut rng, &mut self.shown);
        let graph = &*self.set.motion(self.shown.trajectory).graph;
        let place = Place::alone(graph);
        self.window.fit(spec, &place);
        self.window.write(spec, graph, self.shown.window(), &place);
        self.nodes.add(&self.window.nodes);
        self.edges.add(&self.window.arcs);
        self.targets.add(&self.shown.triplet(graph));
        self.done += 1;
        Some(FitProgress {
            done: self.done,
            samples: cfg.statistics_samples,
        })
    }

    /// The statistics of all samples; none where `observe`, which hears of each, stops the fit.
    pub(crate) fn observed(
        mut self,
        observe: &mut dyn FnMut(FitProgress) -> ControlFlow<()>,
    ) -> Option<Statistics> {
        while let Some(progress) = self.advance() {
            if observe(progress).is_break() {
                return None;
            }
        }
        Some(self.finish())
    }

    /// The statistics so far.
    pub(crate) fn finish(self) -> Statistics {
        Statistics {
            inputs: [self.nodes, self.edges],
            targets: self.targets,
        }
    }
}
