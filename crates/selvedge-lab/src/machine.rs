//! Machines that run models: the processor, or a GPU with the feature `gpu`.
//!
//! Code that drives, guards, measures or shows a model takes the [`Mover`] that a [`Machine`] gives
//! and does not ask for its arithmetic.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::Correctable;
#[cfg(feature = "gpu")]
use selvedge_gpu::device::{Device, DeviceError, Precision, cuda::Cuda, host::Host};
#[cfg(feature = "gpu")]
use selvedge_gpu::rollout::{OpeningError, stepper::GpuStepper};
use selvedge_model::{ClothGraph, LearnedStepper, Model, RolloutError};
use selvedge_train::{EngineMaker, OnProcessor};
use thiserror::Error;

/// A name of a device, as the command line has it: `cpu`, `cuda`, `cuda:N`, `host`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceName {
    /// The processor with its own engine.
    Cpu,
    /// An NVIDIA GPU.
    Cuda(usize),
    /// The processor with the kernels of the GPU: slow, to test them.
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

impl DeviceName {
    /// The device of a rank that is number `local`, from 0, of those on its machine: they take the
    /// GPUs in turn, beginning with the one that is named.
    pub fn of_rank(self, local: usize) -> Result<Self, MachineError> {
        match self {
            #[cfg(feature = "gpu")]
            Self::Cuda(first) => {
                let cards = Cuda::count();
                let cards = cards.map_err(|source| MachineError::Device { name: self, source })?;
                Ok(Self::Cuda(card_of(first, local, cards)))
            }
            #[cfg(not(feature = "gpu"))]
            Self::Cuda(_) => Err(MachineError::BuiltWithout),
            name @ (Self::Cpu | Self::Host) => {
                let _ = local;
                Ok(name)
            }
        }
    }
}

/// The card of rank `local` of a machine with so many cards: one each, beginning with `first`, and
/// once more from the beginning where there are more ranks. A card that is not there stays so.
#[cfg(any(feature = "gpu", test))]
fn card_of(first: usize, local: usize, cards: usize) -> usize {
    match first < cards {
        true => (first + local) % cards,
        false => first,
    }
}

/// A name that no device has.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("there is no device {0:?}: there are cpu, cuda and cuda:N")]
pub struct DeviceNameError(pub String);

/// A rounding of factors before they are multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum PrecisionName {
    /// No rounding.
    Full,
    /// To 10 bits (TF32).
    Tensor,
}

impl PrecisionName {
    /// The name as the command line has it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Full => "f32",
            Self::Tensor => "tf32",
        }
    }
}

/// The name of [`Machine::Cpu`].
pub const PROCESSOR: &str = "cpu";

/// A model at work on a cloth.
pub type Mover = Box<dyn Correctable + Send>;

/// A place where models run.
#[derive(Clone)]
pub enum Machine {
    /// The processor.
    Cpu,
    /// A GPU.
    #[cfg(feature = "gpu")]
    Gpu(Arc<dyn Device>, Precision),
}

/// A machine that cannot be opened.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum MachineError {
    #[error(
        "precision {}: the processor multiplies in f32 here: take a GPU as device, or precision \
         f32",
        precision.name()
    )]
    Precision { precision: PrecisionName },
    #[error(
        "device: this selvedge was built without GPUs: build it with the feature gpu, or take the \
         processor"
    )]
    BuiltWithout,
    #[error("device cpu is no GPU")]
    Processor,
    #[cfg(feature = "gpu")]
    #[error("device {name}: {source}")]
    Device {
        name: DeviceName,
        source: DeviceError,
    },
}

/// A model that a machine cannot start.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the engines")]
pub enum StartError {
    Processor(#[from] RolloutError),
    #[cfg(feature = "gpu")]
    Gpu(#[from] OpeningError),
}

impl Machine {
    /// Opens the machine of this name.
    pub fn open(device: DeviceName, precision: PrecisionName) -> Result<Self, MachineError> {
        match device {
            DeviceName::Cpu => match precision {
                PrecisionName::Full => Ok(Self::Cpu),
                PrecisionName::Tensor => Err(MachineError::Precision { precision }),
            },
            #[cfg(feature = "gpu")]
            name => Ok(Self::Gpu(open_device(name)?, precision_of(precision))),
            #[cfg(not(feature = "gpu"))]
            DeviceName::Cuda(_) | DeviceName::Host => Err(MachineError::BuiltWithout),
        }
    }

    /// Starts `model` from the last frames before now, oldest first `[m]`, `[frames][vertices]`.
    pub fn start(
        &self,
        model: &Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Mover, StartError> {
        let model = Arc::clone(model);
        match self {
            Self::Cpu => Ok(Box::new(LearnedStepper::new(model, graph, start)?)),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, precision) => {
                let (device, precision) = (device.as_ref(), *precision);
                let stepper = GpuStepper::new(device, model, graph, start, precision)?;
                Ok(Box::new(stepper))
            }
        }
    }

    /// The maker of a training's engine; on the processor its micro-batches have `micro_batch`
    /// samples.
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

    /// The name for people, with the precision where that is not full.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => PROCESSOR.to_owned(),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, Precision::Full) => device.name(),
            #[cfg(feature = "gpu")]
            Self::Gpu(device, _) => format!("{}, precision tf32", device.name()),
        }
    }
}

/// Opens the GPU of this name.
#[cfg(feature = "gpu")]
pub fn open_device(name: DeviceName) -> Result<Arc<dyn Device>, MachineError> {
    let failed = |source| MachineError::Device { name, source };
    match name {
        DeviceName::Cpu => Err(MachineError::Processor),
        DeviceName::Cuda(number) => Ok(Arc::new(Cuda::new(number).map_err(failed)?)),
        DeviceName::Host => Ok(Arc::new(Host::new().map_err(failed)?)),
    }
}

/// The precision of this name, as devices have it.
#[cfg(feature = "gpu")]
pub fn precision_of(name: PrecisionName) -> Precision {
    match name {
        PrecisionName::Full => Precision::Full,
        PrecisionName::Tensor => Precision::Tensor,
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

    /// Their reader may be a program in Python or C#, which has no command line.
    #[test]
    fn errors_name_no_options_of_the_command_line() {
        let precision = PrecisionName::Tensor;
        for error in [
            MachineError::Precision { precision },
            MachineError::BuiltWithout,
            MachineError::Processor,
        ] {
            assert!(!error.to_string().contains("--"), "{error}");
        }
    }

    #[test]
    fn ranks_of_a_machine_take_its_cards_in_turn() {
        let cards = |first, cards| [0, 1, 2, 3, 4].map(|local| card_of(first, local, cards));
        assert_eq!(cards(0, 4), [0, 1, 2, 3, 0]);
        assert_eq!(cards(1, 4), [1, 2, 3, 0, 1]);
        // A launcher that shows each rank one card has chosen already.
        assert_eq!(cards(0, 1), [0; 5]);
        // One that is not there is told of when it is opened.
        assert_eq!(cards(7, 2), [7; 5]);
        for name in [DeviceName::Cpu, DeviceName::Host] {
            assert_eq!(name.of_rank(3).unwrap(), name);
        }
    }
}
