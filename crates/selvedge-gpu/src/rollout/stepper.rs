//! One cloth on a device as a [`Stepper`]: a [`Rollout`] of one cloth.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::{
    Correctable, HandleTargets, Handles, StepError, Stepper, Topology, check_targets_hold,
};
use selvedge_model::{ClothGraph, Model};

use crate::device::{Device, Precision};
use crate::rollout::{FrameError, Opening, OpeningError, Rollout};

/// A cloth that a trained model moves on a device.
pub struct GpuStepper {
    rollout: Rollout,
    next: Vec<Vec3>,
    frame: usize,
}

impl GpuStepper {
    /// Starts from the last frames before now, oldest first `[m]`, `[frames][vertices]`. Where
    /// there are fewer than the model's history, the cloth is assumed to have stood still before
    /// the first.
    ///
    /// # Errors
    /// [`OpeningError`] for a start that does not fit the cloth, too little memory, or a failure of
    /// the device.
    pub fn new(
        device: &dyn Device,
        model: Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
        precision: Precision,
    ) -> Result<Self, OpeningError> {
        let openings = vec![Opening { graph, start }];
        Ok(Self {
            rollout: Rollout::new(device, model, openings, precision)?,
            next: Vec::new(),
            frame: 0,
        })
    }

    /// The model that moves the cloth.
    #[must_use]
    pub fn model(&self) -> &Model {
        self.rollout.model()
    }
}

/// A failure of frame `frame`.
fn of_frame(frame: usize) -> impl Fn(FrameError) -> StepError {
    move |error| match error {
        FrameError::NonFinite { vertex, .. } => StepError::NonFinite { frame, vertex },
        FrameError::Device(error) => StepError::Device {
            frame,
            reason: error.to_string(),
        },
    }
}

impl Stepper for GpuStepper {
    fn topology(&self) -> &Topology {
        self.rollout.graph(0).topology()
    }

    fn handles(&self) -> &Handles {
        self.rollout.graph(0).handles()
    }

    fn positions(&self) -> &[Vec3] {
        self.rollout.positions(0)
    }

    fn frame(&self) -> usize {
        self.frame
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_targets_hold(self, targets)?;
        let frame = self.frame + 1;
        self.next.clear();
        self.next.extend(targets.end().iter().map(|p| p.as_vec3()));
        self.rollout.step(&[&self.next]).map_err(of_frame(frame))?;
        self.frame = frame;
        Ok(())
    }
}

impl Correctable for GpuStepper {
    fn replace_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        let replaced = self.rollout.replace_frame(positions);
        replaced.map_err(of_frame(self.frame))
    }

    fn take_frame(&mut self, positions: &[Vec3]) -> Result<(), StepError> {
        let taken = self.rollout.take_frame(positions);
        taken.map_err(of_frame(self.frame + 1))?;
        self.frame += 1;
        Ok(())
    }

    fn undo_step(&mut self) {
        self.frame -= usize::from(self.rollout.undo_step());
    }
}
