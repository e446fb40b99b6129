//! Options of an import, and their defaults from the data themselves.

use std::path::{Path, PathBuf};

use serde_json::{Value, json};

use crate::UpAxis;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::hash;
use crate::formats::input::read_file;

/// Source of the rest pose.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum RestSource {
    /// The material coordinates, hanging flat in the plane x = 0: a 2D rest state.
    Flat,
    /// The first frame.
    FirstFrame,
    /// The vertices of a mesh file (.obj), y up, in metres.
    Obj(PathBuf),
}

/// Source of the held vertices.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum HandleSource {
    /// These, numbered from 0, in the order of their targets.
    Vertices(Vec<u32>),
    /// Those that go with nodes of these names, node by node. Of caches with nodes (USD,
    /// .glb).
    Nodes(Vec<String>),
}

impl HandleSource {
    /// The source as the configuration names it.
    pub(super) fn describe(&self) -> Value {
        match self {
            Self::Vertices(numbers) => json!(numbers),
            Self::Nodes(names) => json!({ "nodes": names }),
        }
    }
}

/// Options of an import.
#[derive(Clone, Debug, PartialEq)]
pub struct ImportOptions {
    /// Name of the data set; else that of the folder.
    pub name: Option<String>,
    /// Mass per area `[kg/m²]`.
    pub density: f64,
    /// Frames per second at which frames are taken.
    pub frame_rate: f64,
    /// The held vertices.
    pub handles: HandleSource,
    /// Name of the mesh that is the cloth; by default the only one, or the one called `sheet`.
    pub object: Option<String>,
    /// The rest pose.
    pub rest: RestSource,
    /// A mesh file whose material coordinates are taken, where the file has none.
    pub flat: Option<PathBuf>,
    /// Axis that points up in files that do not say it.
    pub up: UpAxis,
    /// Trajectories to test on, by name, for caches that are not already in `train` and `test`.
    pub test: Vec<String>,
}

impl RestSource {
    /// The source as the configuration names it.
    pub(super) fn describe(&self) -> Result<Value, FileError<Problem>> {
        match self {
            Self::Flat => Ok(json!("flat")),
            Self::FirstFrame => Ok(json!("first-frame")),
            Self::Obj(path) => describe_file(path),
        }
    }
}

/// The file of an option as the configuration names it: with the hash of its bytes.
pub(super) fn describe_file(path: &Path) -> Result<Value, FileError<Problem>> {
    let bytes = read_file(path).map_err(FileError::unread(path))?;
    let name = path.file_name().unwrap_or_default().to_string_lossy();
    Ok(json!({ "file": name, "blake3": hash(&bytes) }))
}
