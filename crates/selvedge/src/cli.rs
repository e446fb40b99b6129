//! The commands with their arguments, and the help that teaches them.

mod bench;
mod device;
#[cfg(test)]
mod documents;
mod evaluate;
mod export;
mod guard;
mod import;
mod parts;
#[cfg(test)]
mod reference;
mod study;
mod view;

use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::{ArgAction, Args, Parser, Subcommand, ValueEnum};
use selvedge_cluster::Shard;
use selvedge_lab::span;
use selvedge_train::Setting;

#[cfg(feature = "gpu")]
pub(crate) use self::bench::Cloths;
pub(crate) use self::bench::{BenchCommand, ConformanceArgs, EngineArgs, GpuArgs, ScaleArgs};
pub(crate) use self::device::DeviceArgs;
pub(crate) use self::evaluate::EvaluateArgs;
pub(crate) use self::export::{ExportArgs, FormatName};
pub(crate) use self::guard::{GuardName, StressArgs};
pub(crate) use self::import::ImportArgs;
pub(crate) use self::parts::PartArgs;
pub(crate) use self::study::{ConvergenceArgs, StudyArgs, StudyCommand, StudyFileArgs};
pub(crate) use self::view::{Shown, ViewArgs};
use crate::output::Reader;

/// A learned cloth simulator.
///
/// Give it a cloth and the motion of a few handles; it answers with the motion of the whole cloth,
/// from cheap physics that a network corrects, or from a graph network alone. Both were trained on
/// its own physics simulator.
#[derive(Debug, Parser)]
#[command(name = "selvedge", version = env!("SELVEDGE_VERSION"))]
#[command(propagate_version = true, after_help = OVERVIEW)]
pub(crate) struct Cli {
    /// The command.
    #[command(subcommand)]
    pub(crate) command: Command,
    /// Print the answer as one JSON object on standard output.
    #[arg(long, global = true)]
    json: bool,
    /// Find rest poses anew, and keep none for another time.
    #[arg(long, global = true)]
    pub(crate) no_cache: bool,
    /// Show no progress: standard error has warnings and errors alone.
    #[arg(short, long, global = true, conflicts_with = "verbose")]
    pub(crate) quiet: bool,
    /// Say more about what is being done; twice for still more.
    #[arg(short, long, global = true, action = ArgAction::Count)]
    pub(crate) verbose: u8,
}

impl Cli {
    /// The reader of the answer.
    pub(crate) fn reader(&self) -> Reader {
        if self.json {
            Reader::Program
        } else {
            Reader::Person
        }
    }
}

/// Frames at most: they are held in memory, 1.2 GB for the 1024 vertices of the paper.
const MOST_FRAMES: i64 = 100_000;

const OVERVIEW: &str = "\
Start here:
  selvedge rollout
      run the shipped model on the shipped scene; pictures and a clip go to out/
  selvedge view --open
      take hold of the cloth in the browser
  selvedge simulate default --out truth.safetensors
      the same scene by the physics
  selvedge inspect truth.safetensors
      what is in a file

Exit codes: 0 done, 1 failed or interrupted, 2 wrong usage.
Ctrl-C finishes the files that can be finished; a second one stops at once.";

/// The commands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    Rollout(RolloutArgs),
    View(ViewArgs),
    Simulate(SimulateArgs),
    Sag(SagArgs),
    #[command(subcommand)]
    Dataset(DatasetCommand),
    Train(TrainArgs),
    Evaluate(EvaluateArgs),
    Study(StudyArgs),
    Stress(StressArgs),
    Compare(CompareArgs),
    Export(ExportArgs),
    Inspect(InspectArgs),
    Convert(ConvertArgs),
    #[command(subcommand)]
    Bench(BenchCommand),
    /// List the shipped training configurations: their networks, and what these cost.
    ///
    /// Operations per vertex, per arc and per frame of a cloth of 1024 vertices and 5898 arcs (the
    /// paper's), counted from the spec: two for each multiplication with its addition in a product.
    Presets,
    Completions(CompletionsArgs),
    Manual(ManualArgs),
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

/// Write manual pages, one for each command.
///
/// Into ~/.local/share/man/man1 they are found by `man`, as selvedge-rollout.
#[derive(Debug, Args)]
pub(crate) struct ManualArgs {
    /// The folder, made if it is not there.
    #[arg(value_name = "FOLDER")]
    pub(crate) folder: PathBuf,
}

