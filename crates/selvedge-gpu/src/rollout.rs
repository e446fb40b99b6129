//! The network of one cloth on a GPU, as a `LearnedStepper` of `selvedge_model` has it: features and
//! integration are the processor's.

use std::sync::Arc;

use selvedge_cloth::StepError;
use selvedge_model::{ClothGraph, Connectivity, Inference, Model, Window};

use crate::gpu::{Gpu, GpuError};
use crate::passes::Passes;

/// The passes of a model over one cloth.
pub struct OnGpu {
    passes: Passes,
    output: Vec<f32>,
}

impl OnGpu {
    /// Puts the model on the GPU, with room for cloths of this graph.
    ///
    /// # Errors
    /// When there is too little memory, or the GPU fails.
    pub fn new(gpu: &Arc<Gpu>, model: &Model, graph: &Connectivity) -> Result<Self, GpuError> {
        let passes = Passes::new(gpu, model.network(), graph, None, None)?;
        passes.set_weights(model.weights());
        let output = Vec::new();
        Ok(Self { passes, output })
    }
}

impl Inference for OnGpu {
    fn forward(
        &mut self,
        _: &Model,
        _: &ClothGraph,
        features: &Window,
        frame: usize,
    ) -> Result<&[f32], StepError> {
        let passed = self.passes.forward(0, features, &[]);
        self.output = passed.map_err(|error| StepError::Device {
            frame,
            reason: error.to_string(),
        })?;
        Ok(&self.output)
    }
}

#[cfg(test)]
mod tests;
