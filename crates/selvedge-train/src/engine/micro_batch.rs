//! A micro-batch of the processor's engine: slots that go through the network as one disjoint
//! union, on one thread or on several. Its gradient does not depend on which.
//!
//! In a step of several frames (back-propagation through time) the slots of a micro-batch go one
//! after the other, so that activations of one slot's frames are kept at a time. A prediction
//! becomes the next frame's positions; the gradient of every frame's loss goes back through the
//! features and the integration into all predictions before it.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use selvedge_model::{
    ClothGraph, Connectivity, Dropout, Gradients, InputGradient, PackedWeights, Pass, Place,
    Stopped, Window, Workspace,
};

use super::{FramePasses, Setup, SlotRun, run_slots};
use crate::losses::{LossEvaluator, LossTerms, LossWeights};
use crate::slot::ShownSample;

/// A micro-batch: its buffers, its gradient and its losses.
pub(super) struct MicroBatch {
    frames: Vec<FrameBuffers>,
    union: Union,
    losses: LossEvaluator,
    /// Gradients with respect to features.
    input: Window,
    /// Gradients of the positions of all frames, the history of the first one included, in the
    /// world, `[frames][vertices]`.
    by_position: Vec<Vec<Vec3>>,
    /// Gradient of the sum of the slots' losses in the latest step, each times its share of the
    /// batch, laid out like the weights.
    pub(super) gradient: Vec<f32>,
    /// Terms of each slot in the latest step; none where that was given up.
    pub(super) terms: Vec<LossTerms>,
}

/// The parts that all micro-batches share in a step.
pub(super) struct Shared<'a> {
    pub(super) setup: Setup<'a>,
    /// Frames of the step, at most.
    pub(super) frames: usize,
    pub(super) weights: &'a PackedWeights<f32>,
}

/// Cloths side by side.
#[derive(Default)]
struct Union {
    graphs: Vec<Arc<ClothGraph>>,
    /// The arcs of all, where there are several cloths.
    several: Option<Connectivity>,
    places: Vec<Place>,
}

/// Buffers of one frame, kept for the way back.
#[derive(Default)]
struct FrameBuffers {
    samples: Vec<ShownSample>,
    window: Window,
    workspace: Workspace<f32>,
    /// Normalised predictions, `[vertices, 3]`.
    output: Vec<f32>,
    /// Gradients of this frame's own losses with respect to them, `[vertices, 3]`.
    by_output: Vec<f32>,
}

/// A micro-batch at work.
struct Passes<'a, 'b> {
    batch: &'a mut MicroBatch,
    shared: &'a Shared<'b>,
}

impl MicroBatch {
    /// A micro-batch for a network of so many weights.
    pub(super) fn new(losses: LossWeights, weights: usize) -> Self {
        Self {
            frames: Vec::new(),
            union: Union::default(),
            losses: LossEvaluator::new(losses),
            input: Window::default(),
            by_position: Vec::new(),
            gradient: vec![0.0; weights],
            terms: Vec::new(),
        }
    }

    /// Takes the slots through the frames of a step and back: all together where there is one
    /// frame, else one after the other. There are no terms where the step is given up.
    pub(super) fn learn(&mut self, shared: &Shared<'_>, slots: &mut [SlotRun<'_>]) {
        self.gradient.fill(0.0);
        self.terms.clear();
        for frame in &mut self.frames {
            frame.workspace.stop_by(shared.setup.stop.clone());
        }
        let together = if shared.frames == 1 { slots.len() } else { 1 };
        for slots in slots.chunks_mut(together.max(1)) {
            let batch = &mut *self;
            match run_slots(&mut Passes { batch, shared }, slots) {
                Ok(terms) if !terms.is_empty() => self.terms.extend(terms),
                _ => {
                    self.terms.clear();
                    return;
                }
            }
        }
    }
}

impl FramePasses for Passes<'_, '_> {
    type Error = Stopped;

