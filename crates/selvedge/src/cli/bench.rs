//! What can be measured.

use clap::{Args, Subcommand, ValueEnum};
use selvedge_model::Instructions;

/// Measure how fast this machine runs the product.
#[derive(Debug, Subcommand)]
pub(crate) enum BenchCommand {
    Engine(EngineArgs),
    Scale(ScaleArgs),
}

/// Time the networks: a frame and a training step of each variant.
///
/// Beside each, in the same run and in turn: its matrix products alone (the roofline), and with --against
/// another program. Medians; ratios are of runs beside each other.
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
    /// One of gru-10, node-gru-10, streaming-gru, mlp, meshgraphnets, small; may stand several times
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
    /// What the engine computes with: the widest instructions that are detected, or those that every
    /// machine of its kind has (on x86-64 no AVX), as on one that has no others.
    #[arg(long, value_enum, default_value_t = InstructionsName::Detected)]
    instructions: InstructionsName,
}

impl EngineArgs {
    /// What the engine computes with; the bare products always take what is detected.
    pub(crate) fn instructions(&self) -> Instructions {
        match self.instructions {
            InstructionsName::Detected => Instructions::Detected,
            InstructionsName::Plain => Instructions::Plain,
        }
    }
}

/// Instructions of the processor.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum InstructionsName {
    /// The widest that this machine has.
    Detected,
    /// Those that every machine of its architecture has.
    Plain,
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
