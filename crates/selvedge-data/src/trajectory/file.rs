//! The trajectory file: one .safetensors with `positions` f32 `[frames, vertices, 3]`, `faces` u32
//! `[faces, 3]`, `rest_positions` f32 `[vertices, 3]`, `material_coordinates` f32 `[points, 2]`,
//! `vertex_mass` f32 `[vertices]`, `face_area` f32 `[faces]` and `handles` u32 `[handles]`, and the
//! metadata `format` = "selvedge-trajectory", `version`, `fps`, `scene` (JSON) and `made_by`.
//!
//! Version 1 is a cloth without seams, with one point per vertex. Version 2 is a sewn one: its
//! `pattern_faces` u32 `[faces, 3]` are the points of the faces' corners, point v is one of vertex
//! v's, and every point has one vertex. Version 3 has obstacles (`trajectory/obstacle_file.rs`),
//! and may have `pattern_faces`. A reader of one version refuses the next by its number.
//!
//! Equal trajectories make equal bytes. Reading takes the whole file into memory (a run of the
//! paper is 15 MB) and checks all of it; tensors that are not listed here are an error, because
//! they would be lost when the file is written again.

use std::collections::{BTreeMap, HashMap};
use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3};
use safetensors::tensor::{Dtype, Metadata};
use safetensors::{SafeTensorError, SafeTensors};
use selvedge_cloth::{
    Cloth, ClothArrays, ClothError, HandleError, Handles, Topology, TopologyError,
};
use thiserror::Error;

use crate::formats::atomic::WriteError;
use crate::formats::input::read_file;
use crate::formats::tensor_file::{
    TensorOut, TensorValues, put_tensors, read_header, write_tensors,
};
use crate::trajectory::obstacle_file::{self, ObstacleTensors};
use crate::trajectory::{Provenance, Trajectory, TrajectoryError};

const FORMAT: &str = "selvedge-trajectory";
/// Version of a cloth without seams, of a sewn one, and of a cloth with obstacles.
const VERSION: &str = "1";
const SEWN_VERSION: &str = "2";
const OBSTACLE_VERSION: &str = "3";
/// The tensor that only a sewn cloth has.
const PATTERN_FACES: &str = "pattern_faces";
const METADATA: [&str; 5] = ["format", "version", "fps", "scene", "made_by"];
const TENSORS: [&str; 7] = [
    "positions",
    "faces",
    "rest_positions",
    "material_coordinates",
    "vertex_mass",
    "face_area",
    "handles",
];

/// A trajectory that could not be read from a file.
#[derive(Debug, Error)]
#[error("{}: {source}", path.display())]
pub struct ReadTrajectoryError {
    /// The file.
    pub path: PathBuf,
    /// The problem.
    #[source]
    pub source: TrajectoryFileError,
}