    fn forward(&mut self, frame: usize, slots: &mut [SlotRun<'_>]) -> Result<(), Stopped> {
        let Self { batch, shared } = self;
        if frame == 0 {
            batch.union.join(slots);
        }
        if batch.frames.len() <= frame {
            batch.frames.resize_with(frame + 1, FrameBuffers::default);
            let stop = shared.setup.stop.clone();
            batch.frames[frame].workspace.stop_by(stop);
        }
        let (setup, union) = (&shared.setup, &batch.union);
        let FrameBuffers {
            samples,
            window,
            workspace,
            output,
            by_output,
        } = &mut batch.frames[frame];
        // The samples of this frame are kept, in buffers of the step before.
        samples.resize_with(slots.len(), ShownSample::default);
        for (number, (kept, slot)) in samples.iter_mut().zip(&*slots).enumerate() {
            kept.clone_from(slot.sample());
            let (graph, place) = (kept.graph(&union.graphs[number]), &union.places[number]);
            window.write(setup.network.spec(), graph, kept.window(), place);
        }
        let normalizers = setup.normalizers;
        window.normalize(&normalizers.nodes, &normalizers.edges);
        let seeds: Vec<u64> = samples.iter().map(|sample| sample.dropout_seed).collect();
        let dropout = Dropout {
            rate: setup.cfg.dropout,
            seeds: &seeds,
        };
        let (graph, pass) = (union.connectivity(), Pass::Training(Some(dropout)));
        let out =
            setup
                .network
                .forward_packed(shared.weights, graph, window.input(), pass, workspace)?;
        output.clear();
        output.extend_from_slice(out);
        by_output.resize(output.len(), 0.0);
        for (number, slot) in slots.iter_mut().enumerate() {
            let rows = union.rows(number);
            let sample = &samples[number];
            let triplet = sample.triplet(sample.graph(&union.graphs[number]));
            let (predicted, gradient) = (&output[rows.clone()], &mut by_output[rows]);
            let losses = &mut batch.losses;
            let terms = losses.evaluate(&triplet, setup.statistics, predicted, gradient);
            slot.receive(predicted, terms);
        }
        Ok(())
    }

    fn backward(&mut self, weights: &[Vec<f64>]) -> Result<(), Stopped> {
        match self.shared.frames {
            1 => self.back_through_one(weights),
            _ => weights
                .iter()
                .try_for_each(|weights| self.back_through_all(weights)),
        }
    }
}

impl Passes<'_, '_> {
    /// The way back through single predictions.
    fn back_through_one(&mut self, weights: &[Vec<f64>]) -> Result<(), Stopped> {
        let Self { batch, shared } = self;
        let frame = &mut batch.frames[0];
        for (slot, weights) in weights.iter().enumerate() {
            let weight = weights.iter().sum::<f64>() as f32;
            let rows = batch.union.rows(slot);
            frame.by_output[rows].iter_mut().for_each(|g| *g *= weight);
        }
        frame.network_backward(shared, &batch.union, &mut batch.gradient, None)
    }

    /// The way back through the frames of one slot, which have these weights, latest frame first.
    ///
    /// The union is of that slot's cloth alone, as [`MicroBatch::learn`] makes it in a step of
    /// several frames: the gradient of a position is that of the only sample.
    fn back_through_all(&mut self, weights: &[f64]) -> Result<(), Stopped> {
        let Self { batch, shared } = self;
        debug_assert_eq!(
            batch.union.graphs.len(),
            1,
            "slots go back through several frames one at a time"
        );
        let network = shared.setup.network;
        let history = network.spec().history();
        let vertices = batch.union.connectivity().vertex_count();
        let count = history + weights.len();
        batch.by_position.resize_with(count, Vec::new);
        for row in &mut batch.by_position {
            row.clear();
            row.resize(vertices, Vec3::ZERO);
        }
        let (spec, normalizers) = (network.spec(), shared.setup.normalizers);
        let (whole, input) = (&batch.union.graphs[0], &mut batch.input);
        for (number, &weight) in weights.iter().enumerate().rev() {
            let frame = &mut batch.frames[number];
            let graph = frame.samples[0].graph(whole);
            let positions = &mut batch.by_position[number..=number + history];
            let (rows, by_next) = (&mut frame.by_output, &mut positions[history]);
            frame.samples[0].join_gradient(graph, normalizers, weight as f32, rows, by_next);
            let gradient = &mut batch.gradient;
            if number == 0 {
                // The first frame starts from given positions.
                return frame.network_backward(shared, &batch.union, gradient, None);
            }
            input.fit(spec, &batch.union.places[0]);
            let features = Some(input.gradient());
            frame.network_backward(shared, &batch.union, gradient, features)?;
            let (graph, features) = (frame.samples[0].graph(whole), input.gradient());
            frame.samples[0].positions_backward(spec, graph, normalizers, features, positions);
        }
        Ok(())
    }
}

impl Union {
    fn connectivity(&self) -> &Connectivity {
        let several = self.several.as_ref();
        several.unwrap_or_else(|| self.graphs[0].connectivity())
    }

    /// Makes this the union of the slots' cloths, unless it is that already.
    fn join(&mut self, slots: &[SlotRun<'_>]) {
        let same = self.graphs.len() == slots.len()
            && slots
                .iter()
                .zip(&self.graphs)
                .all(|(slot, graph)| Arc::ptr_eq(slot.graph(), graph));
        if same {
            return;
        }
        self.graphs = slots.iter().map(|slot| Arc::clone(slot.graph())).collect();
        let graphs: Vec<&ClothGraph> = self.graphs.iter().map(|graph| &**graph).collect();
        let arcs = graphs.iter().map(|graph| graph.connectivity());
        self.several = (slots.len() > 1).then(|| Connectivity::union(arcs));
        self.places = Place::side_by_side(&graphs);
    }

    /// Rows of cloth `number` in an array `[vertices, 3]` of the union.
    fn rows(&self, number: usize) -> Range<usize> {
        let first = self.places[number].first_vertex;
        3 * first..3 * (first + self.graphs[number].vertex_count())
    }
}

impl FrameBuffers {
    /// From `by_output` to the weights and, where it is wanted, to the features.
    fn network_backward(
        &mut self,
        shared: &Shared<'_>,
        union: &Union,
        weights: &mut [f32],
        input: Option<InputGradient<'_, f32>>,
    ) -> Result<(), Stopped> {
        let gradients = Gradients {
            output: &self.by_output,
            weights,
            input,
        };
        shared.setup.network.backward_packed(
            shared.weights,
            union.connectivity(),
            self.window.input(),
            gradients,
            &mut self.workspace,
        )
    }
}
