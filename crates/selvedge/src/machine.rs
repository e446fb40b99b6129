//! Where models run: on the processor, or on a GPU where the program was built for them.
//!
//! Whatever drives, guards, measures or shows a model takes the [`Mover`] that it gets here and does not
//! ask where its arithmetic is done.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::Correctable;
#[cfg(feature = "gpu")]
use selvedge_gpu::device::{Device, Precision};
use selvedge_model::{ClothGraph, LearnedStepper, Model};
use selvedge_train::{Arithmetic, TrainError, Trainer};

use crate::cli::{DeviceArgs, DeviceName, PrecisionName};

/// The name of [`Machine::Cpu`].
pub(crate) const PROCESSOR: &str = "cpu";

/// A model at work on a cloth.
pub(crate) type Mover = Box<dyn Correctable + Send>;

/// What models run on.
#[derive(Clone)]
pub(crate) enum Machine {
    /// The processor.
    Cpu,
    /// A GPU.
    #[cfg(feature = "gpu")]
    Gpu(Arc<dyn Device>, Precision),
}

impl Machine {
    /// What is asked for.
    ///
    /// # Errors
    /// A device that is not there, with what is missing, or a precision that it does not have.
    pub(crate) fn open(args: &DeviceArgs) -> anyhow::Result<Self> {
        match args.device {
            DeviceName::Cpu if args.precision != PrecisionName::Full => anyhow::bail!(
                "--precision {}: the processor multiplies in full precision: name a GPU with --device, or leave \
                 out --precision",
                args.precision.name()
            ),
            DeviceName::Cpu => Ok(Self::Cpu),
            #[cfg(feature = "gpu")]
            name => Ok(Self::Gpu(device(name)?, precision(args.precision))),
            #[cfg(not(feature = "gpu"))]
            DeviceName::Cuda(_) | DeviceName::Host => anyhow::bail!(
                "--device: this selvedge was built without GPUs: build it with \
                 cargo build --release --features gpu, or leave out --device"
            ),
        }
    }

    /// `model` from the last frames before now, oldest first `[m]`, `[frames][vertices]`.
    ///
    /// # Errors
    /// A start that does not fit the cloth; of a GPU also what it does not have.
    pub(crate) fn start(
        &self,
        model: &Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> anyhow::Result<Mover> {
        let model = Arc::clone(model);
        match self {
            Self::Cpu => Ok(Box::new(LearnedStepper::new(model, graph, start)?)),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, precision) => {
                let (device, precision) = (device.as_ref(), *precision);
                let stepper = selvedge_gpu::rollout::stepper::GpuStepper::new(
                    device, model, graph, start, precision,
                )?;
                Ok(Box::new(stepper))
            }
        }
    }

    /// Lets a training's arithmetic be done there.
    ///
    /// # Errors
    /// What of a GPU is not there, such as memory, with what would fit.
    #[cfg_attr(not(feature = "gpu"), allow(unused_variables))]
    pub(crate) fn train(&self, trainer: &mut Trainer) -> Result<(), TrainError> {
        match self {
            Self::Cpu => Ok(()),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, precision) => trainer
                .run_on(|setup| selvedge_gpu::training::engine(device.as_ref(), *precision, setup)),
        }
    }

    /// Whose memory a training takes on it.
    pub(crate) fn arithmetic(&self) -> Arithmetic {
        match self {
            Self::Cpu => Arithmetic::OnProcessor,
            #[cfg(feature = "gpu")]
            Self::Gpu(..) => Arithmetic::OnDevice,
        }
    }

    /// What it is, for people, with its precision where that is not full.
    pub(crate) fn name(&self) -> String {
        match self {
            Self::Cpu => PROCESSOR.to_owned(),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, Precision::Full) => device.name(),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, Precision::Tensor) => format!("{}, precision tensor", device.name()),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, Precision::Half) => format!("{}, precision half", device.name()),
        }
    }
}

/// The device of this name.
///
/// # Errors
/// What is missing.
#[cfg(feature = "gpu")]
pub(crate) fn device(name: DeviceName) -> anyhow::Result<Arc<dyn Device>> {
    use anyhow::Context;
    match name {
        DeviceName::Cpu => anyhow::bail!("--device cpu is no GPU"),
        DeviceName::Cuda(number) => {
            let cuda = selvedge_gpu::device::cuda::Cuda::new(number);
            Ok(Arc::new(cuda.with_context(|| format!("--device {name}"))?))
        }
        DeviceName::Host => {
            let host = selvedge_gpu::device::host::Host::new();
            Ok(Arc::new(host.context("--device host")?))
        }
    }
}

/// What a device multiplies with.
#[cfg(feature = "gpu")]
pub(crate) fn precision(name: PrecisionName) -> Precision {
    match name {
        PrecisionName::Full => Precision::Full,
        PrecisionName::Tensor => Precision::Tensor,
        PrecisionName::Half => Precision::Half,
    }
}
