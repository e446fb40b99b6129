//! Training on a GPU: an engine of `selvedge-train` whose passes are on the GPU.
//!
//! All slots go through a frame together, as one union of cloths. Features and losses, which need
//! f64, are the processor's, by the code of its own engine; passes and optimiser are the GPU's. Up
//! go the features of each frame and the gradient of its predictions, down come predictions and,
//! where frames follow each other, gradients of features. Weights come down for a checkpoint.

use std::ops::Range;
use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;
use selvedge_model::{ClothGraph, Connectivity, InputGradient, OUTPUTS, Place, Window};
use selvedge_train::{
    Engine, EngineError, EngineMaker, FramePasses, Learned, LossEvaluator, LossTerms, Setup,
    ShownSample, SlotRun, Update, run_slots,
};

use crate::gpu::{Gpu, GpuError};
use crate::passes::{self, Passes, apart, side_by_side};

/// Settings of the engine of a GPU.
#[derive(Clone)]
pub struct OnGpu {
    /// The GPU.
    pub gpu: Arc<Gpu>,
}

impl EngineMaker for OnGpu {
    fn make(&self, setup: Setup<'_>) -> Result<Box<dyn Engine>, EngineError> {
        let engine = GpuEngine::new(Arc::clone(&self.gpu), setup).map_err(failed)?;
        Ok(Box::new(engine))
    }
}

fn failed(error: GpuError) -> EngineError {
    EngineError(Box::new(error))
}

/// A slot's part of a frame, kept for the way back.
struct SlotFrame {
    sample: ShownSample,
    window: Window,
    /// The gradient of the frame's own loss with respect to the prediction, `[vertices, 3]`.
    by_output: Vec<f32>,
}

/// What the engine keeps of a slot in a step.
struct SlotKept {
    frames: Vec<SlotFrame>,
    losses: LossEvaluator,
    /// Gradients of the positions of all frames, the history of the first one included, in the
    /// world, `[frames][vertices]`.
    by_position: Vec<Vec<Vec3>>,
}

/// The arithmetic of a training on a GPU.
struct GpuEngine {
    gpu: Arc<Gpu>,
    passes: Passes,
    training: passes::Training,
    parameters: usize,
    graphs: Vec<Arc<ClothGraph>>,
    places: Vec<Place>,
    kept: Vec<SlotKept>,
    /// What the latest step clipped its gradient by.
    clipped: f32,
}

/// The engine at work on a batch.
struct Work<'a, 'b> {
    engine: &'a mut GpuEngine,
    setup: Setup<'b>,
}

impl GpuEngine {
    /// An engine with room for the largest of the cloths in every slot.
    fn new(gpu: Arc<Gpu>, setup: Setup<'_>) -> Result<Self, GpuError> {
        let training = passes::Training {
            frames: setup.cfg.unroll.most(),
            dropout: setup.cfg.dropout,
        };
        let samples = setup.cfg.batch.samples;
        let largest = setup.graphs().max_by_key(|graph| graph.arc_count());
        let graphs: Vec<Arc<ClothGraph>> = largest.into_iter().cloned().collect();
        let parts = graphs.iter().map(|graph| graph.connectivity());
        let union = Connectivity::union(parts.cycle().take(samples * graphs.len()));
        let passes = Passes::new(&gpu, setup.network, &union, Some(training), None)?;
        passes.set_learned(setup.learned);
        let losses = || LossEvaluator::new(setup.cfg.losses);
        Ok(Self {
            gpu,
            passes,
            training,
            parameters: setup.network.parameter_count(),
            graphs: Vec::new(),
            places: Vec::new(),
            kept: (0..samples)
                .map(|_| SlotKept {
                    frames: Vec::new(),
                    losses: losses(),
                    by_position: Vec::new(),
                })
                .collect(),
            clipped: 1.0,
        })
    }

    /// Makes the union that of the slots' cloths, unless it is that already.
    fn join(&mut self, setup: Setup<'_>, slots: &[SlotRun<'_>]) -> Result<(), GpuError> {
        let same = self.graphs.len() == slots.len()
            && (slots.iter().zip(&self.graphs))
                .all(|(slot, graph)| Arc::ptr_eq(slot.graph(), graph));
        if same {
            return Ok(());
        }
        let union = Connectivity::union(slots.iter().map(|slot| slot.graph().connectivity()));
        let training = Some(self.training);
        let before = Some(&self.passes);
        self.passes = Passes::new(&self.gpu, setup.network, &union, training, before)?;
        self.graphs = slots.iter().map(|slot| Arc::clone(slot.graph())).collect();
        let graphs: Vec<&ClothGraph> = self.graphs.iter().map(|graph| &**graph).collect();
        self.places = Place::side_by_side(&graphs);
        Ok(())
    }
}

