//! The calls of `selvedge study`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use selvedge_cluster::Shard;
use selvedge_lab::convergence::{Method, NamedIntegrator, Settings};
use selvedge_lab::machine::PrecisionName;

use super::DeviceArgs;
use super::device::PrecisionFlag;
use super::evaluate::MOST_THREADS;

/// Train models, measure them and write what came out, as a file says; or study the physics.
///
/// A study that was interrupted goes on where it stopped when it is started again: trainings from
/// their last checkpoint, and what was measured is kept. The report is written when all is there.
/// `selvedge study convergence` is a study of the physics, without a file.
#[derive(Debug, Args)]
#[command(
    args_conflicts_with_subcommands = true,
    subcommand_negates_reqs = true,
    after_help = "\
Examples:
  selvedge study small --out studies/small
  selvedge study my-study.toml --out studies/mine
  selvedge study table1 --out studies/table1 --device cuda
  selvedge study convergence default --out studies/convergence

The folder gets report/ (report.md, plots, numbers), trainings/ (a model each), evaluations/ and
data/ (the data sets that the study makes). docs/src/guides/studies.md says how a study is written."
)]
pub(crate) struct StudyArgs {
    /// A study without a file.
    #[command(subcommand)]
    pub(crate) command: Option<StudyCommand>,
    /// A study by a file.
    #[command(flatten)]
    pub(crate) file: Option<StudyFileArgs>,
    /// The machine that trains and runs models. Beside the others: what may be absent as a whole
    /// may have no parts, or clap takes it for absent.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
}

/// A study as a file says.
#[derive(Debug, Args)]
pub(crate) struct StudyFileArgs {
    /// A study: a TOML file, or the name of a shipped one.
    pub(crate) study: String,
    /// The folder of the study; it is made.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    /// Runs that are measured at once [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u16>,
    /// Only train the models of part I of N, counted from 1: trainings that go on from one another
    /// are one. Parts may run at once in one folder; when all are done, the same command without
    /// this option measures and reports.
    #[arg(long, value_name = "I/N")]
    pub(crate) shard: Option<Shard>,
}

/// Studies without a file.
#[derive(Debug, Subcommand)]
pub(crate) enum StudyCommand {
    Convergence(ConvergenceArgs),
}