/// Run a trained model on a scene, beside the physics.
///
/// The cloth first sags to its rest pose; then the model moves it frame by frame while the handles
/// follow the scene's motion. The physics runs the same scene, and both are drawn side by side.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge rollout
  selvedge rollout square-1024 --frames 300 --no-truth
  selvedge rollout my-scene.toml --model my-model.safetensors --out my-run
  selvedge rollout --export cloth.glb --export cloth.usda
  selvedge rollout --guard none --trust trust.csv
  selvedge rollout my-large-scene.toml --model small --device cuda

Writes into the folder: rollout.safetensors and truth.safetensors (trajectories), sheet.png (a
contact sheet) and clip.gif. Files of these names from an earlier rollout are removed first.")]
pub(crate) struct RolloutArgs {
    /// A scene: a TOML file, or the name of a shipped one.
    #[arg(default_value = "default")]
    pub(crate) scene: String,
    /// The model's weights: a file, or the name of a shipped one, `corrected`, `general` or
    /// `small` [default: corrected].
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// The folder to write into; it is made.
    #[arg(long, value_name = "FOLDER", default_value = "out")]
    pub(crate) out: PathBuf,
    /// Number of frames [default: as long as the scene's motion].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_FRAMES))]
    pub(crate) frames: Option<u32>,
    /// Correction of frames that no cloth could have.
    #[arg(long, value_enum, default_value_t = GuardName::Limit)]
    pub(crate) guard: GuardName,
    /// The machine of the model.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
    /// Write how far each frame can be trusted to this file (.csv): verdict, strains, energy,
    /// speed, correction.
    #[arg(long, value_name = "FILE")]
    pub(crate) trust: Option<PathBuf>,
    /// Also simulate the truth and compare with it (the default): the physics of the scene, or with
    /// at least eight substeps for a model that corrects physics.
    #[arg(long, conflicts_with = "no_truth")]
    truth: bool,
    /// Do not simulate the truth.
    #[arg(long)]
    no_truth: bool,
    /// Do not make a clip.
    #[arg(long)]
    no_clip: bool,
    /// Also write the model's run in the format of another program, as its name ends: .usda, .usdc,
    /// .usdz, .abc, .glb, .pc2, .npz, .gif or .mp4; may stand several times (`selvedge
    /// export` has more).
    #[arg(long, value_name = "FILE")]
    pub(crate) export: Vec<PathBuf>,
}

/// A wish.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Wanted {
    /// It is.
    Yes,
    /// It is not.
    No,
}

impl Wanted {
    fn unless(refused: bool) -> Self {
        if refused { Self::No } else { Self::Yes }
    }
}

impl RolloutArgs {
    /// The wish for a run of the physics.
    pub(crate) fn truth(&self) -> Wanted {
        Wanted::unless(self.no_truth && !self.truth)
    }

    /// The wish for a clip.
    pub(crate) fn clip(&self) -> Wanted {
        Wanted::unless(self.no_clip)
    }
}

/// Run the physics on a scene.
///
/// The cloth starts where the scene says, by default in its sagged rest pose; the handles follow
/// the scene's motion. Ctrl-C writes the frames so far. A scene of ARCSim (.json) is run as ARCSim
/// runs it.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge simulate default --out truth.safetensors
  selvedge simulate my-scene.toml --out run.safetensors --frames 120
  selvedge simulate my-scene.toml --out fall.safetensors --from-start --clip fall.gif
  selvedge simulate arcsim-scene.json --out run.safetensors --states states.safetensors
  selvedge simulate my-scene.toml --out on.safetensors --state states.safetensors --state-frame 60

