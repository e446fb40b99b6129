//! Learning through several frames of a rollout (back-propagation through time): the network's own
//! predictions become the next frames' positions, and the gradient of every frame's loss goes back
//! through the features and the integration into all predictions before it.
//!
//! A prediction is judged where the rollout is: k frames after its start (k from 1) its target is the
//! truth plus what is left of the offset that the start had from it ([`RolloutTarget`]). The positions that a
//! constant error of the acceleration leads to are off by k²/2 of it, so the loss of frame k counts
//! 1/k², in a weighted mean `[eq:unrolled-loss]`.
//!
//! One slot at a time, by itself: slots are what threads share.

use glam::{DVec3, Vec3};
use rand_chacha::ChaCha8Rng;
use selvedge_model::{
    Dropout, EncoderState, Extent, Gradients, Input, InputGradient, Pass, Place, StateGradients,
    Window, Workspace,
};

use crate::config::TrainConfig;
use crate::engine::micro_batch::Context;
use crate::losses::{LossEvaluator, LossTerms};
use crate::rollout_target::RolloutTarget;
use crate::slot::{ShownSample, Slot};
use crate::training_set::Motion;

/// The buffers of one slot's run through several frames.
#[derive(Default)]
pub(crate) struct Unroll {
    frames: Vec<FrameBuffers>,
    input: InputBuffers,
    /// Of the total loss with respect to the positions of all frames, the history of the first one
    /// included, in the world, `[frames][vertices]`.
    by_position: Vec<Vec<Vec3>>,
    /// Of the total loss with respect to what a streaming network carries into a frame, and out of it.
    by_state: [EncoderState<f32>; 2],
}

/// What the way back needs of one frame.
#[derive(Default)]
struct FrameBuffers {
    shown: ShownSample,
    window: Window,
    workspace: Workspace<f32>,
    /// What a streaming network carries into this frame: nothing into the first one, which it begins
    /// with a window of the frames before.
    state: EncoderState<f32>,
    /// The normalised prediction, `[vertices, 3]`.
    output: Vec<f32>,
    /// The gradient of this frame's own loss with respect to it, `[vertices, 3]`.
    by_output: Vec<f32>,
}

/// Gradients with respect to features.
#[derive(Default)]
struct InputBuffers {
    nodes: Vec<f32>,
    edges: Vec<f32>,
}

/// Gradients of a frame's input, where wanted, of the positions of its history and of what it predicts,
/// and of what it carries.
type FrameGradients<'a> = (
    Option<&'a mut InputBuffers>,
    &'a mut [Vec<Vec3>],
    StateGradients<'a, f32>,
);

impl Unroll {
    /// Takes `slot` through up to `count` frames and adds the gradient of their loss to `gradient`;
    /// gives its terms. The slot stands after the last frame.
    pub(crate) fn learn(
        &mut self,
        context: &Context<'_>,
        (slot, rng): (&mut Slot, &mut ChaCha8Rng),
        count: usize,
        losses: &mut LossEvaluator,
        gradient: &mut [f32],
    ) -> LossTerms {
        let (cfg, set) = (context.cfg, context.set);
        if self.frames.len() < count {
            self.frames.resize_with(count, FrameBuffers::default);
        }
        let mut aim: Option<RolloutTarget> = None;
        let mut terms = Vec::with_capacity(count);
        for number in 0..count {
            let (before, frame) = self.frames[..=number].split_at_mut(number);
            let frame = &mut frame[0];
            frame.state.clear();
            if let Some(before) = before.last().filter(|_| context.network.streams()) {
                frame.state.clone_from(before.workspace.end_state());
            }
            slot.show(cfg, set, rng, &mut frame.shown);
            let (shown, sampling) = (&mut frame.shown, &cfg.scheduled_sampling);
            let aim = aim.get_or_insert_with(|| {
                let (correction, given) = (slot.correction(cfg), (set, shown.yaw));
                RolloutTarget::new(sampling.offset, correction, slot, given)
            });
            slot.aim(set, aim.next(), shown);
            frame.forward(context);
            terms.push(frame.judge(context, losses));
            let acceleration = frame.acceleration(context);
            if !slot.follow(cfg, set, frame.shown.yaw, &acceleration) {
                break;
            }
        }
        let (mean, weights) = weigh(cfg, &terms);
        self.backward(context, &weights, gradient);
        mean
    }

