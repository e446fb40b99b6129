//! A sample, its loss and its gradient.

use std::sync::Arc;

use selvedge_model::{
    Carried, ClothGraph, EncoderState, Gradients, Input, MOST_DEVIATIONS, PackedWeights, Pass,
    Stopped, Workspace, cut,
};

use crate::engine::Setup;

/// A cheap frame of physics, and the corrections that lead to its teacher's.
#[derive(Clone, Debug)]
pub struct CorrectionSample {
    /// The cloth.
    pub graph: Arc<ClothGraph>,
    /// Columns of the vertices, `[vertices, node width]`.
    pub nodes: Vec<f32>,
    /// Corrections that lead to the teacher's frame, `[vertices, 6]`.
    pub target: Vec<f32>,
    /// Weight of each vertex in the loss, 0 where it is not corrected, `[vertices]`: the square of
    /// what its corrections are measured by, with a mean of 1 over those that are.
    pub weights: Vec<f32>,
}

/// The parts that all samples of a step share.
#[derive(Clone, Copy)]
pub(super) struct Shared<'a> {
    pub(super) setup: Setup<'a>,
    pub(super) weights: &'a PackedWeights<f32>,
}

/// Room for the passes of one sample.
pub(super) struct SampleWork {
    workspace: Workspace<f32>,
    nodes: Vec<f32>,
    target: Vec<f32>,
    by_output: Vec<f32>,
    /// Gradient of the sample's part of the loss, laid out like the weights.
    pub(super) gradient: Vec<f32>,
}

impl SampleWork {
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

    /// Leaves the gradient of the loss of `sample`, and gives the loss: the mean over free vertices
    /// and outputs of the squared difference from the target, both in deviations and cut
    /// `[eq:correction-loss]`.
    pub(super) fn learn(
        &mut self,
        shared: Shared<'_>,
        sample: &CorrectionSample,
    ) -> Result<f64, Stopped> {
        let Shared { setup, weights } = shared;
        let (network, cfg) = (setup.network, setup.cfg);
        self.workspace.stop_by(setup.stop.clone());
        self.put(setup, sample);
        let graph = sample.graph.connectivity();
        let carried = Carried {
            input: Input {
                nodes: &self.nodes,
                arcs: &[],
            },
            state: &EncoderState::new(),
        };
        let (pass, workspace) = (Pass::Training(None), &mut self.workspace);
        let out = network.forward_carried(weights, graph, carried, pass, workspace)?;
        let outputs = network.spec().outputs();
        let free = sample.weights.iter().filter(|w| **w > 0.0).count();
        let scale = 1.0 / (outputs * free.max(1)) as f64;
        let part = 1.0 / cfg.batch.samples as f64;
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
                self.by_output.push((2.0 * scale * part * off) as f32);
            }
        }
        let weight = cfg.loss_cap.map_or(1.0, |cap| (cap / loss).min(1.0)) as f32;
        self.by_output.iter_mut().for_each(|g| *g *= weight);
        self.gradient.fill(0.0);
        let gradients = Gradients::new(&self.by_output, &mut self.gradient);
        network.backward_carried(weights, graph, carried, gradients, &mut self.workspace)?;
        Ok(loss)
    }

    /// Puts the columns and the target of `sample` in deviations, cut as in use.
    fn put(&mut self, setup: Setup<'_>, sample: &CorrectionSample) {
        let normalizers = setup.normalizers;
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
