//! Where the arithmetic of a model is done.

use std::str::FromStr;

use clap::{Args, ValueEnum};
use selvedge_lab::machine::{self, DeviceName, Machine};

/// Where, and how exactly.
#[derive(Clone, Copy, Debug, Args)]
pub(crate) struct DeviceArgs {
    /// What computes the model: cpu, or a GPU as cuda or cuda:N (the N-th, counted from 0).
    #[arg(long, value_name = "DEVICE", default_value = "cpu", value_parser = DeviceName::from_str)]
    pub(crate) device: DeviceName,
    /// How a GPU multiplies: sums are single precision always. The processor multiplies in full.
    #[arg(long, value_enum, default_value_t = PrecisionName::Full)]
    pub(crate) precision: PrecisionName,
}

impl DeviceArgs {
    /// Opens the machine that is asked for.
    ///
    /// # Errors
    /// A device that is not there, or a precision that it does not have.
    pub(crate) fn open(&self) -> anyhow::Result<Machine> {
        Machine::open(self.device, self.precision.name())
    }
}

/// How factors are rounded before they are multiplied.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum PrecisionName {
    /// Not at all.
    Full,
    /// To 10 bits (TF32).
    Tensor,
    /// To 7 bits (bf16).
    Half,
}

impl PrecisionName {
    /// The same, as the laboratory names it.
    pub(crate) fn name(self) -> machine::PrecisionName {
        match self {
            Self::Full => machine::PrecisionName::Full,
            Self::Tensor => machine::PrecisionName::Tensor,
            Self::Half => machine::PrecisionName::Half,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn precisions_are_called_what_is_asked_for() {
        for precision in PrecisionName::value_variants() {
            let value = precision.to_possible_value().unwrap();
            assert_eq!(value.get_name(), precision.name().name());
        }
    }
}
