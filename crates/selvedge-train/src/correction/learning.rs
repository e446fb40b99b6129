//! The loss of a sample and its gradient.

use selvedge_cloth::Stop;
use selvedge_model::{
    Carried, EncoderState, Gradients, Input, MOST_DEVIATIONS, Network, Normalizers, PackedWeights,
    Pass, Stopped, Workspace, cut,
};

use super::store::CorrectionSample;

/// Room for the passes of one sample.
pub(super) struct Desk {
    workspace: Workspace<f32>,
    nodes: Vec<f32>,
    target: Vec<f32>,
    by_output: Vec<f32>,
    /// Gradient of the sample's part of the loss, laid out like the weights.
    pub(super) gradient: Vec<f32>,
}

/// The parts that all samples of a step share.
#[derive(Clone, Copy)]
pub(super) struct Lesson<'a> {
    pub(super) network: &'a Network,
    pub(super) weights: &'a PackedWeights<f32>,
    pub(super) normalizers: &'a Normalizers,
    /// `loss_cap` of the configuration.
    pub(super) cap: Option<f64>,
    /// Part of a sample in the mean over its batch.
    pub(super) part: f64,
}

impl Desk {
    /// Room for a network of so many weights.
    pub(super) fn new(weights: usize) -> Self {
        Self {
            workspace: Workspace::new(),
            nodes: Vec::new(),
            target: Vec::new(),
            by_output: Vec::new(),
            gradient: vec![0.0; weights],
        }
    }

    /// Lets [`Self::learn`] end early, with an error, from when `stop` is wanted.
    pub(super) fn stop_by(&mut self, stop: Stop) {
        self.workspace.stop_by(stop);
    }

    /// Leaves the gradient of the loss of `sample`, and gives the loss: the mean over free vertices
    /// and outputs of the squared difference from the target, both in deviations and cut
    /// `[eq:correction-loss]`.
    pub(super) fn learn(
        &mut self,
        lesson: Lesson<'_>,
        sample: &CorrectionSample,
    ) -> Result<f64, Stopped> {
        self.put(lesson, sample);
        let graph = sample.graph.connectivity();
        let state = EncoderState::new();
        let carried = Carried {
            input: Input {
                nodes: &self.nodes,
                arcs: &[],
            },
            state: &state,
        };
        let pass = Pass::Training(None);
        let out = lesson.network.forward_carried(
            lesson.weights,
            graph,
            carried,
            pass,
            &mut self.workspace,
        )?;
        let outputs = lesson.network.spec().outputs();
        let free = sample.weights.iter().filter(|w| **w > 0.0).count();
        let scale = 1.0 / (outputs * free.max(1)) as f64;
        self.by_output.clear();
        let mut loss = 0.0;
        let rows = out.chunks_exact(outputs);
        let pairs = rows
            .zip(self.target.chunks_exact(outputs))
            .zip(&sample.weights);
        for ((row, target), &weight) in pairs {
            for (found, wanted) in row.iter().zip(target) {
                let off = f64::from(weight) * f64::from(found - wanted);
                loss += scale * off * f64::from(found - wanted);
                self.by_output
                    .push((2.0 * scale * lesson.part * off) as f32);
            }
        }
        let weight = lesson.cap.map_or(1.0, |cap| (cap / loss).min(1.0)) as f32;
        self.by_output.iter_mut().for_each(|g| *g *= weight);
        self.gradient.fill(0.0);
        let gradients = Gradients::new(&self.by_output, &mut self.gradient);
        lesson.network.backward_carried(
            lesson.weights,
            graph,
            carried,
            gradients,
            &mut self.workspace,
        )?;
        Ok(loss)
    }

    /// Puts the columns and the target of `sample` in deviations, cut as in use.
    fn put(&mut self, lesson: Lesson<'_>, sample: &CorrectionSample) {
        let normalizers = lesson.normalizers;
        for (to, from, normalizer) in [
            (&mut self.nodes, &sample.nodes, &normalizers.nodes),
            (&mut self.target, &sample.target, &normalizers.acceleration),
        ] {
            to.clear();
            to.extend_from_slice(from);
            normalizer.normalize(to);
            cut(to, MOST_DEVIATIONS);
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use std::sync::Arc;

    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use selvedge_cloth::generate::{SquareSpec, square};
    use selvedge_cloth::{Cloth, Environment, Handles};
    use selvedge_model::{
        ClothGraph, Encoder, Instructions, ModelSpec, Normalizer, PhysicsBase, Purpose,
    };

    use super::*;

    /// The spec of a small network that corrects one substep.
    pub(in crate::correction) fn spec() -> ModelSpec {
        ModelSpec {
            base: Some(PhysicsBase { substeps: 1 }),
            node_features: Default::default(),
            edge_features: Default::default(),
            ..ModelSpec::physical(Encoder::MLP, 8, 0)
        }
    }

    /// A sample of random numbers on a small square.
    pub(in crate::correction) fn sample(seed: u64) -> CorrectionSample {
        let sheet = SquareSpec {
            vertices: 16,
            size: 1.0,
            seed: 1,
        };
        let sheet = square(&sheet).unwrap();
        let handles = Handles::new(&sheet.labels["upper-corners"], 16).unwrap();
        let cloth = Cloth::of_mesh(&sheet.mesh, 0.15, handles).unwrap();
        let graph = ClothGraph::new(&cloth, Environment::default(), 60.0).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let mut draw = |count: usize| (0..count).map(|_| rng.random::<f32>() - 0.5).collect();
        let spec = spec();
        CorrectionSample {
            nodes: draw(16 * spec.node_width()),
            target: draw(16 * spec.outputs()),
            weights: graph
                .handle_mask()
                .iter()
                .map(|held| f32::from(u8::from(!held)))
                .collect(),
            graph: Arc::new(graph),
        }
    }

    #[test]
    fn the_gradient_is_that_of_the_loss() {
        let spec = spec();
        let network = Network::new(&spec).unwrap();
        let mut rng = ChaCha8Rng::seed_from_u64(3);
        let weights = network.initialise(&mut || rng.random::<f64>());
        let even = |width: usize| Normalizer::new(vec![0.0; width], vec![0.3; width]).unwrap();
        let normalizers = Normalizers {
            nodes: even(spec.node_width()),
            edges: even(spec.edge_width()),
            acceleration: even(spec.outputs()),
        };
        let sample = sample(1);
        let mut desk = Desk::new(weights.len());
        let mut loss = |weights: &[f32]| {
            let packed = network.pack(weights, Purpose::Training, Instructions::Detected);
            let lesson = Lesson {
                network: &network,
                weights: &packed,
                normalizers: &normalizers,
                cap: None,
                part: 1.0,
            };
            let loss = desk.learn(lesson, &sample).expect("nobody stops it");
            (loss, desk.gradient.clone())
        };
        let (_, gradient) = loss(&weights);
        // Along the gradient, where the slope is its length.
        let length = gradient.iter().map(|g| g * g).sum::<f32>().sqrt();
        let step = 1e-2;
        let moved = |sign: f32| -> Vec<f32> {
            let pairs = weights.iter().zip(&gradient);
            pairs.map(|(w, g)| w + sign * step * g / length).collect()
        };
        let slope = (loss(&moved(1.0)).0 - loss(&moved(-1.0)).0) / (2.0 * f64::from(step));
        let expected = f64::from(length);
        assert!(expected > 0.01, "{expected}");
        // Rounding of f32 in a loss of about 1, divided by the step, and the curvature.
        assert!((slope / expected - 1.0).abs() < 5e-3, "{slope} {expected}");
    }
}
