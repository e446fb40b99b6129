//! The call of `selvedge export`, and the files that `--export` asks for.

use std::path::PathBuf;

use clap::builder::{PossibleValuesParser, TypedValueParser};
use clap::{Args, ValueEnum};
use selvedge_data::UpAxis;
use selvedge_data::export::FrameSpan;
use selvedge_view::{Rgb, View};

use super::word;
use crate::exporting::Choice;
use crate::film::Look;

/// Write a trajectory in the format of another program.
///
/// The format follows from the ending of the name: .usdc or .usdz (USD), .abc (Alembic),
/// .glb (glTF), .pc2 (a point cache, with the mesh beside it as .obj), .npz (NumPy), .gif,
/// or .obj and .png for one frame. With --format obj or
/// png the name is that of a new folder, which gets a file per frame. Lengths are metres; the first
/// exported frame is at time 0. Ctrl-C leaves nothing behind.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge export out/rollout.safetensors -o cloth.usdc
  selvedge export out/rollout.safetensors -o cloth.glb --frames 60..180 --every 2
  selvedge export out/rollout.safetensors -o frames --format png
  selvedge export out/rollout.safetensors -o cloth.gif --size 640x480 --camera 90,20 --colour 1f4e79

A .glb has a morph target per frame: long runs are lighter as .usdc or .pc2, or with --every.
docs/src/guides/export.md says how Blender, Houdini, Unreal and three.js open these files.")]
pub(crate) struct ExportArgs {
    /// The trajectory (.safetensors).
    pub(crate) trajectory: PathBuf,
    /// The file to write; with --format obj or png a folder, which must not exist or be empty.
    #[arg(short, long, value_name = "FILE|FOLDER")]
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
    #[arg(long, default_value = "y", value_parser = word::<UpAxis>([("y", "As in Selvedge"), ("z", "As in Blender")]))]
    up: UpAxis,
    /// A normal for each vertex and frame [default: yes for .glb, no for all others, whose readers
    /// make their own].
    #[arg(long, value_name = "YES|NO", value_parser = yes_or_no())]
    normals: Option<bool>,
    /// A velocity for each vertex and frame, in m/s, for motion blur [default: yes for .abc,
    /// .usdc and .usdz; all others have none].
    #[arg(long, value_name = "YES|NO", value_parser = yes_or_no())]
    velocities: Option<bool>,
    /// Width and height of a picture in pixels, as 1280x720 [default: 960x720; of a clip 320x320].
    #[arg(long, value_name = "WxH", value_parser = size)]
    size: Option<[u32; 2]>,
    /// The direction of the camera in degrees: around the vertical, and above the horizon
    /// [default: 142,14].
    #[arg(long, value_name = "AROUND,ABOVE", value_parser = view, allow_hyphen_values = true)]
    camera: Option<View>,
    /// The colour of the cloth, as "#1f4e79" [default: that of its fabric].
    #[arg(long, value_name = "#RRGGBB", value_parser = colour)]
    colour: Option<Rgb>,
}

fn yes_or_no() -> impl TypedValueParser<Value = bool> {
    PossibleValuesParser::new(["yes", "no"]).map(|answer| answer == "yes")
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides = text.split_once(['x', 'X']);
    let sides = sides.and_then(|(w, h)| Some([w.parse().ok()?, h.parse().ok()?]));
    sides
        .filter(|sides: &[u32; 2]| sides.iter().all(|side| (16..=8192).contains(side)))
        .ok_or_else(|| "write two numbers from 16 to 8192, as 1280x720".to_owned())
}

fn view(text: &str) -> Result<View, String> {
    let angles = text.split_once(',');
    let angles = angles.and_then(|(a, e)| Some((a.parse().ok()?, e.parse().ok()?)));
    let view = angles.map(|(azimuth, elevation)| View { azimuth, elevation });
    view.filter(|view| view.check().is_ok())
        .ok_or_else(|| "write two angles in degrees, as 90,20: -360 to 360, 0 to 80".to_owned())
}

fn colour(text: &str) -> Result<Rgb, String> {
    let digits = text.strip_prefix('#').unwrap_or(text);
    let parts = [0..2, 2..4, 4..6].map(|range| {
        let part = digits.get(range).filter(|_| digits.len() == 6)?;
        u8::from_str_radix(part, 16).ok()
    });
    match parts {
        [Some(r), Some(g), Some(b)] => Ok([r, g, b]),
        _ => Err("write six hexadecimal digits, as \"#1f4e79\"".to_owned()),
    }
}

/// A format to write.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatName {
    /// USD as a binary crate, with time samples.
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
}

impl ExportArgs {
    /// What was chosen.
    pub(crate) fn choice(&self) -> Choice {
        let of_pictures = [
            (self.size.is_some(), "--size"),
            (self.camera.is_some(), "--camera"),
            (self.colour.is_some(), "--colour"),
        ];
        Choice {
            frames: FrameSpan {
                every: self.every as usize,
                ..self.frames.unwrap_or_default()
            },
            up: self.up,
            normals: self.normals,
            velocities: self.velocities,
            look: Look {
                size: self.size,
                view: self.camera.unwrap_or_default(),
                colour: self.colour,
            },
            of_pictures: of_pictures
                .into_iter()
                .find(|given| given.0)
                .map(|given| given.1),
        }
    }
}
