//! The learned simulator as a [`Stepper`]: features of the last frames, one pass of the network,
//! and the integration of its acceleration. Where the pass is computed is an [`Inference`]'s
//! concern; features and integration are the processor's.
//!
//! Handle vertices never follow the network: after the step they are at their targets.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, Snapshot, StepError, Stepper, Stop, Topology,
    check_target_count,
};

use crate::features::Window;
use crate::graph::ClothGraph;
use crate::kernels::simd::Instructions;
use crate::network::packed::{PackedWeights, Purpose};
use crate::network::workspace::Workspace;
use crate::network::{Pass, Stopped};
use crate::rollout::model::Model;
use crate::rollout::state::{RolloutError, RolloutState};

/// The network at work on one cloth, on a machine.
pub trait Inference {
    /// The pass of `model` over the normalised `features` of `graph`, for frame `frame`: normalised
    /// accelerations, `[vertices, 3]`.
    ///
    /// # Errors
    /// [`StepError::Stopped`], or [`StepError::Device`] where the machine fails.
    fn forward(
        &mut self,
        model: &Model,
        graph: &ClothGraph,
        features: &Window,
        frame: usize,
    ) -> Result<&[f32], StepError>;

    /// As [`Stepper::stop_by`].
    fn stop_by(&mut self, stop: Stop) {
        let _ = stop;
    }
}

/// The network on the processor.
pub struct OnProcessor {
    weights: PackedWeights<f32>,
    workspace: Workspace<f32>,
}

impl Inference for OnProcessor {
    fn forward(
        &mut self,
        model: &Model,
        graph: &ClothGraph,
        features: &Window,
        frame: usize,
    ) -> Result<&[f32], StepError> {
        let (graph, input) = (graph.connectivity(), features.input());
        let output = model.network().forward_packed(
            &self.weights,
            graph,
            input,
            Pass::Inference,
            &mut self.workspace,
        );
        output.map_err(|Stopped| StepError::Stopped { frame })
    }

    /// Heard within the network.
    fn stop_by(&mut self, stop: Stop) {
        self.workspace.stop_by(stop);
    }
}

/// A cloth that a trained model moves.
pub struct LearnedStepper<I = OnProcessor> {
    model: Arc<Model>,
    state: RolloutState,
    inference: I,
}

impl LearnedStepper {
    /// Starts on the processor, as [`Self::on`].
    ///
    /// # Errors
    /// As [`Self::on`].
    pub fn new(
        model: Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Self, RolloutError> {
        let (network, purpose) = (model.network(), Purpose::Inference);
        let inference = OnProcessor {
            weights: network.pack(model.weights(), purpose, Instructions::Detected),
            workspace: Workspace::new(),
        };
        Self::on(inference, model, graph, start)
    }
}

impl<I> LearnedStepper<I> {
    /// Starts from the last frames before now, oldest first `[m]`, `[frames][vertices]`. If the
    /// model needs more frames, the cloth is taken to have stood still before the first.
    ///
    /// # Errors
    /// [`RolloutError`] when there is no frame, or one that does not fit the cloth, or the model
    /// needs fabrics that are not known.
    pub fn on(
        inference: I,
        model: Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Self, RolloutError> {
        Ok(Self {
            state: RolloutState::new(model.spec(), graph, start)?,
            inference,
            model,
        })
    }
}

impl<I: Inference> Stepper for LearnedStepper<I> {
    fn topology(&self) -> &Topology {
        self.state.graph().topology()
    }

    fn handles(&self) -> &Handles {
        self.state.graph().handles()
    }

    fn positions(&self) -> &[Vec3] {
        self.state.positions()
    }

    fn frame(&self) -> usize {
        self.state.frame()
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_target_count(self, targets)?;
        let (model, frame) = (&*self.model, self.state.frame() + 1);
        self.state.begin_step(model, targets)?;
        let (graph, features) = (self.state.graph(), self.state.features());
        let output = self.inference.forward(model, graph, features, frame)?;
        self.state.predict(model, output)?;
        self.state.accept();
        Ok(())
    }

    fn stop_by(&mut self, stop: Stop) {
        self.inference.stop_by(stop);
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(self.state.snapshot())
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        self.state.rewind(snapshot)
    }
}

impl<I: Inference> Correctable for LearnedStepper<I> {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.state.replace_frame(positions)
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.state.take_frame(positions)
    }

    fn undo_step(&mut self) {
        self.state.undo_step();
    }

    fn is_strained(&self) -> bool {
        self.state.is_strained
    }
}

#[cfg(test)]
mod tests;
