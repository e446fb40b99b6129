//! The call of `selvedge run`.

use std::path::{Path, PathBuf};
use std::str::FromStr;

use clap::Args;
use selvedge_data::{StartSpec, ending_of};
use selvedge_guard::Correction;

use super::{DeviceArgs, MOST_FRAMES};

/// Run a scene: by the solver, or by a model.
///
/// The cloth starts where the scene says, by default in its sagged rest pose; then the handles
/// follow the scene's motion. With --model the network moves the cloth frame by frame, and with
/// --compare the solver runs the same scene and both are drawn side by side. Ctrl-C writes the
/// frames so far.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge run default -o truth.safetensors
  selvedge run my-scene.toml --frames 120 -o run.safetensors --export run.glb
  selvedge run my-scene.toml --start states.safetensors:60 -o on.safetensors
  selvedge run my-scene.toml --rest -o rest.obj
  selvedge run --model paper --compare
  selvedge run my-scene.toml --model my-model.safetensors -o my-run --export cloth.usdc
  selvedge run my-large-scene.toml --model paper --device gpu

The solver writes one trajectory. With a model -o names a folder, which gets rollout.safetensors,
with --compare truth.safetensors, sheet.png (a contact sheet) and clip.gif; files of these names from
an earlier run are removed first.")]
pub(crate) struct RunArgs {
    /// A scene: a TOML file, a JSON file of ARCSim, or the name of a shipped one (`selvedge list
    /// scenes`).
    #[arg(default_value = "default")]
    pub(crate) scene: String,
    /// Run by this model: a file, or the name of a shipped one, `paper`.
    #[arg(long, value_name = "NAME|FILE")]
    pub(crate) model: Option<PathBuf>,
    /// The trajectory to write (.safetensors; with --rest also .obj), or with --model the folder
    /// [default: run.safetensors, or out].
    #[arg(short, long, value_name = "FILE|FOLDER")]
    pub(crate) output: Option<PathBuf>,
    /// Number of frames [default: as long as the scene's motion].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=MOST_FRAMES))]
    pub(crate) frames: Option<u32>,
    /// Also write the run in the format of another program, as its name ends: .usdc, .usdz,
    /// .abc, .glb, .pc2, .npz or .gif; repeat the option for several (`selvedge export` has more).
    #[arg(long, value_name = "FILE")]
    pub(crate) export: Vec<PathBuf>,
    /// Solver: find the sagged rest pose and write that alone.
    #[arg(long, conflicts_with_all = ["model", "frames", "export", "start", "states"])]
    pub(crate) rest: bool,
    /// Solver: another start than that of the scene: `rest`, the sagged rest pose; `mesh`, where
    /// the mesh is, as a flat sheet that falls; `untangle`, from there moved apart where it meets
    /// itself; `fit`, from there relaxed into the pattern, for garments that are strained
    /// there; or a saved state (.safetensors, .npz), FILE:N for
    /// that of frame N. A state has the arrays positions and velocities (or ckpt_x and ckpt_v),
    /// [vertices, 3], or [states, vertices, 3] with the frame of each in frames (or ckpt_frames).
    #[arg(long, value_name = "WHERE", conflicts_with = "model", value_parser = StartChoice::from_str)]
    pub(crate) start: Option<StartChoice>,
    /// Solver: also keep positions and velocities of every frame in double precision
    /// (.safetensors).
    #[arg(long, value_name = "FILE", conflicts_with = "model")]
    pub(crate) states: Option<PathBuf>,
    /// Model: also run the solver and compare with it.
    #[arg(long, requires = "model")]
    pub(crate) compare: bool,
    /// Model: correction of frames that no cloth could have: none, or limit, which brings edges back
    /// within bounds and lets the solver replace what is lost.
    #[arg(long, default_value = "limit", requires = "model")]
    pub(crate) guard: Correction,
    /// Model: write how far each frame can be trusted to this file (.csv): verdict, strains, energy,
    /// speed, correction.
    #[arg(long, value_name = "FILE", requires = "model")]
    pub(crate) trust: Option<PathBuf>,
    /// Model: do not make a clip.
    #[arg(long, requires = "model")]
    pub(crate) no_clip: bool,
    /// The machine of the model.
    #[command(flatten)]
    pub(crate) machine: DeviceArgs,
}

impl RunArgs {
    /// The folder of a model's run.
    pub(crate) fn folder(&self) -> &Path {
        self.output.as_deref().unwrap_or(Path::new("out"))
    }

    /// The trajectory of the solver.
    pub(crate) fn file(&self) -> &Path {
        self.output
            .as_deref()
            .unwrap_or(Path::new("run.safetensors"))
    }
}

/// The start of a run by the solver.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum StartChoice {
    /// The rest pose or the mesh, as scenes say it.
    Named(StartSpec),
    /// A saved state: its file, and its frame where one is named.
    State(PathBuf, Option<usize>),
}

impl StartChoice {
    /// The file of the saved state.
    pub(crate) fn file(&self) -> Option<&Path> {
        match self {
            Self::State(path, _) => Some(path),
            Self::Named(_) => None,
        }
    }
}

impl FromStr for StartChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "rest" => return Ok(Self::Named(StartSpec::Rest)),
            "mesh" => return Ok(Self::Named(StartSpec::Mesh)),
            "untangle" => return Ok(Self::Named(StartSpec::Untangle)),
            "fit" => return Ok(Self::Named(StartSpec::Fit)),
            _ => {}
        }
        let (file, frame) = match text.rsplit_once(':') {
            Some((file, frame)) if frame.parse::<usize>().is_ok() => (file, frame.parse().ok()),
            _ => (text, None),
        };
        if matches!(ending_of(Path::new(file)).as_str(), "safetensors" | "npz") {
            Ok(Self::State(file.into(), frame))
        } else {
            Err(
                "expected rest, mesh, untangle, fit, or a state (.safetensors, .npz), as states.safetensors:60"
                    .to_owned(),
            )
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn starts_are_named_or_files_with_a_frame() {
        let of = |text: &str| text.parse::<StartChoice>();
        assert_eq!(of("fit"), Ok(StartChoice::Named(StartSpec::Fit)));
        let state = |frame| Ok(StartChoice::State("a/s.npz".into(), frame));
        assert_eq!(of("a/s.npz"), state(None));
        assert_eq!(of("a/s.npz:60"), state(Some(60)));
        assert!(of("a/S.NPZ:60").is_ok());
        assert!(
            of("flat")
                .unwrap_err()
                .contains("rest, mesh, untangle, fit")
        );
    }
}
