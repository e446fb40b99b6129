//! Rollouts on a GPU: several cloths side by side as one graph, frame by frame.
//!
//! The processor computes the features and the integration, by the state that `selvedge_model`'s own
//! stepper has; the GPU computes the pass between them. A frame that is not finite is rejected: the
//! cloths stay as they were.

use std::sync::Arc;

use glam::Vec3;
use rayon::prelude::*;
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, Snapshot, StepError, Stepper, Topology, check_target_count,
};
use selvedge_model::{
    ClothGraph, Connectivity, Model, OUTPUTS, RolloutError, RolloutState, Window,
};
use thiserror::Error;

use crate::gpu::{Gpu, GpuError};
use crate::passes::{Passes, side_by_side};

/// A cloth and the last frames before now.
pub struct Opening<'a> {
    /// The cloth.
    pub graph: ClothGraph,
    /// Frames, oldest first `[m]`, `[frames][vertices]`. Where there are fewer than the model's
    /// history, the cloth has stood still before them.
    pub start: &'a [&'a [Vec3]],
}

/// Failure of the start of a rollout.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum OpeningError {
    #[error("a rollout needs at least one cloth")]
    NoCloth,
    #[error("cloth {cloth}: {source}")]
    Start { cloth: usize, source: RolloutError },
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Failure of a frame.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum FrameError {
    #[error("cloth {cloth}: {source}")]
    Cloth { cloth: usize, source: StepError },
    #[error(transparent)]
    Gpu(#[from] GpuError),
}

/// Cloths that one model moves on a GPU.
pub struct Rollout {
    model: Arc<Model>,
    cloths: Vec<RolloutState>,
    passes: Passes,
}

impl Rollout {
    /// Starts cloths side by side.
    ///
    /// # Errors
    /// [`OpeningError`] for a start that does not fit its cloth, too little memory, or a GPU that
    /// fails.
    pub fn new(
        gpu: &Arc<Gpu>,
        model: Arc<Model>,
        openings: Vec<Opening<'_>>,
    ) -> Result<Self, OpeningError> {
        if openings.is_empty() {
            return Err(OpeningError::NoCloth);
        }
        let open = |(cloth, Opening { graph, start })| {
            let state = RolloutState::new(model.spec(), graph, start);
            state.map_err(|source| OpeningError::Start { cloth, source })
        };
        let cloths = openings.into_iter().enumerate().map(open);
        let cloths: Vec<RolloutState> = cloths.collect::<Result<_, _>>()?;
        let parts = cloths.iter().map(|cloth| cloth.graph().connectivity());
        let union = Connectivity::union(parts);
        let passes = Passes::new(gpu, model.network(), &union, None, None)?;
        passes.set_weights(model.weights());
        Ok(Self {
            model,
            cloths,
            passes,
        })
    }

    /// A cloth.
    ///
    /// # Panics
    /// When there is no such cloth.
    pub fn cloth(&self, number: usize) -> &RolloutState {
        &self.cloths[number]
    }

    /// A cloth, to correct its frames.
    ///
    /// # Panics
    /// When there is no such cloth.
    pub fn cloth_mut(&mut self, number: usize) -> &mut RolloutState {
        &mut self.cloths[number]
    }

    /// Moves all cloths by one frame. `targets` are those of the handles of each.
    ///
    /// # Errors
    /// [`FrameError`]; the cloths are left as they were.
    ///
    /// # Panics
    /// When there are not as many targets as handles.
    pub fn step(&mut self, targets: &[&HandleTargets]) -> Result<(), FrameError> {
        assert_eq!(targets.len(), self.cloths.len(), "targets of every cloth");
        for (cloth, targets) in self.cloths.iter().zip(targets) {
            let handles = cloth.graph().handles().len();
            assert_eq!(targets.handle_count(), handles, "targets");
        }
        let model = &*self.model;
        let cloths = self.cloths.par_iter_mut().zip(targets);
        let begun = cloths.map(|(cloth, targets)| cloth.begin_step(model, targets));
        let begun: Vec<Result<(), StepError>> = begun.collect();
        for (number, begun) in begun.into_iter().enumerate() {
            begun.map_err(of_cloth(number))?;
        }
        let windows: Vec<&Window> = self.cloths.iter().map(RolloutState::features).collect();
        let input = side_by_side(model.spec(), &windows);
        let output = self.passes.forward(0, &input, &[])?;
        let mut rest = &output[..];
        for (number, cloth) in self.cloths.iter_mut().enumerate() {
            let own;
            (own, rest) = rest.split_at(OUTPUTS * cloth.graph().vertex_count());
            let predicted = cloth.predict(model, own);
            predicted.map_err(of_cloth(number))?;
        }
        self.cloths.iter_mut().for_each(RolloutState::accept);
        Ok(())
    }
}

fn of_cloth(cloth: usize) -> impl Fn(StepError) -> FrameError {
    move |source| FrameError::Cloth { cloth, source }
}

/// One cloth that a trained model moves on a GPU.
pub struct GpuStepper(Rollout);

impl GpuStepper {
    /// Starts from the last frames before now, as [`Opening`] has them.
    ///
    /// # Errors
    /// As [`Rollout::new`].
    pub fn new(
        gpu: &Arc<Gpu>,
        model: Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Self, OpeningError> {
        Rollout::new(gpu, model, vec![Opening { graph, start }]).map(Self)
    }
}

impl Stepper for GpuStepper {
    fn topology(&self) -> &Topology {
        self.0.cloth(0).graph().topology()
    }

    fn handles(&self) -> &Handles {
        self.0.cloth(0).graph().handles()
    }

    fn positions(&self) -> &[Vec3] {
        self.0.cloth(0).positions()
    }

    fn frame(&self) -> usize {
        self.0.cloth(0).frame()
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_target_count(self, targets)?;
        let frame = self.frame() + 1;
        self.0.step(&[targets]).map_err(|error| match error {
            FrameError::Cloth { source, .. } => source,
            FrameError::Gpu(error) => StepError::Device {
                frame,
                reason: error.to_string(),
            },
        })
    }

    fn snapshot(&self) -> Option<Snapshot> {
        Some(self.0.cloth(0).snapshot())
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        self.0.cloth_mut(0).rewind(snapshot)
    }
}

impl Correctable for GpuStepper {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.0.cloth_mut(0).replace_frame(positions)
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        self.0.cloth_mut(0).take_frame(positions)
    }

    fn undo_step(&mut self) {
        self.0.cloth_mut(0).undo_step();
    }
}

#[cfg(test)]
mod tests;
