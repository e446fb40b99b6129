//! The call of `selvedge eval`.

use std::path::PathBuf;
use std::str::FromStr;

use clap::Args;
use selvedge_data::Split;
use selvedge_guard::Correction;
use selvedge_lab::evaluation::{Horizons, Method, PhysicsMethod, RandomCases};

use super::{DeviceArgs, word};

/// Threads at most: more than any machine has, few enough to be started.
pub(super) const MOST_THREADS: i64 = 1024;

/// Measure the errors of models, of the solver and of baselines.
///
/// Three kinds of test cases: recorded trajectories of data sets (--data), scenes for which the solver
/// with many substeps is the ground truth, and random motions without one (--random), of which the runs
/// that diverge are counted. Each method runs from true states spread over the motion, for the error
/// after k frames, and from the first frame to the last. All results but the times are the same for any
/// number of threads. Ctrl-C keeps what is finished.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge eval --model runs/first/model.safetensors --data data/first
  selvedge eval --model ours=a.safetensors --model theirs=b.safetensors --data data/first -o report
  selvedge eval default -o out/convergence --physics linearised:1,linearised:4,generalised-alpha:4
  selvedge eval default -o out/models --motion unseen --model paper --physics 1,2
  selvedge eval --random 1000 --mesh all --guard none --physics 2 -o out/random

The folder of -o gets report.md, errors.csv (a row for each run and frame), times.md
and times.csv; for scenes also references/: true states, which a second evaluation takes again.")]
pub(crate) struct EvalArgs {
    /// Scenes whose converged solution is the ground truth: TOML files, JSON files of ARCSim, or names of
    /// shipped ones. With --random the scene whose cloth moves [default: default].
    #[arg(value_name = "SCENE", conflicts_with = "data")]
    pub(crate) scenes: Vec<String>,
    /// The folder of a data set; repeat the option for several.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) data: Vec<PathBuf>,
    /// Number of random motions, from the rest pose.
    #[arg(long, value_name = "N", conflicts_with = "data", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) random: Option<u32>,
    /// A model: a file, or the name of a shipped one; the name before it is for tables. Repeat
    /// the option for several [default: paper, where nothing else is measured].
    #[arg(long = "model", value_name = "[NAME=]FILE")]
    pub(crate) models: Vec<String>,
    /// Correction of frames that no cloth could have: none, or limit, which brings edges back within
    /// bounds and lets the solver replace what is lost; several, separated by commas, are several
    /// methods.
    #[arg(
        long = "guard",
        value_name = "GUARDS",
        value_delimiter = ',',
        default_value = "limit"
    )]
    guards: Vec<Correction>,
    /// The solver with this number of substeps per frame, by the scene's integrator or another one, as
    /// linearised:4; several, separated by commas.
    #[arg(long, value_name = "[INTEGRATOR:]SUBSTEPS", value_delimiter = ',', value_parser = PhysicsMethod::from_str)]
    physics: Vec<PhysicsMethod>,
    /// Baseline: rigid (the rest pose moved with the handles), or none [default: rigid].
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = ["rigid", "none"])]
    baselines: Vec<String>,
    /// Frames k from true states after which errors are taken, separated by commas [default: those
    /// of 1,5,10,20,50,100,200 that fit].
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) horizons: Option<Vec<u32>>,
    /// True states per case from which runs start, spread evenly.
    #[arg(long, value_name = "N", default_value_t = 8, value_parser = clap::value_parser!(u32).range(1..))]
    starts: u32,
    /// No runs from the first frame to the last.
    #[arg(long, conflicts_with = "random")]
    no_whole: bool,
    /// The frame of the first start [default: the first].
    #[arg(long, value_name = "FRAME")]
    from: Option<usize>,
    /// The frame in which the last run ends [default: the last of the motion].
    #[arg(long, value_name = "FRAME")]
    to: Option<usize>,
    /// Data sets: the split of trajectories.
    #[arg(long, default_value = "test", value_parser = word::<Split>([("train", "Trajectories to learn from"), ("test", "Trajectories to test on")]))]
    pub(crate) split: Split,
    /// Data sets: only these motions. Scenes: motions instead of the scene's own: names, TOML
    /// files, recorded ones (.csv, .npz), `test` for all test motions, or `unseen` for the ten of
    /// these that are no mirror image of a training motion either. Separated by commas.
    #[arg(long = "motion", value_name = "NAMES", value_delimiter = ',')]
    pub(crate) motions: Vec<String>,
    /// Scenes: materials instead of the scene's own, separated by commas: names of shipped
    /// ones, TOML files, or `all` that ship.
    #[arg(long = "material", value_name = "NAMES", value_delimiter = ',')]
    pub(crate) materials: Vec<String>,
    /// Scenes: the solver that is the ground truth, with an even number of substeps.
    #[arg(long, value_name = "[INTEGRATOR:]SUBSTEPS", default_value = "generalised-alpha:64", value_parser = PhysicsMethod::from_str)]
    pub(crate) reference: PhysicsMethod,
    /// Random motions: frames of each.
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u32).range(1..=super::MOST_FRAMES))]
    frames: u32,
    /// Random motions: their seed, and that of the cloths of --mesh.
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,
    /// Random motions: peak speed of the handles, as a fraction of that of the shipped training motions
    /// (1.57 m/s).
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speed)]
    speed: f64,
    /// Random motions: cloths, in turn, instead of the scene's own, as data presets name them:
    /// all, or names separated by commas.
    #[arg(long, value_name = "NAMES", value_delimiter = ',', requires = "random")]
    mesh: Vec<String>,
    /// Random motions: density of these cloths [vertices/m²].
    #[arg(long, value_name = "D", default_value_t = 400.0, requires = "mesh")]
    density: f64,
    /// The folder of the report; it is created. Scenes need one, for their references.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Cases that are run at once [default: as many as there are processors].
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(crate) jobs: Option<u16>,
    /// The machine of the models.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
}

