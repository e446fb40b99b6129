//! The call of `selvedge export`, and the files that `--export` asks for.

use std::path::PathBuf;

use clap::builder::BoolishValueParser;
use clap::{Args, ValueEnum};
use selvedge_data::UpAxis;
use selvedge_data::export::FrameSpan;

/// Write a trajectory in the format of another program.
///
/// The format follows from the ending of the name: .usda, .usdc or .usdz (USD), .abc (Alembic),
/// .glb (glTF), .pc2 (a point cache, with the mesh beside it as .obj), .npz (NumPy), .gif,
/// .mp4 (by ffmpeg, where that is installed), or .obj and .png for one frame. With --format obj or
/// png the name is that of a new folder, which gets a file per frame. Lengths are metres; the first
/// exported frame is at time 0. Ctrl-C leaves nothing behind.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge export out/rollout.safetensors -o cloth.usda
  selvedge export out/rollout.safetensors -o cloth.glb --frames 60..180 --every 2
  selvedge export out/rollout.safetensors -o cloth.pc2 --up z
  selvedge export out/rollout.safetensors -o cloth.abc
  selvedge export out/rollout.safetensors -o frames --format png

A .glb has a morph target per frame: long runs are lighter as .usda or .pc2, or with --every.
docs/src/guides/export.md says how Blender, Houdini, Unreal and three.js open these files.")]
pub(crate) struct ExportArgs {
    /// The trajectory (.safetensors).
    pub(crate) trajectory: PathBuf,
    /// The file to write; with --format obj or png a folder, which must not exist or be empty.
    #[arg(short, long, alias = "to", value_name = "FILE|FOLDER")]
    pub(crate) output: PathBuf,
    /// The format [default: as the name ends].
    #[arg(long, value_enum)]
    pub(crate) format: Option<FormatName>,
    /// Frames, from 0: 20..80 (both included), 20.., ..80 or 20 [default: all].
    #[arg(long, value_name = "A..B", allow_hyphen_values = true)]
    frames: Option<FrameSpan>,
    /// Only every Nth of these frames; the motion keeps its speed.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..))]
    every: u32,
    /// The axis that points up in the file: z turns the cloth by a quarter about x, as Blender has
    /// it. A USD file names its axis; glTF is always y.
    #[arg(long, value_enum, default_value_t = UpName::Y)]
    up: UpName,
    /// A normal for each vertex and frame [default: yes for .glb, no for all others, whose readers
    /// make their own].
    #[arg(long, value_name = "YES|NO", num_args = 0..=1, default_missing_value = "yes", value_parser = BoolishValueParser::new())]
    normals: Option<bool>,
    /// A velocity for each vertex and frame, in m/s, for motion blur [default: yes for .abc,
    /// .usdc and .usdz, no for .usda; all others have none].
    #[arg(long, value_name = "YES|NO", num_args = 0..=1, default_missing_value = "yes", value_parser = BoolishValueParser::new())]
    velocities: Option<bool>,
}

/// A format to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatName {
    /// USD as text, with time samples.
    Usda,
    /// USD as a binary crate.
    Usdc,
    /// USD as an archive of one crate.
    Usdz,
    /// glTF in one file, with morph targets.
    Glb,
    /// A point cache with its mesh (.obj).
    Pc2,
    /// Alembic, with samples.
    Abc,
    /// A folder of meshes, or one mesh (.obj).
    Obj,
    /// Arrays for NumPy.
    Npz,
    /// A folder of pictures, or one picture (.png).
    Png,
    /// A clip, in real time at 20 pictures per second.
    Gif,
    /// A film, by ffmpeg.
    Mp4,
}

impl FormatName {
    /// The format of a file that ends so.
    pub(crate) fn of_extension(extension: &str) -> Option<Self> {
        <Self as ValueEnum>::from_str(extension, false).ok()
    }
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum UpName {
    /// As in Selvedge.
    Y,
    /// As in Blender.
    Z,
}

impl UpName {
    pub(crate) fn axis(self) -> UpAxis {
        match self {
            Self::Y => UpAxis::Y,
            Self::Z => UpAxis::Z,
        }
    }
}

impl ExportArgs {
    /// The frames that are asked for.
    pub(crate) fn frames(&self) -> FrameSpan {
        FrameSpan {
            every: self.every as usize,
            ..self.frames.unwrap_or_default()
        }
    }

    /// The axis that points up.
    pub(crate) fn up(&self) -> UpAxis {
        self.up.axis()
    }

    /// The choice of normals, where there was one.
    pub(crate) fn normals(&self) -> Option<bool> {
        self.normals
    }

    /// The choice of velocities, where there was one.
    pub(crate) fn velocities(&self) -> Option<bool> {
        self.velocities
    }
}