/// Measure how far the physics is from its own converged motion, by substeps and integrator.
///
/// A run with many substeps is the truth. From states of it, spread over the motion, each
/// integrator runs with each number of substeps, and is compared with the truth after so many
/// frames: positions, velocities, folds, edges, energy, and milliseconds per frame. The truth's own
/// error is measured by a second run with half the substeps. The numbers are the same for any
/// number of threads, but for the times.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge study convergence default --out studies/convergence
  selvedge study convergence default --out studies/swing --from 70 --to 360
  selvedge study convergence my-scene.toml --out mine --integrators linearised,second-order --substeps 1,2,4
  selvedge study convergence default --out studies/all --motion test --material all
  selvedge study convergence default --out studies/models --motion unseen --whole --model small --model mine=a.safetensors
  selvedge study convergence assets/scenes/elsewhere/*.toml --out studies/elsewhere --model corrected --substeps 2

The folder gets report.md with its plots, convergence.csv (means), starts.csv (every run), whole.csv
(whole runs), times.csv and references/: the true states, in double precision. They are taken again where they fit, so that
a second study of the same scenes is quick. After Ctrl-C the report is of the starts that were done.")]
pub(crate) struct ConvergenceArgs {
    /// Scenes: TOML files, JSON files of ARCSim, or names of shipped ones.
    #[arg(required = true, value_name = "SCENE")]
    pub(crate) scenes: Vec<String>,
    /// The folder of the study; it is made.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    /// Materials in the place of the scenes' own, separated by commas: names of shipped ones, TOML
    /// files, or `all` that ship.
    #[arg(long = "material", value_name = "NAMES", value_delimiter = ',')]
    pub(crate) materials: Vec<String>,
    /// Motions in the place of the scenes' own, separated by commas: names, TOML files, recorded
    /// ones (.csv, .npz), `test` for all test motions, or `unseen` for the ten of these that are
    /// no mirror image of a training motion either.
    #[arg(long = "motion", value_name = "NAMES", value_delimiter = ',')]
    pub(crate) motions: Vec<String>,
    /// Integrators that are measured, as in scenes, separated by commas.
    #[arg(
        long,
        value_name = "NAMES",
        value_delimiter = ',',
        default_value = "linearised,generalised-alpha"
    )]
    integrators: Vec<NamedIntegrator>,
    /// Their numbers of substeps per frame, separated by commas.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', default_value = "1,2,4,8,16", value_parser = clap::value_parser!(u32).range(1..=1000))]
    substeps: Vec<u32>,
    /// A model that is measured beside the physics: a file, or the name of a shipped one; the name
    /// before it is for tables. May stand several times. The physics that a model corrects is
    /// measured with it, also with one substep more.
    #[arg(long = "model", value_name = "[NAME=]FILE")]
    models: Vec<String>,
    /// Precisions of the models' products, separated by commas; each is a method. `half` needs
    /// AVX512-BF16.
    #[arg(
        long = "precision",
        value_enum,
        value_name = "NAMES",
        value_delimiter = ',',
        default_value = "full"
    )]
    precisions: Vec<PrecisionFlag>,
    /// Also run each method from the first frame to the last, and take errors and folds over all
    /// frames together.
    #[arg(long)]
    whole: bool,
    /// The integrator of the truth.
    #[arg(long, value_name = "NAME", default_value = "generalised-alpha")]
    reference_integrator: NamedIntegrator,
    /// The truth's substeps per frame, an even number.
    #[arg(long, value_name = "N", default_value_t = 64, value_parser = clap::value_parser!(u32).range(2..=1000))]
    reference_substeps: u32,
    /// Frames after which errors are taken, separated by commas.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', default_value = "1,5,10,20,50", value_parser = clap::value_parser!(u32).range(1..))]
    horizons: Vec<u32>,
    /// True states from which runs start, spread evenly.
    #[arg(long, value_name = "N", default_value_t = 12, value_parser = clap::value_parser!(u32).range(1..))]
    starts: u32,
    /// The frame of the first start [default: the first].
    #[arg(long, value_name = "FRAME")]
    from: Option<usize>,
    /// The frame in which the last run ends [default: the last of the motion].
    #[arg(long, value_name = "FRAME")]
    to: Option<usize>,
    /// Runs that are made at once [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    threads: Option<u16>,
}

impl ConvergenceArgs {
    /// The models by name, with their files.
    pub(crate) fn named_models(&self) -> Vec<(String, PathBuf)> {
        let named = |word: &String| match word.split_once('=') {
            Some((name, file)) => (name.to_owned(), PathBuf::from(file)),
            None => {
                let file = PathBuf::from(word);
                (format!("model {}", file.with_extension("").display()), file)
            }
        };
        self.models.iter().map(named).collect()
    }

    /// The precisions that are asked for, each once.
    pub(crate) fn precisions(&self) -> Vec<PrecisionName> {
        let mut once = Vec::new();
        for flag in &self.precisions {
            if !once.contains(&flag.name()) {
                once.push(flag.name());
            }
        }
        once
    }

    /// The settings that are asked for, with `models` among the rivals.
    pub(crate) fn settings(&self, models: Vec<Method>) -> Settings {
        let physics = Method::all(&self.integrators, &self.substeps);
        Settings {
            rivals: Method::with_models(physics, models),
            reference: Method {
                integrator: self.reference_integrator.clone(),
                substeps: self.reference_substeps,
            },
            horizons: self
                .horizons
                .iter()
                .map(|&frames| frames as usize)
                .collect(),
            starts: self.starts as usize,
            from: self.from,
            to: self.to,
            whole: self.whole,
            threads: self.threads.map(usize::from),
        }
    }
}