impl EvalArgs {
    /// The guards that are asked for, each once.
    pub(crate) fn guards(&self) -> Vec<Correction> {
        each_once(&self.guards)
    }

    /// Names and files of the models; the shipped one where there is nothing else to measure.
    pub(crate) fn models(&self) -> Vec<String> {
        if self.models.is_empty() && self.physics.is_empty() {
            vec![selvedge_lab::assets::MODEL.0.to_owned()]
        } else {
            self.models.clone()
        }
    }

    /// The physics and the baselines that are asked for.
    pub(crate) fn others(&self) -> Vec<Method> {
        let physics = each_once(&self.physics).into_iter().map(Method::physics);
        let baselines = match (self.baselines.is_empty(), self.random) {
            (true, None) => vec!["rigid".to_owned()],
            _ => each_once(&self.baselines),
        };
        let baselines = baselines.iter().filter_map(|name| Method::baseline(name));
        physics.chain(baselines).collect()
    }

    /// The runs that are asked for.
    pub(crate) fn horizons(&self) -> Horizons {
        let asked = self.horizons.as_ref();
        let asked = asked.map(|frames| frames.iter().map(|&k| k as usize).collect());
        let frames: Vec<usize> = asked.unwrap_or_else(|| Horizons::USUAL.to_vec());
        Horizons {
            whole: !self.no_whole,
            from: self.from,
            to: self.to,
            ..Horizons::new(frames, self.starts as usize)
        }
    }

    /// The random motions that are asked for.
    pub(crate) fn random_cases(&self, count: u32) -> RandomCases {
        RandomCases {
            count: count as usize,
            frames: self.frames as usize,
            seed: self.seed,
            speed: self.speed,
            meshes: self.mesh.clone(),
            density: self.density,
        }
    }
}

fn each_once<T: Clone + PartialEq>(list: &[T]) -> Vec<T> {
    let mut once: Vec<T> = Vec::with_capacity(list.len());
    for entry in list {
        if !once.contains(entry) {
            once.push(entry.clone());
        }
    }
    once
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if speed > 0.0 && speed <= 1000.0 => Ok(speed),
        _ => Err("expected a number above 0 and at most 1000".to_owned()),
    }
}