A state is read from .safetensors or .npz: the arrays positions and velocities, or ckpt_x and ckpt_v,
[vertices, 3] or [states, vertices, 3] with the frame of each in frames or ckpt_frames.")]
pub(crate) struct SimulateArgs {
    /// A scene: a TOML file, a JSON file of ARCSim, or the name of a shipped one.
    pub(crate) scene: String,
    /// The trajectory to write (.safetensors).
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
    /// Number of frames [default: as long as the scene's motion].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_FRAMES))]
    pub(crate) frames: Option<u32>,
    /// Also draw the run as a clip (.gif), in real time.
    #[arg(long, value_name = "FILE")]
    pub(crate) clip: Option<PathBuf>,
    /// Start in the sagged rest pose.
    #[arg(long, conflicts_with_all = ["from_start", "fit", "state"])]
    from_rest: bool,
    /// Start where the mesh's vertices stand, as a flat sheet that falls.
    #[arg(long, conflicts_with_all = ["fit", "state"])]
    from_start: bool,
    /// Start where the mesh's vertices stand, relaxed from there into the pattern: for garments
    /// that are strained as they stand.
    #[arg(long, conflicts_with = "state")]
    fit: bool,
    /// Start in a state that was saved: positions and velocities (.safetensors, .npz).
    #[arg(long, value_name = "FILE")]
    state: Option<PathBuf>,
    /// The frame of the state [default: 0, or the only one in the file].
    #[arg(long, value_name = "N", requires = "state")]
    state_frame: Option<usize>,
    /// Also keep positions and velocities of every frame in double precision (.safetensors).
    #[arg(long, value_name = "FILE")]
    pub(crate) states: Option<PathBuf>,
    /// Also write the run in the format of another program, as its name ends: .usda, .usdc, .usdz,
    /// .abc, .glb, .pc2, .npz, .gif or .mp4; may stand several times (`selvedge export` has
    /// more).
    #[arg(long, value_name = "FILE")]
    pub(crate) export: Vec<PathBuf>,
}

/// The start of a simulation.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Start<'a> {
    /// As the scene says.
    Scene,
    /// The sagged rest pose.
    Rest,
    /// The positions of the mesh.
    Mesh,
    /// The mesh, relaxed into its pattern.
    Fit,
    /// A saved state: its file, and its frame where one is named.
    State(&'a Path, Option<usize>),
}

impl<'a> Start<'a> {
    /// The file of the saved state.
    pub(crate) fn file(self) -> Option<&'a Path> {
        match self {
            Self::State(path, _) => Some(path),
            Self::Scene | Self::Rest | Self::Mesh | Self::Fit => None,
        }
    }
}

impl SimulateArgs {
    /// The start that is asked for.
    pub(crate) fn start(&self) -> Start<'_> {
        match &self.state {
            Some(path) => Start::State(path, self.state_frame),
            None if self.from_start => Start::Mesh,
            None if self.fit => Start::Fit,
            None if self.from_rest => Start::Rest,
            None => Start::Scene,
        }
    }
}

/// Find the sagged rest pose of a scene: how the cloth hangs from its still handles.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge sag default --out rest.safetensors
  selvedge sag my-scene.toml --out rest.obj
  selvedge sag arcsim-scene.json --out rest.obj")]
pub(crate) struct SagArgs {
    /// A scene: a TOML file, a JSON file of ARCSim, or the name of a shipped one.
    pub(crate) scene: String,
    /// The file to write: a trajectory of one frame (.safetensors) or a mesh (.obj).
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
}

/// Make data to learn from, or look at it.
#[derive(Debug, Subcommand)]
pub(crate) enum DatasetCommand {
    Plan(PlanArgs),
    Generate(GenerateArgs),
    Merge(MergeArgs),
    Import(ImportArgs),
    Inspect(DatasetInspectArgs),
}

/// Simulate all motions of a preset.
///
/// A run that was interrupted goes on where it stopped when it is started again. The files are the
/// same for any number of threads.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge dataset generate first --out data/first
  selvedge dataset generate my-preset.toml --out data/mine --threads 4
  selvedge dataset generate paper --out parts/3 --shard 3/8

With --shard the folder gets the third of eight parts, by a command that needs no other: for the
array jobs of a cluster. `selvedge dataset merge` makes the parts one.")]
pub(crate) struct GenerateArgs {
    /// A preset: a TOML file, or the name of a shipped one.
    pub(crate) preset: String,
    /// The folder of the data set; it is made.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    /// Scenes that are simulated at once [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=1024))]
    pub(crate) threads: Option<u16>,
    /// Make only part I of N, counted from 1.
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
}

/// Make the parts of a data set one.
///
/// Every part must be there and whole, and be made from the same preset; the data set then has the
/// same bytes as one that was made by one run. The parts stay as they are.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge dataset merge parts/1 parts/2 parts/3 --out data/mine")]
pub(crate) struct MergeArgs {
    /// The folders of the parts, in any order.
    #[arg(required = true, value_name = "FOLDER")]
    pub(crate) parts: Vec<PathBuf>,
    /// The folder of the data set; it is made.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
}

