//! The names of guards, and the call of `selvedge stress`.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use selvedge_guard::{Correction, GuardSettings, When};

use super::PartArgs;
use super::evaluate::MOST_THREADS;

/// Correction of frames that no cloth could have.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum GuardName {
    /// No correction.
    None,
    /// Edges are brought back within bounds; what is lost is replaced by the physics.
    Limit,
    /// The same, after a few implicit solves that relax the frame.
    Physics,
    /// Every frame is relaxed.
    PhysicsAlways,
}

impl GuardName {
    /// The name on the command line.
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Limit => "limit",
            Self::Physics => "physics",
            Self::PhysicsAlways => "physics-always",
        }
    }

    /// The settings of the guard.
    pub(crate) fn settings(self) -> GuardSettings {
        match self {
            Self::None => GuardSettings::with(Correction::None),
            Self::Limit => GuardSettings::with(Correction::Limit),
            Self::Physics => GuardSettings::with(Correction::Physics),
            Self::PhysicsAlways => GuardSettings {
                when: When::Always,
                ..GuardSettings::with(Correction::Physics)
            },
        }
    }
}

/// Drive a model through random motions, without a truth: does it stay whole?
///
/// Every run starts in the rest pose; the handles stand still for half a second and then move in
/// every direction and turn, as in the random motions of the data sets. A run diverges where some
/// edge strains over 30 % for more than 10 frames in a row, or where it fails. The numbers are the
/// same for any number of threads, but for the time of a frame. Ctrl-C prints what is done.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge stress
  selvedge stress --runs 1000 --guard none --out runs.csv
  selvedge stress --only 17,230
  selvedge stress my-scene.toml --model my-model.safetensors --speed 1.5 --out runs.csv
  selvedge stress --mesh all --density 400
  selvedge stress --runs 1000 --guard none --physics 2")]
pub(crate) struct StressArgs {
    /// A scene: a TOML file, or the name of a shipped one. Its motion is not used.
    #[arg(default_value = "default")]
    pub(crate) scene: String,
    /// The model's weights: a file, or the name of a shipped one, `general` or
    /// `small` [default: corrected].
    #[arg(long, value_name = "FILE")]
    pub(crate) model: Option<PathBuf>,
    /// The physics of the scene with so many substeps per frame in the place of a model, to compare
    /// with.
    #[arg(long, value_name = "SUBSTEPS", conflicts_with = "model", value_parser = clap::value_parser!(u32).range(1..=1000))]
    pub(crate) physics: Option<u32>,
    /// Number of motions.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    pub(crate) runs: u32,
    /// Only these motions, by the numbers that --out writes, separated by commas.
    #[arg(long, value_name = "NUMBERS", value_delimiter = ',', conflicts_with = "runs", value_parser = clap::value_parser!(u32).range(..1_000_000))]
    pub(crate) only: Vec<u32>,
    /// Frames of each run.
    #[arg(long, value_name = "N", default_value_t = 600, value_parser = clap::value_parser!(u32).range(1..=super::MOST_FRAMES))]
    pub(crate) frames: u32,
    /// Seed of the motions.
    #[arg(long, value_name = "N", default_value_t = 1)]
    pub(crate) seed: u64,
    /// Peak speed of the handles, in parts of that of the shipped training motions (1.57 m/s).
    #[arg(long, value_name = "FACTOR", default_value_t = 1.0, value_parser = speed)]
    pub(crate) speed: f64,
    /// Correction of frames that no cloth could have.
    #[arg(long, value_enum, default_value_t = GuardName::Limit)]
    pub(crate) guard: GuardName,
    /// Cloths in turn instead of the scene's own, as data presets name them: all, or names
    /// separated by commas.
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) mesh: Vec<String>,
    /// Density of these cloths [vertices/m²].
    #[arg(long, value_name = "D", default_value_t = 400.0, requires = "mesh")]
    pub(crate) density: f64,
    /// Seed of the places of the inner vertices of these cloths.
    #[arg(long, value_name = "N", default_value_t = 1, requires = "mesh")]
    pub(crate) mesh_seed: u64,
    /// Write a line for each run to this file (.csv).
    #[arg(long, value_name = "FILE")]
    pub(crate) out: Option<PathBuf>,
    /// Runs that are made at once [default: as many as there are processors].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=MOST_THREADS))]
    pub(crate) threads: Option<u16>,
    /// Runs in parts.
    #[command(flatten)]
    pub(crate) parts: PartArgs,
}

fn speed(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(speed) if speed > 0.0 && speed <= 1000.0 => Ok(speed),
        _ => Err("expected a number above 0 and at most 1000".to_owned()),
    }
}
