//! Where models run: on the processor, or on a GPU where the program was built for them.
//!
//! Whatever drives, guards, measures or shows a model takes the [`Mover`] that it gets here and does not
//! ask where its arithmetic is done.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::Correctable;
#[cfg(feature = "gpu")]
use selvedge_gpu::device::{Device, Precision};
use selvedge_model::{ClothGraph, LearnedStepper, Model};
use selvedge_train::{EngineMaker, OnProcessor};

use thiserror::Error;

/// What computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceName {
    /// The processor, by the engine that is made for it.
    Cpu,
    /// An NVIDIA GPU.
    Cuda(usize),
    /// The processor, by the kernels of the GPU: slow, to test them.
    Host,
}

impl fmt::Display for DeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cpu => f.write_str("cpu"),
            Self::Cuda(0) => f.write_str("cuda"),
            Self::Cuda(number) => write!(f, "cuda:{number}"),
            Self::Host => f.write_str("host"),
        }
    }
}

impl FromStr for DeviceName {
    type Err = DeviceNameError;

    fn from_str(text: &str) -> Result<Self, DeviceNameError> {
        let problem = || DeviceNameError(text.to_owned());
        match text.split_once(':') {
            None if text == "cpu" => Ok(Self::Cpu),
            None if text == "cuda" => Ok(Self::Cuda(0)),
            None if text == "host" => Ok(Self::Host),
            Some(("cuda", number)) => number.parse().map(Self::Cuda).map_err(|_| problem()),
            _ => Err(problem()),
        }
    }
}

/// A name that no device has.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no device {0:?}: there are cpu, cuda and cuda:N")]
pub struct DeviceNameError(pub String);

/// How factors are rounded before they are multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrecisionName {
    /// Not at all.
    Full,
    /// To 10 bits (TF32).
    Tensor,
    /// To 7 bits (bf16).
    Half,
}

impl PrecisionName {
    /// As the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Tensor => "tensor",
            Self::Half => "half",
        }
    }
}

/// The name of [`Machine::Cpu`].
pub const PROCESSOR: &str = "cpu";

/// A model at work on a cloth.
pub type Mover = Box<dyn Correctable + Send>;

/// What models run on.
#[derive(Clone)]
pub enum Machine {
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
    pub fn open(device: DeviceName, precision: PrecisionName) -> anyhow::Result<Self> {
        match device {
            DeviceName::Cpu if precision != PrecisionName::Full => anyhow::bail!(
                "--precision {}: the processor multiplies in full precision: name a GPU with --device, or leave \
                 out --precision",
                precision.name()
            ),
            DeviceName::Cpu => Ok(Self::Cpu),
            #[cfg(feature = "gpu")]
            name => Ok(Self::Gpu(open_device(name)?, precision_of(precision))),
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
    pub fn start(
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

    /// The maker of a training's engine; on the processor `micro_batch` samples go through the network
    /// together.
    pub fn engine(&self, micro_batch: usize) -> Box<dyn EngineMaker + '_> {
        match self {
            Self::Cpu => Box::new(OnProcessor { micro_batch }),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, precision) => Box::new(selvedge_gpu::training::OnDevice {
                device: device.as_ref(),
                precision: *precision,
            }),
        }
    }

    /// What it is, for people, with its precision where that is not full.
    pub fn name(&self) -> String {
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
pub fn open_device(name: DeviceName) -> anyhow::Result<Arc<dyn Device>> {
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
pub fn precision_of(name: PrecisionName) -> Precision {
    match name {
        PrecisionName::Full => Precision::Full,
        PrecisionName::Tensor => Precision::Tensor,
        PrecisionName::Half => Precision::Half,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_named_and_numbered() {
        assert_eq!("cpu".parse(), Ok(DeviceName::Cpu));
        assert_eq!("cuda".parse(), Ok(DeviceName::Cuda(0)));
        assert_eq!("cuda:3".parse(), Ok(DeviceName::Cuda(3)));
        for name in ["cpu", "cuda", "cuda:3", "host"] {
            assert_eq!(name.parse::<DeviceName>().unwrap().to_string(), name);
        }
        for wrong in ["gpu", "cuda:", "cuda:x", "cuda:-1", "cpu:0", ""] {
            let problem = wrong.parse::<DeviceName>().unwrap_err().to_string();
            assert!(
                problem.contains("there are cpu, cuda and cuda:N"),
                "{problem}"
            );
        }
    }
}