    /// Adds to `gradient` that of the frames' losses, each times its weight, latest frame first.
    fn backward(&mut self, context: &Context<'_>, weights: &[f64], gradient: &mut [f32]) {
        let motion = context.set.motion(self.frames[0].shown.trajectory);
        let history = context.network.spec().history();
        let vertices = motion.graph.vertex_count();
        self.by_position
            .resize_with(history + weights.len(), Vec::new);
        for row in &mut self.by_position {
            row.clear();
            row.resize(vertices, Vec3::ZERO);
        }
        for (number, &weight) in weights.iter().enumerate().rev() {
            let frame = &mut self.frames[number];
            let by_frames = &mut self.by_position[number..=number + history];
            frame.judge_position(context, motion, weight as f32, &mut by_frames[history]);
            // What the first frame starts from is given.
            let input = (number > 0).then_some(&mut self.input);
            let [before, after] = &mut self.by_state;
            let carries = context.network.streams();
            let states = StateGradients {
                end: (carries && number + 1 < weights.len()).then_some(&*after),
                start: (carries && number > 0).then_some(before),
            };
            frame.backward(context, motion, (input, by_frames, states), gradient);
            self.by_state.swap(0, 1);
        }
    }
}

/// The mean of the terms of the frames of a run, and what the gradient of each counts in it.
pub(crate) fn weigh(cfg: &TrainConfig, terms: &[LossTerms]) -> (LossTerms, Vec<f64>) {
    let number = |frame: usize| frame as f64 + 1.0;
    let terms: Vec<(f64, LossTerms)> = terms
        .iter()
        .enumerate()
        .map(|(frame, terms)| (number(frame).powi(-2), *terms))
        .collect();
    let mean = LossTerms::weighted_mean(&terms);
    let cap = cfg.loss_cap.filter(|&cap| mean.total > cap);
    let weight = cap.map_or(1.0, |cap| cap / mean.total);
    let sum: f64 = terms.iter().map(|(weight, _)| weight).sum();
    let weights = terms.iter().map(|(w, _)| w * weight / sum).collect();
    (mean, weights)
}

impl FrameBuffers {
    fn forward(&mut self, context: &Context<'_>) {
        let (spec, motion) = (
            context.network.spec(),
            context.set.motion(self.shown.trajectory),
        );
        let place = Place::alone(&motion.graph);
        let extent = if self.state.is_zero() {
            Extent::Whole
        } else {
            Extent::Newest
        };
        self.window.fit_extent(spec, &place, extent);
        self.window
            .write(spec, &motion.graph, self.shown.window(), &place);
        let normalizers = context.normalizers;
        self.window
            .normalize(&normalizers.nodes, &normalizers.edges);
        let dropout = Dropout {
            rate: context.cfg.dropout,
            seeds: &[self.shown.dropout_seed],
        };
        let out = context.network.forward_carried(
            context.weights,
            &motion.connectivity,
            (input_of(&self.window), &self.state),
            Pass::Training(Some(dropout)),
            &mut self.workspace,
        );
        self.output.clear();
        self.output.extend_from_slice(out);
    }

    fn judge(&mut self, context: &Context<'_>, losses: &mut LossEvaluator) -> LossTerms {
        let graph = &context.set.motion(self.shown.trajectory).graph;
        self.by_output.resize(self.output.len(), 0.0);
        let triplet = self.shown.triplet(graph);
        let statistics = context.statistics;
        losses.evaluate(&triplet, statistics, &self.output, &mut self.by_output)
    }

    /// The prediction in `[m/frame²]`, local, `[vertices, 3]`.
    fn acceleration(&self, context: &Context<'_>) -> Vec<f32> {
        let mut acceleration = self.output.clone();
        let normalizer = &context.normalizers.acceleration;
        normalizer.denormalize(&mut acceleration);
        acceleration
    }