/// Bytes that are not a trajectory.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum TrajectoryFileError {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error(
        "is no complete safetensors file ({0}): it may have been cut short, or be another format"
    )]
    Container(#[source] SafeTensorError),
    #[error("is not a trajectory: its metadata has no entry named {name}")]
    MissingMetadata { name: &'static str },
    #[error("metadata {name}: expected {expected}, found {found:?}")]
    Metadata {
        name: String,
        expected: &'static str,
        found: String,
    },
    #[error("has no tensor named {name} (found {found})")]
    MissingTensor { name: &'static str, found: String },
    #[error("has a tensor named {name}, which this version does not know")]
    UnknownTensor { name: String },
    #[error("tensor {name}: expected {expected}, found {found}")]
    Tensor {
        name: &'static str,
        expected: String,
        found: String,
    },
    #[error("tensor {name}: expected {expected}, found {found}")]
    ObstacleTensor {
        name: String,
        expected: String,
        found: String,
    },
    #[error(transparent)]
    Topology(#[from] TopologyError),
    #[error(transparent)]
    Handles(#[from] HandleError),
    #[error(transparent)]
    Cloth(#[from] ClothError),
    #[error(transparent)]
    Content(#[from] TrajectoryError),
}

impl Trajectory {
    /// Reads a trajectory file and checks all of it.
    ///
    /// # Errors
    /// [`ReadTrajectoryError`] names the file, and what in it is missing or wrong.
    pub fn read(path: &Path) -> Result<Self, ReadTrajectoryError> {
        read_file(path)
            .map_err(TrajectoryFileError::Read)
            .and_then(|bytes| Self::from_bytes(&bytes))
            .map_err(|source| ReadTrajectoryError {
                path: path.to_owned(),
                source,
            })
    }

    /// Reads a trajectory from the bytes of its file.
    ///
    /// # Errors
    /// [`TrajectoryFileError`] names what is missing or wrong.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TrajectoryFileError> {
        let header = read_header(bytes).map_err(TrajectoryFileError::Container)?;
        let (provenance, version) = read_provenance(&header)?;
        let file = SafeTensors::deserialize(bytes).map_err(TrajectoryFileError::Container)?;
        let names = obstacle_file::names_in(&header)?;
        if names.is_empty() == (version == Version::Obstacles) {
            return Err(TrajectoryFileError::Metadata {
                name: "version".to_owned(),
                expected: "3 for a file with obstacles, and for no other",
                found: format!("{} obstacles", names.len()),
            });
        }
        let has_pattern = file.names().contains(&PATTERN_FACES);
        let is_sewn = version == Version::Sewn || version == Version::Obstacles && has_pattern;
        let is_known = |name: &&str| {
            TENSORS.contains(name)
                || is_sewn && *name == PATTERN_FACES
                || obstacle_file::is_tensor(name, names.len())
        };
        if let Some(unknown) = file.names().iter().find(|name| !is_known(name)) {
            return Err(TrajectoryFileError::UnknownTensor {
                name: (*unknown).to_owned(),
            });
        }
        let (positions, frame_shape) = read_tensor(&file, "positions", &[None, None, Some(3)])?;
        let vertices = frame_shape[1];
        let cloth = read_cloth(&file, vertices, is_sewn)?;
        let read = Self::new(cloth, vec3s(&floats(positions)), provenance)?;
        Ok(read.with_obstacles(obstacle_file::read(&file, &names)?)?)
    }

    /// Writes the trajectory file, all or nothing.
    ///
    /// # Errors
    /// [`WriteError`] names the file and what failed; what was there before still is.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        self.encode(|tensors, metadata| write_tensors(path, tensors, metadata))
    }

    /// The bytes of the trajectory file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        // A vector takes all that is written to it.
        let _ = self.encode(|tensors, metadata| put_tensors(&mut bytes, tensors, metadata));
        bytes
    }

    /// Gives the tensors and the metadata of the file to `put`.
    fn encode<R>(&self, put: impl FnOnce(&[TensorOut<'_>], &BTreeMap<&str, String>) -> R) -> R {
        let cloth = self.cloth();
        let (vertices, faces) = (self.vertex_count(), cloth.topology().faces().len());
        let positions = flat3(self.positions());
        let face_indices = cloth.topology().face_indices();
        let rest_positions = flat3(cloth.rest_positions());
        let coordinates: Vec<f32> = cloth
            .material_coordinates()
            .iter()
            .flat_map(|c| c.to_array())
            .collect();
        let handles: Vec<u32> = cloth.handles().vertices().iter().map(|v| v.0).collect();
        let values = [
            TensorValues::F32(&positions),
            TensorValues::U32(face_indices.as_flattened()),
            TensorValues::F32(&rest_positions),
            TensorValues::F32(&coordinates),
            TensorValues::F32(cloth.vertex_mass()),
            TensorValues::F32(cloth.face_area()),
            TensorValues::U32(&handles),
        ];
        let shapes = [
            vec![self.frame_count(), vertices, 3],
            vec![faces, 3],
            vec![vertices, 3],
            vec![cloth.material_coordinates().len(), 2],
            vec![vertices],
            vec![faces],
            vec![handles.len()],
        ];
        let mut tensors: Vec<TensorOut<'_>> = TENSORS
            .into_iter()
            .zip(shapes)
            .zip(values)
            .map(|((name, shape), values)| TensorOut {
                name,
                shape,
                values,
            })
            .collect();
        let pattern = cloth.pattern();
        let corners = pattern.corners();
        if pattern.is_sewn() {
            tensors.push(TensorOut {
                name: PATTERN_FACES,
                shape: vec![faces, 3],
                values: TensorValues::U32(corners.as_flattened()),
            });
        }
        let obstacles = ObstacleTensors::of(self.obstacles());
        tensors.extend(obstacles.tensors());
        let version = match (self.obstacles().is_empty(), pattern.is_sewn()) {
            (false, _) => OBSTACLE_VERSION,
            (true, true) => SEWN_VERSION,
            (true, false) => VERSION,
        };
        let mut metadata = metadata(self.provenance(), version);
        metadata.extend(obstacles.metadata());
        put(&tensors, &metadata)
    }
}

fn metadata(provenance: &Provenance, version: &str) -> BTreeMap<&'static str, String> {
    BTreeMap::from([
        ("format", FORMAT.to_owned()),
        ("version", version.to_owned()),
        ("fps", provenance.frame_rate.to_string()),
        ("scene", provenance.scene.to_string()),
        ("made_by", provenance.made_by.clone()),
    ])
}

/// Versions of the file.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Version {
    Plain,
    Sewn,
    Obstacles,
}

/// The provenance, and the version of the file.
fn read_provenance(header: &Metadata) -> Result<(Provenance, Version), TrajectoryFileError> {
    let empty = HashMap::new();
    let metadata = header.metadata().as_ref().unwrap_or(&empty);
    let entry = |name| {
        metadata
            .get(name)
            .ok_or(TrajectoryFileError::MissingMetadata { name })
    };
    let wrong = |name: &str, expected, found: &str| TrajectoryFileError::Metadata {
        name: name.to_owned(),
        expected,
        found: found.to_owned(),
    };
    let format = entry("format")?;
    if format != FORMAT {
        return Err(wrong("format", FORMAT, format));
    }
    let version = entry("version")?;
    let version = match version.as_str() {
        VERSION => Version::Plain,
        SEWN_VERSION => Version::Sewn,
        OBSTACLE_VERSION => Version::Obstacles,
        other => return Err(wrong("version", "1, 2 or 3", other)),
    };
    if let Some((name, value)) = metadata
        .iter()
        .find(|(n, _)| !METADATA.contains(&n.as_str()) && *n != obstacle_file::METADATA)
    {
        return Err(wrong(name, "no entry of this name", value));
    }
    let fps = entry("fps")?;
    let scene = entry("scene")?;
    let provenance = Provenance {
        frame_rate: fps
            .parse()
            .map_err(|_| wrong("fps", "a number of frames per second", fps))?,
        scene: serde_json::from_str(scene).map_err(|_| wrong("scene", "JSON", scene))?,
        made_by: entry("made_by")?.clone(),
    };
    Ok((provenance, version))
}

fn read_cloth(
    file: &SafeTensors<'_>,
    vertices: usize,
    is_sewn: bool,
) -> Result<Cloth, TrajectoryFileError> {
    let (faces, _) = read_tensor(file, "faces", &[None, Some(3)])?;
    let (rest, _) = read_tensor(file, "rest_positions", &[Some(vertices), Some(3)])?;
    let coordinates = &[(!is_sewn).then_some(vertices), Some(2)];
    let (coordinates, _) = read_tensor(file, "material_coordinates", coordinates)?;
    let (mass, _) = read_tensor(file, "vertex_mass", &[Some(vertices)])?;
    let (handles, _) = read_tensor(file, "handles", &[None])?;
    let faces = triples(&integers(faces));
    let (area, _) = read_tensor(file, "face_area", &[Some(faces.len())])?;
    let arrays = ClothArrays {
        rest_positions: vec3s(&floats(rest)),
        material_coordinates: floats(coordinates)
            .chunks_exact(2)
            .map(Vec2::from_slice)
            .collect(),
        vertex_mass: floats(mass),
        face_area: floats(area),
    };
    let handles = Handles::new(&integers(handles), vertices)?;
    let topology = Topology::new(vertices, &faces)?;
    if !is_sewn {
        return Ok(Cloth::new(topology, handles, arrays)?);
    }
    let (corners, _) = read_tensor(file, PATTERN_FACES, &[Some(faces.len()), Some(3)])?;
    let corners = triples(&integers(corners));
    Ok(Cloth::sewn(topology, handles, arrays, corners)?)
}

fn triples(values: &[u32]) -> Vec<[u32; 3]> {
    let (triples, _) = values.as_chunks::<3>();
    triples.to_vec()
}

/// The bytes of tensor `name` and its shape, which must agree with `shape` where that is `Some`.
fn read_tensor<'f>(
    file: &SafeTensors<'f>,
    name: &'static str,
    shape: &[Option<usize>],
) -> Result<(&'f [u8], Vec<usize>), TrajectoryFileError> {
    let Ok(tensor) = file.tensor(name) else {
        let mut found = file.names();
        found.sort_unstable();
        return Err(TrajectoryFileError::MissingTensor {
            name,
            found: found.join(", "),
        });
    };
    let dtype = match name {
        "faces" | "handles" | PATTERN_FACES => Dtype::U32,
        _ => Dtype::F32,
    };
    let fits = tensor.shape().len() == shape.len()
        && shape
            .iter()
            .zip(tensor.shape())
            .all(|(expected, found)| expected.is_none_or(|expected| expected == *found));
    if !fits || tensor.dtype() != dtype {
        let dimensions: Vec<String> = shape
            .iter()
            .map(|d| d.map_or_else(|| "any".to_owned(), |d| d.to_string()))
            .collect();
        return Err(TrajectoryFileError::Tensor {
            name,
            expected: format!("{dtype} [{}]", dimensions.join(", ")),
            found: format!("{} {:?}", tensor.dtype(), tensor.shape()),
        });
    }
    Ok((tensor.data(), tensor.shape().to_vec()))
}

fn floats(bytes: &[u8]) -> Vec<f32> {
    let (words, _) = bytes.as_chunks::<4>();
    words.iter().copied().map(f32::from_le_bytes).collect()
}

fn integers(bytes: &[u8]) -> Vec<u32> {
    let (words, _) = bytes.as_chunks::<4>();
    words.iter().copied().map(u32::from_le_bytes).collect()
}

fn vec3s(values: &[f32]) -> Vec<Vec3> {
    values.chunks_exact(3).map(Vec3::from_slice).collect()
}

fn flat3(values: &[Vec3]) -> Vec<f32> {
    values.iter().flat_map(|p| p.to_array()).collect()
}
