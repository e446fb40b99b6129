//! The learned simulator as a [`Stepper`]: features of the last frames, one pass of the network,
//! and the integration of its acceleration ([`RolloutState`]).
//!
//! Handle vertices never follow the network: after the step they are at their targets.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, Snapshot, StepError, Stepper, Stop, Topology,
    check_target_count,
};

use crate::graph::ClothGraph;
use crate::kernels::simd::Instructions;
use crate::network::packed::{PackedWeights, Purpose};
use crate::network::workspace::Workspace;
use crate::network::{Pass, Stopped};
use crate::rollout::model::Model;
use crate::rollout::state::{RolloutError, RolloutState};

/// A cloth that a trained model moves.
pub struct LearnedStepper {
    model: Arc<Model>,
    state: RolloutState,
    weights: PackedWeights<f32>,
    workspace: Workspace<f32>,
}

impl LearnedStepper {
    /// Starts from the last frames before now, oldest first `[m]`, `[frames][vertices]`. If the
    /// model needs more frames, the cloth is taken to have stood still before the first.
    ///
    /// # Errors
    /// [`RolloutError`] when there is no frame, or one that does not fit the cloth.
    pub fn new(
        model: Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Self, RolloutError> {
        Ok(Self {
            state: RolloutState::new(model.spec(), graph, start)?,
            weights: model.network().pack(
                model.weights(),
                Purpose::Inference,
                Instructions::Detected,
            ),
            workspace: Workspace::new(),
            model,
        })
    }
}

impl Stepper for LearnedStepper {
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
        self.state.begin_step(&self.model, targets)?;
        let output = self.model.network().forward_packed(
            &self.weights,
            self.state.graph().connectivity(),
            self.state.features().input(),
            Pass::Inference,
            &mut self.workspace,
        );
        let frame = self.state.frame() + 1;
        let output = output.map_err(|Stopped| StepError::Stopped { frame })?;
        self.state.predict(&self.model, output)?;
        self.state.accept();
        Ok(())
    }

    /// Heard within the network.
    fn stop_by(&mut self, stop: Stop) {
        self.workspace.stop_by(stop);
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(self.state.snapshot())
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        self.state.rewind(snapshot)
    }
}

impl Correctable for LearnedStepper {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.state.replace_frame(positions)
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.state.take_frame(positions)
    }

    fn undo_step(&mut self) {
        self.state.undo_step();
    }
}

#[cfg(test)]
mod tests;