impl Engine for GpuEngine {
    fn learn(
        &mut self,
        setup: Setup<'_>,
        slots: &mut [SlotRun<'_>],
    ) -> Result<Vec<LossTerms>, EngineError> {
        self.clipped = 1.0;
        let engine = &mut *self;
        run_slots(&mut Work { engine, setup }, slots).map_err(failed)
    }

    fn update(&mut self, learned: &mut Learned, update: Update) -> Result<f64, EngineError> {
        let rates = learned.adam.next_rates(update.learning_rate);
        let steps = learned.adam.steps() + 1;
        let part = update.average;
        let part = part.map_or(0.0, |part| Learned::averaging(steps, part));
        let taken = self.passes.step(update.clip, rates, part);
        let [norm, clipped] = taken.map_err(failed)?;
        self.clipped = clipped;
        if norm.is_finite() {
            learned.adam.count_step();
        }
        Ok(f64::from(norm))
    }

    fn add_gradient(&mut self, range: Range<usize>, sum: &mut [f32]) -> Result<(), EngineError> {
        let part = self.passes.gradient(range).map_err(failed)?;
        sum.iter_mut().zip(part).for_each(|(s, g)| *s += g);
        Ok(())
    }

    fn set_gradient(&mut self, gradient: &[f32]) -> Result<(), EngineError> {
        self.passes.set_gradient(gradient);
        Ok(())
    }

    fn gradient(&mut self) -> Result<Vec<f32>, EngineError> {
        let whole = 0..self.parameters;
        let mut gradient = self.passes.gradient(whole).map_err(failed)?;
        gradient.iter_mut().for_each(|g| *g *= self.clipped);
        Ok(gradient)
    }

    fn collect(&mut self, learned: &mut Learned) -> Result<(), EngineError> {
        self.passes.collect(learned).map_err(failed)
    }
}

impl FramePasses for Work<'_, '_> {
    type Error = GpuError;

    fn forward(&mut self, frame: usize, slots: &mut [SlotRun<'_>]) -> Result<(), GpuError> {
        let Self { engine, setup } = self;
        if frame == 0 {
            engine.join(*setup, slots)?;
        }
        let spec = setup.network.spec();
        let (kept, graphs) = (&mut engine.kept[..slots.len()], &engine.graphs);
        let each = kept.par_iter_mut().zip(graphs).zip(&mut *slots);
        each.for_each(|((kept, graph), slot)| {
            if kept.frames.len() <= frame {
                kept.frames.push(SlotFrame {
                    sample: ShownSample::default(),
                    window: Window::default(),
                    by_output: Vec::new(),
                });
            }
            let SlotFrame { sample, window, .. } = &mut kept.frames[frame];
            sample.clone_from(slot.sample());
            let place = Place::alone(graph);
            window.write(spec, sample.graph(graph), sample.window(), &place);
            window.normalize(&setup.normalizers.nodes, &setup.normalizers.edges);
        });
        let windows = kept.iter().map(|kept| &kept.frames[frame].window);
        let input = side_by_side(spec, &windows.collect::<Vec<_>>());
        let samples = kept.iter().map(|kept| &kept.frames[frame].sample);
        let seeds: Vec<u64> = samples.map(|sample| sample.dropout_seed).collect();
        let output = engine.passes.forward(frame, &input, &seeds)?;
        let places = &engine.places;
        let each = kept.par_iter_mut().zip(graphs).zip(places).zip(slots);
        each.for_each(|(((kept, graph), place), slot)| {
            let SlotFrame {
                sample, by_output, ..
            } = &mut kept.frames[frame];
            let count = OUTPUTS * graph.vertex_count();
            let predicted = &output[OUTPUTS * place.first_vertex..][..count];
            by_output.resize(count, 0.0);
            let triplet = sample.triplet(sample.graph(graph));
            let statistics = setup.statistics;
            let terms = kept
                .losses
                .evaluate(&triplet, statistics, predicted, by_output);
            slot.receive(predicted, terms);
        });
        Ok(())
    }

    /// The GPU is still on its way through the first frame afterwards.
    fn backward(&mut self, weights: &[Vec<f64>]) -> Result<(), GpuError> {
        let Self { engine, setup } = self;
        let (spec, normalizers) = (setup.network.spec(), setup.normalizers);
        let history = spec.history();
        let frames = weights.iter().map(Vec::len).max().unwrap_or(0);
        let (kept, graphs) = (&mut engine.kept[..weights.len()], &engine.graphs);
        for (kept, graph) in kept.iter_mut().zip(graphs) {
            kept.by_position.resize_with(history + frames, Vec::new);
            for row in &mut kept.by_position {
                row.clear();
                row.resize(graph.vertex_count(), Vec3::ZERO);
            }
        }
        engine.passes.clear_gradient();
        for number in (0..frames).rev() {
            let each = kept.par_iter_mut().zip(graphs).zip(weights);
            each.for_each(|((kept, graph), weights)| {
                let frame = &mut kept.frames[number];
                let by_next = &mut kept.by_position[number + history];
                let rows = &mut frame.by_output;
                match weights.get(number) {
                    Some(&weight) => {
                        let (sample, weight) = (&frame.sample, weight as f32);
                        let graph = sample.graph(graph);
                        sample.join_gradient(graph, normalizers, weight, rows, by_next);
                    }
                    None => rows.fill(0.0),
                }
            });
            let rows = kept.iter().map(|kept| &kept.frames[number].by_output[..]);
            let output = rows.collect::<Vec<_>>().concat();
            if number == 0 {
                // The first frame starts from given positions.
                return engine.passes.backward(0, &output);
            }
            let input = engine.passes.backward_to_input(number, &output)?;
            let windows = kept.iter().map(|kept| &kept.frames[number].window);
            let windows = apart(spec, &input, &windows.collect::<Vec<_>>());
            let each = kept.par_iter_mut().zip(graphs).zip(weights).zip(windows);
            each.for_each(|(((kept, graph), weights), mut window)| {
                if number < weights.len() {
                    let sample = &kept.frames[number].sample;
                    let gradient = InputGradient {
                        nodes: &mut window.nodes,
                        arcs: &mut window.arcs,
                    };
                    let positions = &mut kept.by_position[number..=number + history];
                    let graph = sample.graph(graph);
                    sample.positions_backward(spec, graph, normalizers, gradient, positions);
                }
            });
        }
        Ok(())
    }
}

#[cfg(test)]
mod conformance_tests;
#[cfg(test)]
mod test_swinging;
#[cfg(test)]
mod tests;
