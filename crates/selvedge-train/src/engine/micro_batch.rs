//! A shard: the samples that go through the network together as one disjoint union, on one thread
//! or on several; its gradient does not depend on which.

use std::sync::Arc;

use rand_chacha::ChaCha8Rng;
use selvedge_model::{
    ClothGraph, Connectivity, Dropout, Gradients, Input, Network, Normalizers, PackedWeights, Pass,
    Place, Window, Workspace,
};

use crate::config::TrainConfig;
use crate::engine::unroll::Unroll;
use crate::losses::{LossEvaluator, LossStatistics, LossTerms, Report};
use crate::slot::{ShownSample, Slot, rng_of};
use crate::training_set::TrainingSet;

/// The buffers of the samples that go through the network together.
pub(crate) struct MicroBatch {
    shown: Vec<ShownSample>,
    seeds: Vec<u64>,
    trajectories: Vec<usize>,
    connectivity: Connectivity,
    places: Vec<Place>,
    window: Window,
    workspace: Workspace<f32>,
    losses: LossEvaluator,
    output: Vec<f32>,
    output_gradient: Vec<f32>,
    /// Of the sum of the samples' losses, laid out like the weights.
    pub(crate) gradient: Vec<f32>,
    /// Of each sample.
    pub(crate) terms: Vec<LossTerms>,
    unroll: Unroll,
}

/// What all shards share in a step.
pub(crate) struct Context<'a> {
    pub(crate) cfg: &'a TrainConfig,
    pub(crate) set: &'a TrainingSet,
    pub(crate) network: &'a Network,
    pub(crate) weights: &'a PackedWeights<f32>,
    pub(crate) normalizers: &'a Normalizers,
    pub(crate) statistics: &'a LossStatistics,
    pub(crate) step: u64,
}

impl MicroBatch {
    pub(crate) fn new(cfg: &TrainConfig, weights: usize, remaining: usize) -> Self {
        let samples = cfg.batch.shard.min(remaining);
        Self {
            shown: (0..samples).map(|_| ShownSample::default()).collect(),
            seeds: Vec::with_capacity(samples),
            trajectories: Vec::new(),
            connectivity: Connectivity::union([]),
            places: Vec::new(),
            window: Window::default(),
            workspace: Workspace::new(),
            losses: LossEvaluator::new(cfg.losses, Report::Weighted),
            output: Vec::new(),
            output_gradient: Vec::new(),
            gradient: vec![0.0; weights],
            terms: Vec::with_capacity(samples),
            unroll: Unroll::default(),
        }
    }

    /// Shows the slots' samples to the network, leaves the gradient of the sum of their losses,
    /// advances the slots.
    pub(crate) fn learn(&mut self, context: &Context<'_>, number: usize, slots: &mut [Slot]) {
        let Context { cfg, set, .. } = *context;
        let first = number * cfg.batch.shard;
        let mut rngs: Vec<ChaCha8Rng> = (first..first + slots.len())
            .map(|slot| rng_of(cfg.seed, context.step, slot, cfg.batch.samples))
            .collect();
        for ((slot, rng), shown) in slots.iter_mut().zip(&mut rngs).zip(&mut self.shown) {
            slot.show(cfg, set, rng, shown);
        }
        self.join(set);
        self.write_window(context);
        self.forward(context);
        self.judge(context);
        self.backward(context);
        let normalizer = &context.normalizers.acceleration;
        normalizer.denormalize(&mut self.output);
        for (k, (slot, rng)) in slots.iter_mut().zip(&mut rngs).enumerate() {
            let rows = self.rows(set, k);
            let yaw = self.shown[k].yaw;
            slot.advance(cfg, set, (context.step, rng), yaw, &self.output[rows]);
        }
    }

