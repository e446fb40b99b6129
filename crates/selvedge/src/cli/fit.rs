//! The call of `selvedge fit`.

use std::path::PathBuf;

use clap::Args;

/// Find numbers of a scene from what was seen of a cloth, or from where it is to be.
///
/// Fabric, air, the start or the motion of the handles, by the gradients of the solver and L-BFGS
/// within bounds. What was seen is a trajectory, or a table of markers of which any may be
/// missing; a goal is a table, too. The report says what the data cannot tell. Ctrl-C writes the best
/// numbers so far.
#[derive(Debug, Args)]
#[command(after_help = "\
Example:
  selvedge fit swing.toml -o out/swing

The order (.toml) has a scene, the data, and bounds of the numbers that are to be found:

  scene = \"swing-scene.toml\"     # a file beside the order, or a shipped name
  starts = 1                     # searches: the scene's own numbers, then random ones (seed)
  runs = 60                      # of each search, at most
  data = { markers = \"markers.csv\", noise = 0.001 }     # or trajectory = \"truth.safetensors\"
  material = { stretch = [0.2, 5.0], bend = [0.2, 5.0], density = [0.05, 1.0] }

Other keys: material.stretch_columns, bend_rows, stretch_entries, bend_entries, damping;
environment.air_density, air_drag, wind; start.place, velocity, spin; motion.translation,
rotation_deg. The folder gets report.md, fit.json, run.safetensors, and what was found:
fabric.toml, start.safetensors, motion.toml. A fabric from drapes: selvedge drape fit.")]
pub(crate) struct FitArgs {
    /// The order (.toml).
    pub(crate) order: PathBuf,
    /// The folder of the results; it is made, and must be empty.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
}
