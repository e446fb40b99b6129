//! The commands with their arguments, and the help that teaches them.

mod device;
#[cfg(test)]
mod documents_tests;
mod drape;
mod eval;
mod export;
mod fit;
mod run;
mod view;

use std::num::NonZeroUsize;
use std::path::PathBuf;
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};
use selvedge_cluster::Shard;
use selvedge_lab::span;
use selvedge_model::WeightType;
use selvedge_train::Setting;
use serde::de::value::Error;
use serde::de::{DeserializeOwned, IntoDeserializer};

pub(crate) use self::device::DeviceArgs;
pub(crate) use self::drape::{DrapeCommand, DrapeFitArgs, DrapeTestArgs, DrapedArgs};
pub(crate) use self::eval::EvalArgs;
pub(crate) use self::export::{ExportArgs, FormatName};
pub(crate) use self::fit::FitArgs;
pub(crate) use self::run::{RunArgs, StartChoice};
pub(crate) use self::view::ViewArgs;
use crate::output::Reader;

/// Cloth simulation: an implicit solver with contact, and graph networks trained on it.
///
/// From a cloth and the motion of a few of its vertices, the handles, it computes the motion of the whole
/// cloth, by the solver or by a graph network (MeshGraphNetRP).
#[derive(Debug, Parser)]
#[command(name = "selvedge", version = env!("SELVEDGE_VERSION"))]
#[command(propagate_version = true, after_help = OVERVIEW)]
pub(crate) struct Cli {
    /// The command.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Print the result as one JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Neither read nor write the cache of rest poses.
    #[arg(long, global = true)]
    pub(crate) no_cache: bool,
    /// Show no progress: print only warnings and errors to standard error.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Log more; twice for still more.
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub(crate) verbose: u8,
}

impl Cli {
    /// The reader of the result.
    pub(crate) fn reader(&self) -> Reader {
        if self.json { Reader::Program } else { Reader::Person }
    }
}

/// Frames at most: they are held in memory, 1.2 GB for the 1024 vertices of the paper.
const MOST_FRAMES: i64 = 100_000;

const OVERVIEW: &str = "\
Start here:
  selvedge run --model paper --compare
      a shipped model on the shipped scene beside the solver; pictures and a clip go to out/
  selvedge view --open
      drag the cloth in the browser
  selvedge run default -o truth.safetensors
      the same scene by the solver alone

Exit codes: 0 done, 1 failed, 2 wrong usage, 130 interrupted.
Ctrl-C finishes the files that can be finished; a second one stops at once.";

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Run(RunArgs),
    View(ViewArgs),
    Export(ExportArgs),
    Compare(CompareArgs),
    #[command(subcommand)]
    Data(DataCommand),
    Train(TrainArgs),
    Eval(Box<EvalArgs>),
    #[command(subcommand)]
    Drape(DrapeCommand),
    Fit(FitArgs),
    Info(InfoArgs),
    List(ListArgs),
    #[command(subcommand)]
    Model(ModelCommand),
    #[command(hide = true)]
    Completions(CompletionsArgs),
}

/// Print what a shell needs to complete commands and options.
///
/// The script goes to standard output. Its place for bash is
/// ~/.local/share/bash-completion/completions/selvedge, for zsh _selvedge in a folder of fpath, for
/// fish ~/.config/fish/completions/selvedge.fish.
#[derive(Debug, Args)]
pub(crate) struct CompletionsArgs {
    /// The shell.
    #[arg(value_name = "SHELL")]
    pub(crate) shell: clap_complete::Shell,
}

/// Make training data (`selvedge info` describes it).
#[derive(Debug, Subcommand)]
pub(crate) enum DataCommand {
    Generate(GenerateArgs),
    Merge(MergeArgs),
}

/// Simulate all motions of a preset.
///
/// Start an interrupted run again and it continues where it stopped. The files are the
/// same for any number of threads.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge data generate first -o data/first
  selvedge data generate my-preset.toml -o data/mine -j 4
  selvedge data generate paper -o parts/3 --shard 3/8

With --shard the folder gets the third of eight parts, by a command that needs no other: for the
array jobs of a cluster. `selvedge data merge` makes the parts one.
`selvedge info PRESET` says what a preset will make.")]
pub(crate) struct GenerateArgs {
    /// A preset: a TOML file, or the name of a shipped one (`selvedge list presets`).
    pub(crate) preset: String,
    /// The folder of the data set; it is created.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// Scenes that are simulated at once [default: as many as there are processors].
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) jobs: Option<u16>,
    /// Make only part I of N, counted from 1.
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
}

/// Merge the parts of a data set.
///
/// Every part must be there and whole, and be made from the same preset; the data set then has the
/// same bytes as one that was made by one run. The parts are not changed.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge data merge parts/1 parts/2 parts/3 -o data/mine")]
pub(crate) struct MergeArgs {
    /// The folders of the parts, in any order.
    #[arg(required = true, value_name = "FOLDER")]
    pub(crate) parts: Vec<PathBuf>,
    /// The folder of the data set; it is created.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
}

