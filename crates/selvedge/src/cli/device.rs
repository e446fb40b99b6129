//! The device and the precision of a model's arithmetic.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use selvedge_lab::machine::{DeviceName, Machine, MachineError, PrecisionName};

use crate::ranks;

/// A device and its precision.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct DeviceArgs {
    /// The device of the model: cpu, or a GPU as cuda or cuda:N (the N-th, counted from 0). Several
    /// ranks on a machine take that one and those after it.
    #[arg(long, value_name = "DEVICE", default_value = "cpu", value_parser = DeviceName::from_str)]
    pub(crate) device: DeviceName,
    /// Precision of products; sums are always in single precision. A processor has `f32` alone.
    #[arg(long, value_enum, default_value_t = PrecisionFlag::Full)]
    precision: PrecisionFlag,
}

impl DeviceArgs {
    /// Opens the machine that is asked for.
    pub(crate) fn open(&self) -> Result<Machine, MachineError> {
        Machine::open(self.of_rank()?, self.precision.name())
    }

    /// Of several ranks on a machine each has a GPU of its own.
    fn of_rank(&self) -> Result<DeviceName, MachineError> {
        let ranks = ranks::all();
        match ranks.are_several() {
            true => self.device.of_rank(ranks.local_rank()),
            false => Ok(self.device),
        }
    }
}

/// A rounding of factors before they are multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum PrecisionFlag {
    /// No rounding.
    #[value(name = "f32", alias = "full")]
    Full,
    /// To 10 bits, on a GPU.
    #[value(name = "tf32", alias = "tensor")]
    Tensor,
}

impl PrecisionFlag {
    /// The precision as the laboratory names it.
    fn name(self) -> PrecisionName {
        match self {
            Self::Full => PrecisionName::Full,
            Self::Tensor => PrecisionName::Tensor,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn precisions_are_called_what_is_asked_for() {
        for precision in PrecisionFlag::value_variants() {
            let value = precision.to_possible_value().unwrap();
            assert_eq!(value.get_name(), precision.name().name());
        }
    }
}
