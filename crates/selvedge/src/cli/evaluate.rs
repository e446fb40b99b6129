//! The call of `selvedge evaluate`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use selvedge_data::Split;
use selvedge_lab::evaluation::Horizons;

use super::{DeviceArgs, GuardName, PartArgs};

/// Threads at most: more than any machine has, few enough to be started.
pub(super) const MOST_THREADS: i64 = 1024;

/// Measure models on data sets, beside two naive rivals.
///
/// For every trajectory each model runs from its start to its end, fed with its own output, while
/// the handles move as they did; and from true frames, for k steps. The rivals: the rest pose moved
/// rigidly with the handles, and the physics itself from the other branch of the buckling. The
/// numbers are the same for any number of threads, but for the time of a frame.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge evaluate --model runs/first/model.safetensors --data data/first
  selvedge evaluate --model ours=a.safetensors --model theirs=b.safetensors --data data/first --report report
  selvedge evaluate --model a.safetensors --data data/first --guard none,limit
  selvedge evaluate --model a.safetensors --data data/wide --data data/long --steps 1,20 --no-mirror
  selvedge evaluate --model a.safetensors --data data/first --physics 1,2,8 --report report

With --report the folder gets report.md, its plots (.svg) and all numbers (.csv).")]
pub(crate) struct EvaluateArgs {
    /// A model's weights; the name is for tables. May stand several times.
    #[arg(long = "model", value_name = "[NAME=]FILE", required = true)]
    pub(crate) models: Vec<String>,
    /// The folder of a data set. May stand several times.
    #[arg(long, value_name = "FOLDER", required = true)]
    pub(crate) data: Vec<PathBuf>,
    /// Correction of frames that no cloth could have; several, separated by commas, are several
    /// contestants.
    #[arg(
        long = "guard",
        value_enum,
        value_name = "GUARDS",
        value_delimiter = ',',
        default_value = "limit"
    )]
    pub(crate) guards: Vec<GuardName>,
    /// The split of trajectories.
    #[arg(long, value_enum, default_value_t = SplitName::Test)]
    pub(crate) split: SplitName,
    /// Only these motions, separated by commas.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) motions: Vec<String>,
    /// Errors over so many steps from the truth, separated by commas [default: those of
    /// 1,5,10,20,50,100,200 that fit].
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) steps: Option<Vec<u32>>,
    /// True frames per trajectory from which these steps start.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    starts: u32,
    /// Leave out the physics from the other branch of the buckling, the dearest of all.
    #[arg(long)]
    pub(crate) no_mirror: bool,
    /// Run the physics itself too, with so many substeps per frame; several, separated by commas.
    /// The report then has its errors beside the models' by the time of a frame. A trajectory has
    /// no velocities to start from: over k steps, too, these are errors of whole runs. For those
    /// from true states see `selvedge study convergence`.
    #[arg(long, value_name = "SUBSTEPS", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..=1000))]
    physics: Vec<u32>,
    /// Write tables and plots into this folder; it is made.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) report: Option<PathBuf>,
    /// Write the errors of every frame to this file (.csv).
    #[arg(long, value_name = "FILE")]
    pub(crate) curves: Option<PathBuf>,
    /// Runs that are made at once [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u16>,
    /// Runs in parts.
    #[command(flatten)]
    pub(crate) parts: PartArgs,
    /// The machine of the models.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
}

impl EvaluateArgs {
    /// The guards that are asked for, each once.
    pub(crate) fn guards(&self) -> Vec<GuardName> {
        each_once(&self.guards)
    }

    /// The substeps of the physics that are asked for, each once.
    pub(crate) fn substeps(&self) -> Vec<u32> {
        each_once(&self.physics)
    }

    /// The runs of k steps that are asked for.
    pub(crate) fn horizons(&self) -> Horizons {
        let asked = self.steps.as_ref();
        let asked = asked.map(|steps| steps.iter().map(|&k| k as usize).collect());
        let steps: Vec<usize> = asked.unwrap_or_else(|| Horizons::USUAL.to_vec());
        Horizons::new(steps.into_iter(), self.starts as usize)
    }
}

fn each_once<T: Copy + PartialEq>(list: &[T]) -> Vec<T> {
    let mut once: Vec<T> = Vec::with_capacity(list.len());
    for &entry in list {
        if !once.contains(&entry) {
            once.push(entry);
        }
    }
    once
}

/// Part of a data set.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum SplitName {
    /// Trajectories to learn from.
    Train,
    /// Trajectories to test on.
    Test,
}

impl SplitName {
    /// As people call it.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Train => "train",
            Self::Test => "test",
        }
    }

    /// As the data set has it.
    pub(crate) fn split(self) -> Split {
        match self {
            Self::Train => Split::Train,
            Self::Test => Split::Test,
        }
    }
}