    /// Takes the slots through `count` frames each and leaves the gradient of the sum of their losses.
    pub(crate) fn learn_unrolled(
        &mut self,
        context: &Context<'_>,
        (number, count): (usize, usize),
        slots: &mut [Slot],
    ) {
        let cfg = context.cfg;
        self.gradient.fill(0.0);
        self.terms.clear();
        for (k, slot) in slots.iter_mut().enumerate() {
            let place = number * cfg.batch.shard + k;
            let mut rng = rng_of(cfg.seed, context.step, place, cfg.batch.samples);
            let driver = (&mut *slot, &mut rng);
            let (losses, gradient) = (&mut self.losses, &mut self.gradient);
            let terms = self.unroll.learn(context, driver, count, losses, gradient);
            self.terms.push(terms);
            slot.break_off(cfg, (context.step, &mut rng));
        }
    }

    /// The disjoint union of the samples' graphs, made anew when they are other cloths.
    fn join(&mut self, set: &TrainingSet) {
        let trajectories = self.shown.iter().map(|shown| shown.trajectory);
        let graph = |t: usize| &set.motion(t).graph;
        let same = self.trajectories.len() == self.shown.len()
            && trajectories
                .clone()
                .zip(&self.trajectories)
                .all(|(a, &b)| Arc::ptr_eq(graph(a), graph(b)));
        if same {
            return;
        }
        self.trajectories = trajectories.collect();
        let motions: Vec<_> = self.trajectories.iter().map(|&t| set.motion(t)).collect();
        self.connectivity = Connectivity::union(motions.iter().map(|m| &*m.connectivity));
        let graphs: Vec<&ClothGraph> = motions.iter().map(|m| &*m.graph).collect();
        self.places = Place::side_by_side(&graphs);
    }

    fn write_window(&mut self, context: &Context<'_>) {
        let spec = context.network.spec();
        for (shown, place) in self.shown.iter().zip(&self.places) {
            let graph = &context.set.motion(shown.trajectory).graph;
            self.window.fit(spec, place);
            self.window.write(spec, graph, shown.window(), place);
        }
        let normalizers = context.normalizers;
        self.window
            .normalize(&normalizers.nodes, &normalizers.edges);
    }

    fn forward(&mut self, context: &Context<'_>) {
        self.seeds.clear();
        let seeds = self.shown.iter().map(|shown| shown.dropout_seed);
        self.seeds.extend(seeds);
        let dropout = Dropout {
            rate: context.cfg.dropout,
            seeds: &self.seeds,
        };
        let out = context.network.forward_packed(
            context.weights,
            &self.connectivity,
            input_of(&self.window),
            Pass::Training(Some(dropout)),
            &mut self.workspace,
        );
        self.output.clear();
        self.output.extend_from_slice(out);
    }

    fn backward(&mut self, context: &Context<'_>) {
        self.gradient.fill(0.0);
        let gradients = Gradients {
            weights: &mut self.gradient,
            input: None,
        };
        context.network.backward_packed(
            (context.weights, gradients),
            &self.connectivity,
            input_of(&self.window),
            &self.output_gradient,
            &mut self.workspace,
        );
    }

    /// The losses of the output, and their gradient with respect to it.
    fn judge(&mut self, context: &Context<'_>) {
        self.output_gradient.resize(self.output.len(), 0.0);
        self.terms.clear();
        for k in 0..self.shown.len() {
            let rows = self.rows(context.set, k);
            let shown = &self.shown[k];
            let triplet = shown.triplet(&context.set.motion(shown.trajectory).graph);
            let gradient = &mut self.output_gradient[rows.clone()];
            let predicted = &self.output[rows];
            let statistics = context.statistics;
            let terms = self
                .losses
                .evaluate(&triplet, statistics, predicted, gradient);
            if let Some(cap) = context.cfg.loss_cap.filter(|&cap| terms.total > cap) {
                let weight = (cap / terms.total) as f32;
                gradient.iter_mut().for_each(|g| *g *= weight);
            }
            self.terms.push(terms);
        }
    }

    /// Where sample `k` stands in an array `[vertices, 3]` of the union.
    fn rows(&self, set: &TrainingSet, k: usize) -> std::ops::Range<usize> {
        let graph = &set.motion(self.shown[k].trajectory).graph;
        let first = self.places[k].first_vertex;
        3 * first..3 * (first + graph.vertex_count())
    }
}

fn input_of(window: &Window) -> Input<'_, f32> {
    Input {
        nodes: &window.nodes,
        edges: &window.edges,
    }
}

#[cfg(test)]
mod tests;