/// Say what a preset will make, without making it: trajectories, frames, sections, samples.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge dataset plan paper
  selvedge dataset plan my-preset.toml --json")]
pub(crate) struct PlanArgs {
    /// A preset: a TOML file, or the name of a shipped one.
    pub(crate) preset: String,
}

/// Say what is in a data set, and check every file against its hash.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge dataset inspect data/first
  selvedge dataset inspect data/first --pictures pictures

With --pictures the folder gets histograms.png and one contact sheet per trajectory, as
train-forward.png.")]
pub(crate) struct DatasetInspectArgs {
    /// The folder of the data set.
    pub(crate) folder: PathBuf,
    /// A folder for pictures; it is made.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) pictures: Option<PathBuf>,
}

/// Train a model on a data set, or one that corrects physics by a teacher.
///
/// Checkpoints go to the folder as training goes on; Ctrl-C writes one more, and --resume goes on
/// from the last as if nothing had happened.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge train first --data data/first --out runs/first --for 30m
  selvedge train first --data data/first --out runs/first --resume
  selvedge train rp-gru10 --data data/first --out runs/gpu --device cuda --for 8m
  selvedge train rp-gru10 --data data/first --out runs/small --set model.latent=32 --set model.blocks=4
  selvedge train corrected --out runs/corrected")]
pub(crate) struct TrainArgs {
    /// A configuration: a TOML file, or the name of a shipped one (`selvedge presets` lists them).
    pub(crate) config: String,
    /// The folder of the run: checkpoints, log, model.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    /// The folder of the data set; none for a model that corrects physics, which asks a teacher.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) data: Option<PathBuf>,
    /// Go on from the last checkpoint in the folder.
    #[arg(long)]
    pub(crate) resume: bool,
    /// Start with the weights and the statistics of a run, by its folder, or of a model, by its
    /// file or the name of a shipped one. The network must be the same but for its encoder, which
    /// is new where it differs; all else, from the steps to the data, is this training's own.
    #[arg(long, value_name = "RUN|MODEL", conflicts_with = "resume")]
    pub(crate) from: Option<PathBuf>,
    /// Change a value of the configuration, by its dotted path and as in TOML; may stand several
    /// times.
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

/// Say what a file or folder is and what is in it.
///
/// Knows trajectories, states, models, checkpoints, scenes, presets, training configurations,
/// studies, meshes, exported arrays (.npz), nodes of other programs (.glb, USD), and the
/// folders
/// of data sets, trainings and studies.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge inspect out/rollout.safetensors
  selvedge inspect data/first
  selvedge inspect my-scene.toml
  selvedge inspect out/rollout.safetensors --picture strain.png
  selvedge inspect runs/first --picture loss.svg")]
pub(crate) struct InspectArgs {
    /// A file, a folder, or the name of a shipped scene.
    pub(crate) path: PathBuf,
    /// Also draw it (.png; curves .svg): a run with its strain, a mesh or a scene as it
    /// stands, a training as the curves of its loss, a data set and a model as histograms, states
    /// as speeds.
    #[arg(long, value_name = "FILE")]
    pub(crate) picture: Option<PathBuf>,
}

/// Write a model with its weights in half precision, in half the bytes.
///
/// They are widened to single precision when it is read: a frame takes as long as before.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge convert my-model.safetensors --weights f16 --out my-model-half.safetensors")]
pub(crate) struct ConvertArgs {
    /// The model (.safetensors).
    pub(crate) model: PathBuf,
    /// f16 keeps 11 bits of each weight and refuses those above 65504; bf16 keeps 8 bits of any;
    /// f32 widens them again.
    #[arg(long, value_enum)]
    pub(crate) weights: WeightsName,
    /// The data set that the model was trained on, for a file that does not say what that was: its
    /// bounds are written into the model, so that commands know what goes beyond them.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) trained_on: Option<PathBuf>,
    /// The file to write (.safetensors).
    #[arg(long, value_name = "FILE")]
    pub(crate) out: PathBuf,
}

/// A number format of weights.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum WeightsName {
    /// IEEE single precision.
    F32,
    /// IEEE half precision.
    F16,
    /// The upper half of single precision.
    Bf16,
}