/// Train a model on a data set.
///
/// Checkpoints go to the folder at intervals; Ctrl-C writes one more, and --resume continues from the
/// last, with the same result as without the interruption.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge train first --data data/first -o runs/first --for 30m
  selvedge train first --data data/first -o runs/first --resume
  selvedge train rp-gru10 --data data/first -o runs/gpu --device gpu --for 8m")]
pub(crate) struct TrainArgs {
    /// A configuration: a TOML file, or the name of a shipped one (`selvedge list configs`).
    pub(crate) config: String,
    /// The folder of the run: checkpoints, log, model.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// The folder of the data set, as `selvedge data generate` makes it.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) data: PathBuf,
    /// Continue from the last checkpoint in the folder.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Start with the weights and the statistics of a run, by its folder, or of a model, by its
    /// file or the name of a shipped one. The network must be the same but for its encoder, which
    /// is new where it differs; all else, from the steps to the data, is this training's own.
    #[arg(long, value_name = "RUN|MODEL", conflicts_with = "resume")]
    pub(crate) from: Option<PathBuf>,
    /// Change a value of the configuration, by its dotted path and as in TOML; repeat the option
    /// for several.
    #[arg(long, value_name = "KEY=VALUE")]
    pub(crate) set: Vec<Setting>,
    /// Optimiser steps in all [default: as the configuration says].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(crate) steps: Option<u64>,
    /// Stop after this long, as 90s, 30m or 2h.
    #[arg(long = "for", value_name = "SPAN", value_parser = span::parse)]
    pub(crate) span: Option<Duration>,
    /// Time between two checkpoints, as 30s, 5m or 1h.
    #[arg(long, value_name = "SPAN", value_parser = span::parse, default_value = "5m")]
    pub(crate) checkpoint_every: Duration,
    /// Samples of a micro-batch on the processor [default: 1]; threads share micro-batches. In
    /// steps of one frame its samples go through the network together, in steps of several
    /// (`unroll`) one after the other. A larger number takes less memory and leaves less to share.
    /// Results differ only by rounding.
    #[arg(long, value_name = "N")]
    pub(crate) micro_batch: Option<NonZeroUsize>,
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
}

/// Measure how far two trajectories of one mesh are apart.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge compare out/truth.safetensors out/rollout.safetensors")]
pub(crate) struct CompareArgs {
    /// The truth.
    pub(crate) a: PathBuf,
    /// The trajectory to compare with it.
    pub(crate) b: PathBuf,
}

/// Describe a file or folder.
///
/// Reads trajectories, states, models, checkpoints, scenes, presets (what they will make, without
/// making it), training configurations, meshes, exported arrays (.npz), nodes of other programs
/// (.glb, USD), and the folders of data sets (of which every file is checked against its hash) and
/// trainings.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge info out/rollout.safetensors
  selvedge info out/rollout.safetensors --picture strain.png

Lengths are in metres, all numbers in SI units; --json has the configurations too.")]
pub(crate) struct InfoArgs {
    /// A file, a folder, or the name of a shipped scene or preset.
    pub(crate) path: PathBuf,
    /// Also draw a run with its strain, or a mesh or a scene in its start pose (.png).
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,
}

/// List what ships with the program.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge list models")]
pub(crate) struct ListArgs {
    /// The kind of things.
    #[arg(value_enum)]
    pub(crate) what: Shipped,
}

/// A kind of things that ship with the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Shipped {
    /// Scenes, for `run`, `view` and `eval`.
    Scenes,
    /// Fabrics, for scenes.
    Materials,
    /// Models, for `--model`.
    Models,
    /// Motions of the handles, for scenes.
    Motions,
    /// Configurations of trainings, for `train`, with their networks.
    Configs,
    /// Presets of data sets, for `data generate`.
    Presets,
}

/// Convert model files.
#[derive(Debug, Subcommand)]
pub(crate) enum ModelCommand {
    Convert(ConvertArgs),
}

/// Write a model with its weights in half precision, in half the bytes.
///
/// They are widened to single precision when it is read: a frame takes as long as before.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge model convert my-model.safetensors --weights f16 -o my-model-half.safetensors")]
pub(crate) struct ConvertArgs {
    /// The model (.safetensors).
    pub(crate) model: PathBuf,
    /// f16 keeps 11 bits of each weight and refuses those above 65504; bf16 keeps 8 bits of any;
    /// f32 widens them again.
    #[arg(long, value_parser = word::<WeightType>([("f32", "IEEE single precision"), ("f16", "IEEE half precision"), ("bf16", "The upper half of single precision")]))]
    pub(crate) weights: WeightType,
    /// The file to write (.safetensors).
    #[arg(short, long, value_name = "FILE")]
    pub(crate) output: PathBuf,
}

/// The parser of one of these words, each with its meaning; files have the same words for a `T`.
fn word<T: DeserializeOwned + Clone + Send + Sync + 'static>(
    words: impl IntoIterator<Item = (&'static str, &'static str)>,
) -> impl TypedValueParser<Value = T> {
    let words = words.into_iter();
    let words = words.map(|(word, meaning)| PossibleValue::new(word).help(meaning));
    PossibleValuesParser::new(words)
        .try_map(|word| T::deserialize(word.into_deserializer()) as Result<T, Error>)
}