    /// Joins this frame's own loss, times `weight`, with the gradient `by_next` that later frames
    /// have for the positions it predicts: afterwards `by_output` is the whole gradient of the
    /// prediction, and `by_next` that of the predicted positions.
    fn judge_position(
        &mut self,
        context: &Context<'_>,
        motion: &Motion,
        weight: f32,
        by_next: &mut [Vec3],
    ) {
        let deviation = DVec3::from_slice(context.normalizers.acceleration.deviation()).as_vec3();
        let inverse = deviation.map(|d| if d > 0.0 { 1.0 / d } else { 0.0 });
        let yaw = self.shown.yaw;
        let rows = self.by_output.as_chunks_mut::<3>().0.iter_mut();
        for ((row, by_next), &handle) in rows.zip(by_next).zip(motion.graph.handle_mask()) {
            if handle {
                *by_next = Vec3::ZERO;
            }
            let own = weight * Vec3::from_array(*row);
            *row = (own + deviation * yaw.to_local(*by_next)).to_array();
            *by_next += yaw.to_world(own * inverse);
        }
    }

    /// From `by_output` to the weights and, where the positions before are predictions, to those:
    /// `by_frames` are the gradients of the history and, last, of the predicted positions.
    fn backward(
        &mut self,
        context: &Context<'_>,
        motion: &Motion,
        (input, by_frames, states): FrameGradients<'_>,
        gradient: &mut [f32],
    ) {
        let Some(input) = input else {
            let gradients = Gradients {
                weights: gradient,
                input: None,
            };
            self.network_backward(context, motion, (gradients, states));
            return;
        };
        input.nodes.resize(self.window.nodes.len(), 0.0);
        input.edges.resize(self.window.edges.len(), 0.0);
        let gradients = Gradients {
            weights: gradient,
            input: Some(input.gradient()),
        };
        self.network_backward(context, motion, (gradients, states));
        let normalizers = context.normalizers;
        normalizers.nodes.scale_gradient(&mut input.nodes);
        normalizers.edges.scale_gradient(&mut input.edges);
        let (spec, graph) = (context.network.spec(), &*motion.graph);
        let (by_history, by_next) = by_frames.split_at_mut(spec.history());
        let (frames, by_input) = (self.shown.window(), input.gradient());
        self.window
            .backward(spec, graph, frames, &by_input, by_history);
        self.integration_backward(context, motion, by_history, &by_next[0]);
    }

    /// p̄ = a + 2 p - reference.
    fn integration_backward(
        &self,
        context: &Context<'_>,
        motion: &Motion,
        by_history: &mut [Vec<Vec3>],
        by_next: &[Vec3],
    ) {
        let newest = by_history.len() - 1;
        let pair = [newest - 1, newest].map(|frame| &*self.shown.frames[frame]);
        let (handles, yaw) = (&self.shown.next_handles, self.shown.yaw);
        let integration = context.network.spec().integration;
        let slope = integration.reference_slope(&motion.graph, pair, handles, yaw);
        let (earlier, current) = by_history.split_at_mut(newest);
        for (to, g) in current[0].iter_mut().zip(by_next) {
            *to += 2.0 * *g;
        }
        let by_reference: Vec<Vec3> = by_next.iter().map(|&g| -g).collect();
        slope.backward(&by_reference, &mut earlier[newest - 1], &mut current[0]);
    }

    fn network_backward(
        &mut self,
        context: &Context<'_>,
        motion: &Motion,
        (gradients, states): (Gradients<'_, f32>, StateGradients<'_, f32>),
    ) {
        context.network.backward_carried(
            (context.weights, gradients),
            &motion.connectivity,
            (input_of(&self.window), &self.state, states),
            &self.by_output,
            &mut self.workspace,
        );
    }
}

impl InputBuffers {
    fn gradient(&mut self) -> InputGradient<'_, f32> {
        InputGradient {
            nodes: &mut self.nodes,
            edges: &mut self.edges,
        }
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
