//! The call of `selvedge dataset import`: many options, because foreign data lack many things.

use std::path::PathBuf;

use clap::{Args, ValueEnum};
use selvedge_cloth::PhysicsSettings;
use selvedge_data::UpAxis;
use selvedge_data::foreign::{ForeignFormat, HandleSource, ImportOptions, Purpose, RestSource};

/// Make a data set from data of another project.
///
/// flag-simple is DeepMind's folder of meta.json and TFRecord files; released is the folder of the
/// code that came with MeshGraphNetRP, one folder of .npy files per trajectory; cache is a folder
/// of simulation caches of other programs, one file per trajectory (.abc, .usda, .usdc, .usdz,
/// .glb, or .pc2, .mdd, .npz with the mesh beside it as .obj). What the data do not say must be
/// said here; what they say themselves must not. An interrupted import goes on when it is started
/// again.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge dataset import flag-simple flag_simple --density 0.15 --limit 20 --out data/flag
  selvedge dataset import released runs --handles 0,30 --test test1,test2 --out data/released
  selvedge dataset import cache shots --density 0.2 --frame-rate 60 --handles 0,19 --out data/shots
  selvedge dataset import cache shots --density 0.2 --frame-rate 60 --handles found --out data/shots

docs/src/guides/data.md says what each format lacks, what is taken by default, and why.")]
pub(crate) struct ImportArgs {
    /// The format of the data.
    #[arg(value_enum)]
    pub(crate) format: FormatName,
    /// The folder of the data.
    pub(crate) source: PathBuf,
    /// The folder of the data set; it is made.
    #[arg(long, value_name = "FOLDER")]
    pub(crate) out: PathBuf,
    /// The name of the data set [default: that of the folder].
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Mass per area in kg/m² (flag-simple, cache: required).
    #[arg(long, value_name = "NUMBER")]
    pub(crate) density: Option<f64>,
    /// Frames per second [default for released: 1/dt of meta.json, or 60; cache:
    /// required, frames are taken at this rate].
    #[arg(long, value_name = "NUMBER")]
    pub(crate) frame_rate: Option<f64>,
    /// The held vertices in the order of their targets, from 0, separated by commas (released,
    /// cache: required). Of a cache also `found`, those that stand still or keep their distances
    /// from each other in all frames, or the names of nodes that they go with.
    #[arg(long, value_name = "WHICH", value_parser = handles)]
    pub(crate) handles: Option<HandleSource>,
    /// The mesh that is the cloth, by name [default for cache: the only one, or sheet].
    #[arg(long, value_name = "NAME")]
    pub(crate) object: Option<String>,
    /// The rest pose: flat, first-frame, or a mesh (.obj, y up) [default for flag-simple: flat, for
    /// cache: first-frame].
    #[arg(long, value_name = "WHICH")]
    pub(crate) rest: Option<String>,
    /// A mesh (.obj) whose material coordinates are taken (released, where rest.obj has none;
    /// cache, where the file has none).
    #[arg(long, value_name = "FILE")]
    pub(crate) flat: Option<PathBuf>,
    /// The axis that points up [default: z for flag-simple, y for released and for caches that
    /// do not say it].
    #[arg(long, value_enum)]
    pub(crate) up: Option<UpName>,
    /// At most so many trajectories of each split.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) limit: Option<u32>,
    /// Trajectories to test on, separated by commas (released and cache, without folders train
    /// and test).
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) test: Vec<String>,
    /// The largest strain of an edge that is taken for that of a cloth.
    #[arg(long, value_name = "NUMBER", default_value_t = PhysicsSettings::default().max_strain, value_parser = strain, allow_negative_numbers = true)]
    pub(crate) max_strain: f64,
    /// Import only what is to be tested on; without this, nothing to train on is an error.
    #[arg(long)]
    pub(crate) test_only: bool,
}

/// A format of another project.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum FormatName {
    /// DeepMind's flag_simple: meta.json and TFRecord.
    FlagSimple,
    /// The released code of MeshGraphNetRP: folders of .npy.
    Released,
    /// Caches of other programs: Alembic, USD, glTF, point caches.
    Cache,
}

/// An axis that points up.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum UpName {
    /// As in Selvedge.
    Y,
    /// As in ARCSim and Blender.
    Z,
}

fn handles(text: &str) -> Result<HandleSource, String> {
    if text == "found" {
        return Ok(HandleSource::Found);
    }
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    if parts.iter().any(|part| part.is_empty()) {
        return Err("expected numbers as 0,30, names of nodes as left,right, or found".to_owned());
    }
    let numbers: Result<Vec<u32>, _> = parts.iter().map(|part| part.parse()).collect();
    if let Ok(numbers) = numbers {
        return Ok(HandleSource::Vertices(numbers));
    }
    if parts.iter().any(|part| part.parse::<f64>().is_ok()) {
        return Err("expected whole numbers from 0, or names of nodes, not both".to_owned());
    }
    let names = parts.into_iter().map(str::to_owned);
    Ok(HandleSource::Nodes(names.collect()))
}

fn strain(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(strain) if strain > 0.0 && strain.is_finite() => Ok(strain),
        _ => Err("expected a number above 0, as 1 for an edge of twice its length".to_owned()),
    }
}

impl ImportArgs {
    /// The format, as the data crate calls it.
    pub(crate) fn format(&self) -> ForeignFormat {
        match self.format {
            FormatName::FlagSimple => ForeignFormat::FlagSimple,
            FormatName::Released => ForeignFormat::Released,
            FormatName::Cache => ForeignFormat::Cache,
        }
    }

    /// All that is said about the data.
    pub(crate) fn options(&self) -> ImportOptions {
        ImportOptions {
            name: self.name.clone(),
            density: self.density,
            frame_rate: self.frame_rate,
            handles: self.handles.clone(),
            object: self.object.clone(),
            rest: self.rest.as_deref().map(|rest| match rest {
                "flat" => RestSource::Flat,
                "first-frame" => RestSource::FirstFrame,
                path => RestSource::Obj(PathBuf::from(path)),
            }),
            flat: self.flat.clone(),
            up: self.up.map(|up| match up {
                UpName::Y => UpAxis::Y,
                UpName::Z => UpAxis::Z,
            }),
            limit: self.limit.map(|limit| limit as usize),
            purpose: match self.test_only {
                true => Purpose::Testing,
                false => Purpose::Training,
            },
            test: self.test.clone(),
        }
    }
}
