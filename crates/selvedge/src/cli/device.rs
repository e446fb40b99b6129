//! Where the arithmetic of a model is done.

use std::fmt;
use std::str::FromStr;

use clap::{Args, ValueEnum};

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

/// What computes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum DeviceName {
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
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let problem = || format!("there is no device {text:?}: there are cpu, cuda and cuda:N");
        match text.split_once(':') {
            None if text == "cpu" => Ok(Self::Cpu),
            None if text == "cuda" => Ok(Self::Cuda(0)),
            None if text == "host" => Ok(Self::Host),
            Some(("cuda", number)) => number.parse().map(Self::Cuda).map_err(|_| problem()),
            _ => Err(problem()),
        }
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
    /// As the command line has it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Full => "full",
            Self::Tensor => "tensor",
            Self::Half => "half",
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
            assert_eq!(value.get_name(), precision.name());
        }
    }

    #[test]
    fn devices_are_named_and_numbered() {
        assert_eq!("cpu".parse(), Ok(DeviceName::Cpu));
        assert_eq!("cuda".parse(), Ok(DeviceName::Cuda(0)));
        assert_eq!("cuda:3".parse(), Ok(DeviceName::Cuda(3)));
        for name in ["cpu", "cuda", "cuda:3", "host"] {
            assert_eq!(name.parse::<DeviceName>().unwrap().to_string(), name);
        }
        for wrong in ["gpu", "cuda:", "cuda:x", "cuda:-1", "cpu:0", ""] {
            let problem = wrong.parse::<DeviceName>().unwrap_err();
            assert!(
                problem.contains("there are cpu, cuda and cuda:N"),
                "{problem}"
            );
        }
    }
}
