//! The call of `selvedge study`.

use std::path::PathBuf;

use clap::Args;
use selvedge_cluster::Shard;

use super::DeviceArgs;
use super::eval::MOST_THREADS;

/// Train a list of models and evaluate them together, as a file says.
///
/// A study that was interrupted goes on where it stopped when it is started again: trainings from
/// their last checkpoint, and what was measured is kept. The report is written when all is there.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge study ten-minutes -o studies/ten-minutes
  selvedge study my-study.toml -o studies/mine
  selvedge study table1 -o studies/table1 --device gpu

The folder gets report/ (report.md, plots, numbers), trainings/ (a model each), evaluations/ and
data/ (the data sets that the study makes). docs/src/guides/studies.md says how a study is written.")]
pub(crate) struct StudyArgs {
    /// A study: a TOML file, or the name of a shipped one (`selvedge list studies`).
    pub(crate) study: String,
    /// The folder of the study; it is made.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// Cases that are measured at once [default: as many as there are processors].
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(crate) jobs: Option<u16>,
    /// Only train the models of part I of N, counted from 1: trainings that go on from one another
    /// are one. Parts may run at once in one folder; when all are done, the same command without
    /// this option measures and reports.
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
    /// The machine that trains and runs models.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
}
