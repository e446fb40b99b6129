//! The call of `selvedge bench`.

use std::ops::RangeInclusive;
use std::str::FromStr;

use clap::{Args, Subcommand, ValueEnum};

use super::DeviceArgs;
use selvedge_model::Instructions;

/// Measure how fast this machine runs the product.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    Engine(EngineArgs),
    Scale(ScaleArgs),
    Gpu(GpuArgs),
    Conformance(ConformanceArgs),
}

/// Time the networks: a frame and a training step of each variant.
///
/// Beside each, in the same run and in turn: its matrix products alone (the roofline), and with
/// --against another program. Medians; ratios are of runs beside each other.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge bench engine
  selvedge bench engine --variant mlp --variant small --threads 1
  selvedge bench engine --against \"python benches/peer/peer.py\"

The other program gets one line of JSON on its standard input: spec, vertices, node_width, edge_width,
senders, receivers, threads. It answers \"ready\"; then, for each line \"frame\" or \"step\", it runs one and
answers with the milliseconds that it took.")]
pub(crate) struct EngineArgs {
    /// One of gru-10, gru-5, streaming-gru, mlp, meshgraphnets, small; may stand several times
    /// [default: all].
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Vec<String>,
    /// Runs of each; before each, after a rest, some that do not count.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) runs: u16,
    /// Threads [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Cloths in one pass.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) cloths: u16,
    /// A program that runs the same networks, with its arguments.
    #[arg(long, value_name = "COMMAND")]
    pub(crate) against: Option<String>,
    /// Instructions of the engine: the widest that are detected, those that every machine of its
    /// kind has (on x86-64 no AVX), or the widest with products of bf16.
    #[arg(long, value_enum, default_value_t = InstructionsName::Detected)]
    instructions: InstructionsName,
}

impl EngineArgs {
    /// Instructions of the engine; the bare products always take what is detected.
    pub(crate) fn instructions(&self) -> Instructions {
        match self.instructions {
            InstructionsName::Detected => Instructions::Detected,
            InstructionsName::Plain => Instructions::Plain,
            InstructionsName::Half => Instructions::Half,
        }
    }
}

/// Instructions of the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum InstructionsName {
    /// The widest that this machine has.
    Detected,
    /// The instructions that every machine of its architecture has.
    Plain,
    /// The widest, with products of bf16 in frames where the machine has them (AVX512-BF16).
    Half,
}

/// Time a frame of larger and larger cloth, and the memory that it takes.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge bench scale --most 1000000")]
pub(crate) struct ScaleArgs {
    /// The largest number of vertices; those below are 1000, 4000, 16000 and so on.
    #[arg(long, value_name = "N", default_value_t = 256_000, value_parser = clap::value_parser!(u32).range(1000..=10_000_000))]
    pub(crate) most: u32,
    /// Width of the latent vectors.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u16).range(4..=1024))]
    pub(crate) latent: u16,
    /// Threads [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
}

/// Time the networks on a GPU: the forward pass alone, whole frames with features and integration,
/// and steps of learning.
///
/// Beside them what the card can do at most, measured in the same run: products in each precision,
/// and its bandwidth. With --against, another program runs the same forward passes and steps
/// afterwards. Medians.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge bench gpu --device cuda --precision tensor
  selvedge bench gpu --device cuda --vertices 1024 --against \"python benches/peer/peer.py --device cuda\"
  selvedge bench gpu --device cuda --variant gru-10 --vertices 1024,64x1024 --profile

The other programs get what those of `selvedge bench engine` get.")]
pub(crate) struct GpuArgs {
    /// The device and its precision.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
    /// As for `selvedge bench engine`; may stand several times [default: all but small].
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Vec<String>,
    /// Vertices of a cloth, or, as 64x1024, of each of several at once; separated by commas.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', default_value = "1024,10000,100000,64x1024", value_parser = Cloths::from_str)]
    pub(crate) vertices: Vec<Cloths>,
    /// Runs of each that count.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) runs: u16,
    /// Rows of the matrices that the card's limits are measured with.
    #[arg(long, value_name = "N", default_value_t = 8192, value_parser = clap::value_parser!(u16).range(16..=32_768))]
    pub(crate) side: u16,
    /// Also say where the time goes: every kernel and product of a frame and of a step by itself.
    #[arg(long)]
    pub(crate) profile: bool,
    /// A program that runs the same networks, with its arguments; may stand several times.
    #[arg(long, value_name = "COMMAND")]
    pub(crate) against: Vec<String>,
}

/// Cloths of a size.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Cloths {
    /// Number of cloths.
    pub(crate) count: usize,
    /// Vertices of each.
    pub(crate) vertices: usize,
}

impl FromStr for Cloths {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let problem = || {
            format!(
                "there are no cloths {text:?}: take 16 to 10000000 vertices of one, or as 64x1024 those of each of \
                 at most 65535"
            )
        };
        let (count, vertices) = text.split_once('x').unwrap_or(("1", text));
        let number = |text: &str, within: RangeInclusive<usize>| {
            let found = text.parse().ok().filter(|n| within.contains(n));
            found.ok_or_else(problem)
        };
        Ok(Self {
            count: number(count, 1..=65_535)?,
            vertices: number(vertices, 16..=10_000_000)?,
        })
    }
}

/// Hold a GPU against the processor: forward passes, gradients, training steps, rollouts.
///
/// Every network of `selvedge bench engine` with weights drawn from a seed, and the shipped model.
/// What fails, or is off by more than its bound, makes the command fail at its end. Other
/// precisions than full have no bounds: how far off they are is told.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge bench conformance --device cuda
  selvedge bench conformance --device cuda --precision half --variant gru-10
  selvedge bench conformance --device host --variant small")]
pub(crate) struct ConformanceArgs {
    /// The device and its precision.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
    /// As for `selvedge bench engine`; may stand several times [default: all].
    #[arg(long, value_name = "NAME")]
    pub(crate) variant: Vec<String>,
    /// Frames of a rollout.
    #[arg(long, value_name = "N", default_value_t = 30, value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) frames: u16,
    /// Steps of each training.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u16).range(1..))]
    pub(crate) steps: u16,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cloths_are_named_by_their_vertices_and_how_many_they_are() {
        let of = |count, vertices| Ok(Cloths { count, vertices });
        assert_eq!("1024".parse(), of(1, 1024));
        assert_eq!("64x1024".parse(), of(64, 1024));
        for wrong in ["", "x", "64x", "x64", "15", "0x1024", "2x3x4", "-1"] {
            assert!(wrong.parse::<Cloths>().is_err(), "{wrong}");
        }
    }
}
