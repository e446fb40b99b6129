//! The network of a model that corrects physics, on a device. Physics and columns stay with the
//! processor; normalised columns go up and normalised corrections come back in every frame.

use selvedge_model::{
    ClothGraph, CorrectionError, CorrectionNetwork, Extent, Input, Model, Neighbours,
};
use thiserror::Error;

use crate::bench::NetworkCase;
use crate::bench::inference::Inference;
use crate::device::{Device, DeviceError, Precision};

/// A network that cannot be brought onto a device.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the messages say what")]
pub enum CorrectionsError {
    #[error(
        "a network without blocks (model.blocks = 0) runs on the processor only: leave out --device"
    )]
    NoBlocks,
    #[error(transparent)]
    Device(#[from] DeviceError),
}

/// The network of one cloth on a device.
pub struct GpuCorrections {
    inference: Inference,
}

impl GpuCorrections {
    /// Brings the network of `model` onto `device`, for the cloth of `graph`.
    ///
    /// # Errors
    /// A network without blocks, too little memory, or a device that fails.
    pub fn new(
        device: &dyn Device,
        model: &Model,
        graph: &ClothGraph,
        precision: Precision,
    ) -> Result<Self, CorrectionsError> {
        if model.spec().neighbours() == Neighbours::Sums {
            return Err(CorrectionsError::NoBlocks);
        }
        let case = NetworkCase {
            network: model.network(),
            weights: model.weights(),
            graph: graph.connectivity(),
            extent: Extent::Whole,
        };
        Ok(Self {
            inference: Inference::new(device, case, precision)?,
        })
    }

    fn pass(&mut self, input: Input<'_, f32>) -> Result<Vec<f32>, DeviceError> {
        self.inference.put(input)?;
        self.inference.run()?;
        self.inference.output()
    }
}

impl CorrectionNetwork for GpuCorrections {
    fn run(
        &mut self,
        nodes: &[f32],
        arcs: &[f32],
        rows: &mut Vec<f32>,
    ) -> Result<(), CorrectionError> {
        let failed = |error: DeviceError| CorrectionError::Device(error.to_string());
        *rows = self.pass(Input { nodes, arcs }).map_err(failed)?;
        Ok(())
    }
}
