//! The call of `selvedge fit`.

use std::path::PathBuf;

use clap::Args;

/// Estimate parameters of a scene from observations of a cloth, or for a goal.
///
/// Fabric, air, the start or the motion of the handles, by the gradients of the solver and L-BFGS
/// within bounds. Observations are a trajectory, or a table of markers of which any may be
/// missing; a goal is a table, too. The report lists what the data do not determine. Ctrl-C writes the
/// best parameters so far.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge fit swing.toml -o out/swing

The configuration (.toml) has a scene, the data, and bounds of the parameters:

  scene = \"swing-scene.toml\"     # a file beside the configuration, or a shipped name
  starts = 1                     # searches: the scene's own parameters, then random ones (seed)
  runs = 60                      # per search, at most
  data = { markers = \"markers.csv\", noise = 0.001 }     # or trajectory = \"truth.safetensors\"
  material = { stretch = [0.2, 5.0], bend = [0.2, 5.0], density = [0.05, 1.0] }

docs/src/guides/fitting.md has all keys. The folder gets report.md, fit.json, run.safetensors
and the estimates as files for scenes. A fabric from drapes: selvedge drape fit.")]
pub(crate) struct FitArgs {
    /// The configuration (.toml).
    pub(crate) config: PathBuf,
    /// The folder of the results; it is created, and must be empty.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
}
