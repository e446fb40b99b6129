//! The call of `selvedge data import`: what caches lack is said by options.

use std::path::PathBuf;

use clap::Args;
use selvedge_cloth::PhysicsSettings;
use selvedge_data::foreign::{FlatSource, HandleSource, ImportOptions, RestSource};

use super::export::UpName;

/// Make a data set from simulation caches of another program.
///
/// A folder has one file per trajectory: .usda, .usdc, .usdz, .glb, or .pc2, .npz with the mesh
/// beside it as .obj. What the data do not say must be said here. An interrupted import goes on when
/// it is started again. Data sets of other projects (DeepMind's flag_simple, the folders of the code
/// that came with MeshGraphNetRP) are read by the Python package, `selvedge.datasets`.
#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  selvedge data import shots --density 0.2 --frame-rate 60 --handles 0,19 -o data/shots
  selvedge data import shots --density 0.2 --frame-rate 60 --handles left,right -o data/shots

docs/src/guides/data.md says what caches lack, what is taken by default, and why.")]
pub(crate) struct ImportArgs {
    /// The folder of the data.
    pub(crate) source: PathBuf,
    /// The folder of the data set; it is made.
    #[arg(short, long, value_name = "FOLDER")]
    pub(crate) output: PathBuf,
    /// The name of the data set [default: that of the folder].
    #[arg(long)]
    pub(crate) name: Option<String>,
    /// Mass per area in kg/m².
    #[arg(long, value_name = "NUMBER")]
    pub(crate) density: f64,
    /// Frames per second at which frames are taken.
    #[arg(long, value_name = "NUMBER")]
    pub(crate) frame_rate: f64,
    /// The held vertices in the order of their targets, from 0, separated by commas; or the names of
    /// nodes that they go with.
    #[arg(long, value_name = "WHICH", value_parser = handles)]
    pub(crate) handles: HandleSource,
    /// The mesh that is the cloth, by name [default: the only one, or sheet].
    #[arg(long, value_name = "NAME")]
    pub(crate) object: Option<String>,
    /// The rest pose: flat, first-frame, or a mesh (.obj, y up).
    #[arg(long, value_name = "WHICH", default_value = "first-frame")]
    pub(crate) rest: String,
    /// A flat mesh of the same vertices (.obj) whose material coordinates are taken where the file has
    /// none; or shape: each face as the rest pose has it, for garments.
    #[arg(long, value_name = "WHICH")]
    pub(crate) flat: Option<PathBuf>,
    /// The axis that points up in files that do not say it.
    #[arg(long, value_enum, default_value_t = UpName::Y)]
    pub(crate) up: UpName,
    /// Trajectories to test on, separated by commas (without folders train and test).
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    pub(crate) test: Vec<String>,
    /// The largest strain of an edge that is taken for that of a cloth.
    #[arg(long, value_name = "NUMBER", default_value_t = PhysicsSettings::default().max_strain, value_parser = strain, allow_negative_numbers = true)]
    pub(crate) max_strain: f64,
}

fn handles(text: &str) -> Result<HandleSource, String> {
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    if parts.iter().any(|part| part.is_empty()) {
        return Err("expected numbers as 0,30, or names of nodes as left,right".to_owned());
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
    /// All that is said about the data.
    pub(crate) fn options(&self) -> ImportOptions {
        ImportOptions {
            name: self.name.clone(),
            density: self.density,
            frame_rate: self.frame_rate,
            handles: self.handles.clone(),
            object: self.object.clone(),
            rest: match self.rest.as_str() {
                "flat" => RestSource::Flat,
                "first-frame" => RestSource::FirstFrame,
                path => RestSource::Obj(PathBuf::from(path)),
            },
            flat: self.flat.clone().map(|flat| match flat.to_str() {
                Some("shape") => FlatSource::Shape,
                _ => FlatSource::Obj(flat),
            }),
            up: self.up.axis(),
            test: self.test.clone(),
        }
    }
}
