//! Machines that run and train models: the processor, or a GPU with the feature `gpu`.

pub use selvedge::machine::{DeviceName, Machine, Mover, PROCESSOR};
use selvedge_train::{EngineMaker, OnProcessor};

/// The maker of a training's engine on `machine`; on the processor its micro-batches have
/// `micro_batch` samples.
pub fn engine(machine: &Machine, micro_batch: usize) -> Box<dyn EngineMaker + '_> {
    match machine {
        Machine::Cpu => Box::new(OnProcessor { micro_batch }),
        #[cfg(feature = "gpu")]
        Machine::Gpu(gpu) => Box::new(selvedge_gpu::training::OnGpu {
            gpu: std::sync::Arc::clone(gpu),
        }),
    }
}
