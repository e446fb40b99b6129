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
use selvedge_gpu::gpu::Gpu;
#[cfg(feature = "gpu")]
use selvedge_gpu::rollout::OnGpu;
use selvedge_model::{ClothGraph, LearnedStepper, Model};

use crate::Error;

/// A name of a device, as the command line has it: `cpu`, `gpu`, `gpu:N`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DeviceName {
    /// The processor with its own engine.
    Cpu,
    /// A GPU.
    Gpu(usize),
}

impl fmt::Display for DeviceName {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Cpu => f.write_str("cpu"),
            Self::Gpu(0) => f.write_str("gpu"),
            Self::Gpu(number) => write!(f, "gpu:{number}"),
        }
    }
}

impl FromStr for DeviceName {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self, Error> {
        let problem = || {
            Error::Model(format!(
                "there is no device {text:?}: there are cpu, gpu and gpu:N"
            ))
        };
        match text.split_once(':') {
            None if text == "cpu" => Ok(Self::Cpu),
            None if text == "gpu" => Ok(Self::Gpu(0)),
            Some(("gpu", number)) => number.parse().map(Self::Gpu).map_err(|_| problem()),
            _ => Err(problem()),
        }
    }
}

impl DeviceName {
    /// The device of a rank that is number `local`, from 0, of those on its machine: they take the
    /// GPUs in turn, beginning with the one that is named.
    pub fn of_rank(self, local: usize) -> Result<Self, Error> {
        match self {
            #[cfg(feature = "gpu")]
            Self::Gpu(first) => Ok(Self::Gpu(card_of(first, local, Gpu::count()))),
            #[cfg(not(feature = "gpu"))]
            Self::Gpu(_) => Err(Error::Model(BUILT_WITHOUT.to_owned())),
            Self::Cpu => {
                let _ = local;
                Ok(self)
            }
        }
    }
}

/// The card of rank `local` of a machine with so many cards: one each, beginning with `first`, and
/// once more from the beginning where there are more ranks. A card that is not there stays so.
#[cfg(any(feature = "gpu", test))]
fn card_of(first: usize, local: usize, cards: usize) -> usize {
    if first < cards { (first + local) % cards } else { first }
}

#[cfg(not(feature = "gpu"))]
const BUILT_WITHOUT: &str = "device: this selvedge was built without GPUs: build it with the feature \
                             gpu, or take the processor";

/// The name of [`Machine::Cpu`].
pub const PROCESSOR: &str = "cpu";

/// A model at work on a cloth.
pub type Mover = Box<dyn Correctable + Send + Sync>;

/// A place where models run.
#[derive(Clone)]
pub enum Machine {
    /// The processor.
    Cpu,
    /// A GPU.
    #[cfg(feature = "gpu")]
    Gpu(Arc<Gpu>),
}

impl Machine {
    /// Opens the machine of this name.
    pub fn open(name: DeviceName) -> Result<Self, Error> {
        match name {
            DeviceName::Cpu => Ok(Self::Cpu),
            #[cfg(feature = "gpu")]
            DeviceName::Gpu(number) => {
                let gpu = Gpu::open(number);
                gpu.map(Self::Gpu)
                    .map_err(|error| Error::network(format!("device {name}"), error))
            }
            #[cfg(not(feature = "gpu"))]
            DeviceName::Gpu(_) => Err(Error::Model(BUILT_WITHOUT.to_owned())),
        }
    }

    /// Starts `model` from the last frames before now, oldest first `[m]`, `[frames][vertices]`.
    pub fn start(
        &self,
        model: &Arc<Model>,
        graph: ClothGraph,
        start: &[&[Vec3]],
    ) -> Result<Mover, Error> {
        let start = || -> Result<Mover, Box<dyn std::error::Error + Send + Sync>> {
            let model = Arc::clone(model);
            Ok(match self {
                Self::Cpu => Box::new(LearnedStepper::new(model, graph, start)?),
                #[cfg(feature = "gpu")]
                Self::Gpu(gpu) => {
                    let network = OnGpu::new(gpu, &model, graph.connectivity())?;
                    Box::new(LearnedStepper::on(network, model, graph, start)?)
                }
            })
        };
        start().map_err(|error| Error::network("the first frame of the model", error))
    }

    /// The name for people.
    pub fn name(&self) -> String {
        match self {
            Self::Cpu => PROCESSOR.to_owned(),
            #[cfg(feature = "gpu")]
            Self::Gpu(gpu) => gpu.name().to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn devices_are_named_and_numbered() {
        let all = [
            ("cpu", DeviceName::Cpu),
            ("gpu", DeviceName::Gpu(0)),
            ("gpu:3", DeviceName::Gpu(3)),
        ];
        for (name, device) in all {
            assert_eq!(name.parse::<DeviceName>().unwrap(), device);
            assert_eq!(device.to_string(), name);
        }
        for wrong in ["cuda", "gpu:", "gpu:x", "gpu:-1", "cpu:0", ""] {
            let problem = wrong.parse::<DeviceName>().unwrap_err().to_string();
            assert!(
                problem.contains("there are cpu, gpu and gpu:N"),
                "{problem}"
            );
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
        assert_eq!(DeviceName::Cpu.of_rank(3).unwrap(), DeviceName::Cpu);
    }
}
