//! The trajectory file: one .safetensors, whose arrays, metadata and versions stand in
//! docs/src/reference/files.md. A reader of one version refuses the next by its number.
//!
//! Equal trajectories make equal bytes. Reading takes the whole file into memory (a run of the
//! paper is 15 MB) and checks all of it; tensors that are not listed there are an error, because
//! they would be lost when the file is written again.

use std::collections::{BTreeMap, HashMap};
use std::path::Path;

use glam::{Vec2, Vec3};
use selvedge_cloth::{Cloth, ClothArrays, Handles, NumberedPattern, Texture, Topology};
use serde_json::Value;

use crate::UpAxis;
use crate::formats::arrays::ArrayFile;
use crate::formats::atomic::WriteError;
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::read_file;
use crate::formats::tensor_file::{TensorOut, TensorValues, put_tensors, write_tensors};
use crate::trajectory::obstacle_file;
use crate::trajectory::{Provenance, Trajectory};

/// The format that a trajectory file names in its metadata.
pub const TRAJECTORY_FORMAT: &str = "selvedge-trajectory";
/// Version of a cloth without seams, of a sewn one, of a cloth with obstacles, and of any whose
/// texture is not its pattern. They are for readers of old; what a file has is told by its tensors.
const VERSION: &str = "1";
const SEWN_VERSION: &str = "2";
const OBSTACLE_VERSION: &str = "3";
const TEXTURE_VERSION: &str = "4";
/// The tensor that only a sewn cloth has.
const PATTERN_FACES: &str = "pattern_faces";
/// The tensors of a cloth whose texture is not its pattern: its points, none where it has none, and
/// those of its faces' corners, where a vertex has several.
const TEXTURE: &str = "texture_coordinates";
const TEXTURE_FACES: &str = "texture_faces";
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

impl Trajectory {
    /// Reads a trajectory file and checks all of it.
    ///
    /// # Errors
    /// [`FileError`] names the file, and what in it is missing or wrong.
    pub fn read(path: &Path) -> Result<Self, FileError<Problem>> {
        let bytes = read_file(path).map_err(FileError::unread(path))?;
        Self::from_bytes(&bytes).map_err(FileError::at(path))
    }

    /// Reads a trajectory from the bytes of its file.
    ///
    /// # Errors
    /// [`Problem`] names what is missing or wrong.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, Problem> {
        let (file, metadata) = ArrayFile::safetensors(bytes)?;
        let provenance = read_provenance(&metadata)?;
        let obstacles = obstacle_file::names_in(&metadata)?;
        let is_known = |name: &str| {
            TENSORS.contains(&name)
                || [PATTERN_FACES, TEXTURE, TEXTURE_FACES].contains(&name)
                || obstacle_file::is_tensor(name, obstacles.len())
        };
        if let Some(unknown) = file.names().into_iter().find(|name| !is_known(name)) {
            return Err(Problem(format!(
                "has a tensor named {unknown}, which this version does not know"
            )));
        }
        let (mut cloth, positions) = read_cloth(&file, UpAxis::Y)?;
        if file.has(TEXTURE) {
            cloth = cloth.with_texture(read_texture(&file)?)?;
        }
        let read = Self::new(cloth, positions, provenance)?;
        read.with_obstacles(obstacle_file::read(&file, &obstacles)?)
    }

    /// Reads a trajectory from the bytes of an exported archive (.npz); it has no scene.
    ///
    /// # Errors
    /// [`Problem`] names the array that is missing or wrong.
    pub fn from_npz(bytes: &[u8]) -> Result<Self, Problem> {
        let file = ArrayFile::npz(bytes)?;
        let up = file.up_axis()?;
        let (cloth, positions) = read_cloth(&file, up)?;
        let provenance = Provenance {
            frame_rate: file.floats("fps")?.single()?,
            scene: Value::Null,
            made_by: "an archive of NumPy's".to_owned(),
        };
        Self::new(cloth, positions, provenance)
    }

    /// Writes the trajectory file, all or nothing.
    ///
    /// # Errors
    /// [`WriteError`] names the file and what failed; what was there before still is.
    pub fn write(&self, path: &Path) -> Result<(), WriteError> {
        self.encode(|tensors, metadata| write_tensors(path, tensors, metadata))
    }

    /// The bytes of the trajectory file.
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut bytes = Vec::new();
        // A vector takes all that is written to it.
        let _ = self.encode(|tensors, metadata| put_tensors(&mut bytes, tensors, metadata));
        bytes
    }

    /// Gives the tensors and the metadata of the file to `put`.
    fn encode<R>(&self, put: impl FnOnce(&[TensorOut<'_>], &BTreeMap<&str, String>) -> R) -> R {
        let cloth = self.cloth();
        let shape = [self.frame_count(), self.vertex_count(), 3];
        let mut tensors = vec![TensorOut::new(TENSORS[0], &shape, flat3(self.positions()))];
        tensors.extend(cloth_tensors(cloth, cloth.rest_positions()));
        tensors.extend(texture_tensors(cloth.texture()));
        tensors.extend(obstacle_file::tensors(self.obstacles()));
        let version = match (self.obstacles().is_empty(), cloth.pattern().is_sewn()) {
            _ if *cloth.texture() != Texture::Pattern => TEXTURE_VERSION,
            (false, _) => OBSTACLE_VERSION,
            (true, true) => SEWN_VERSION,
            (true, false) => VERSION,
        };
        let mut metadata = self.provenance().metadata(TRAJECTORY_FORMAT, version);
        metadata.extend(obstacle_file::metadata(self.obstacles()));
        put(&tensors, &metadata)
    }
}

impl Provenance {
    /// The metadata of a file in this format.
    pub(super) fn metadata(&self, format: &str, version: &str) -> BTreeMap<&'static str, String> {
        BTreeMap::from([
            ("format", format.to_owned()),
            ("version", version.to_owned()),
            ("fps", self.frame_rate.to_string()),
            ("scene", self.scene.to_string()),
            ("made_by", self.made_by.clone()),
        ])
    }
}

fn read_provenance(metadata: &HashMap<String, String>) -> Result<Provenance, Problem> {
    let entry = |name| {
        let found = metadata.get(name).map(String::as_str);
        let none = || format!("is not a trajectory: its metadata has no entry named {name}");
        found.ok_or_else(|| Problem(none()))
    };
    let format = entry("format")?;
    if format != TRAJECTORY_FORMAT {
        return Err(wrong("format", TRAJECTORY_FORMAT, format));
    }
    let version = entry("version")?;
    if ![VERSION, SEWN_VERSION, OBSTACLE_VERSION, TEXTURE_VERSION].contains(&version) {
        let made_by = metadata
            .get("made_by")
            .map_or("another program", String::as_str);
        let found = format!("{version} (made by {made_by}, which reads it)");
        return Err(wrong("version", "1, 2, 3 or 4", &found));
    }
    let is_known = |name: &str| METADATA.contains(&name) || name == obstacle_file::METADATA;
    if let Some((name, value)) = metadata.iter().find(|(name, _)| !is_known(name)) {
        return Err(wrong(name, "no entry of this name", value));
    }
    let (fps, scene) = (entry("fps")?, entry("scene")?);
    let frame_rate = fps.parse();
    Ok(Provenance {
        frame_rate: frame_rate.map_err(|_| wrong("fps", "a number of frames per second", fps))?,
        scene: serde_json::from_str(scene).map_err(|_| wrong("scene", "JSON", scene))?,
        made_by: entry("made_by")?.to_owned(),
    })
}

/// The error that an entry of the metadata is not as `expected`.
pub(super) fn wrong(name: &str, expected: &str, found: &str) -> Problem {
    Problem(format!(
        "metadata {name}: expected {expected}, found {found:?}"
    ))
}

/// The cloth of a file whose world has this axis up, and its positions `[frames * vertices]`.
fn read_cloth(file: &ArrayFile<'_>, up: UpAxis) -> Result<(Cloth, Vec<Vec3>), Problem> {
    let is_sewn = file.has(PATTERN_FACES);
    let points = |values: &[f32]| {
        let ours = |p| up.to_ours(Vec3::from_slice(p).as_dvec3()).as_vec3();
        values.chunks_exact(3).map(ours).collect()
    };
    let positions = file.singles("positions")?;
    let positions = positions.of_shape(&[None, None, Some(3)])?;
    let vertices = positions.shape[1];
    let singles = |name: &str, shape: &[Option<usize>]| {
        Ok::<_, Problem>(file.singles(name)?.of_shape(shape)?.values)
    };
    let wholes = |name: &str, shape: &[Option<usize>]| {
        Ok::<_, Problem>(file.wholes(name)?.of_shape(shape)?.values)
    };
    let faces = triples(&wholes("faces", &[None, Some(3)])?);
    let rest = singles("rest_positions", &[Some(vertices), Some(3)])?;
    let coordinates = [(!is_sewn).then_some(vertices), Some(2)];
    let coordinates = singles("material_coordinates", &coordinates)?;
    let arrays = ClothArrays {
        rest_positions: points(&rest),
        material_coordinates: coordinates.chunks_exact(2).map(Vec2::from_slice).collect(),
        vertex_mass: singles("vertex_mass", &[Some(vertices)])?,
        face_area: singles("face_area", &[Some(faces.len())])?,
    };
    let handles = Handles::new(&wholes("handles", &[None])?, vertices)?;
    let topology = Topology::new(vertices, &faces)?;
    let cloth = if is_sewn {
        let corners = wholes(PATTERN_FACES, &[Some(faces.len()), Some(3)])?;
        Cloth::sewn(topology, handles, arrays, triples(&corners))?
    } else {
        Cloth::new(topology, handles, arrays)?
    };
    Ok((cloth, points(&positions.values)))
}

/// The texture coordinates of a file in which they are not those of the pattern.
fn read_texture(file: &ArrayFile<'_>) -> Result<Texture, Problem> {
    let points = file.singles(TEXTURE)?.of_shape(&[None, Some(2)])?.values;
    if points.is_empty() {
        return Ok(Texture::None);
    }
    let corners = if file.has(TEXTURE_FACES) {
        Some(
            file.wholes(TEXTURE_FACES)?
                .of_shape(&[None, Some(3)])?
                .values,
        )
    } else {
        None
    };
    Ok(Texture::Own(NumberedPattern {
        points: points.chunks_exact(2).map(Vec2::from_slice).collect(),
        corners: corners.map(|corners| triples(&corners)),
    }))
}

/// The tensors of texture coordinates that are not those of the pattern.
fn texture_tensors(texture: &Texture) -> Vec<TensorOut<'_>> {
    let (points, corners) = match texture {
        Texture::Pattern => return Vec::new(),
        Texture::None => (&[][..], None),
        Texture::Own(own) => (&own.points[..], own.corners.as_deref()),
    };
    let flat = points.iter().flat_map(|c| c.to_array()).collect();
    let points = TensorOut::new(TEXTURE, &[points.len(), 2], TensorValues::F32(flat));
    let corners = corners.map(|corners| {
        let flat = TensorValues::U32(corners.as_flattened().into());
        TensorOut::new(TEXTURE_FACES, &[corners.len(), 3], flat)
    });
    [Some(points), corners].into_iter().flatten().collect()
}

/// The tensors of a cloth, but its positions; its rest pose may be turned.
pub(crate) fn cloth_tensors<'a>(cloth: &'a Cloth, rest: &[Vec3]) -> Vec<TensorOut<'a>> {
    let (vertices, faces) = (cloth.vertex_count(), cloth.topology().faces().len());
    let (coordinates, pattern) = (cloth.material_coordinates(), cloth.pattern());
    let handles = cloth.handles().vertices();
    let corners = cloth.topology().face_indices().into_flattened();
    let flat = coordinates.iter().flat_map(|c| c.to_array()).collect();
    let values = [
        (&[faces, 3][..], TensorValues::U32(corners.into())),
        (&[vertices, 3], flat3(rest)),
        (&[coordinates.len(), 2], TensorValues::F32(flat)),
        (&[vertices], TensorValues::F32(cloth.vertex_mass().into())),
        (&[faces], TensorValues::F32(cloth.face_area().into())),
        (
            &[handles.len()],
            TensorValues::U32(handles.iter().map(|v| v.0).collect()),
        ),
    ];
    let named = TENSORS[1..].iter().zip(values);
    let tensors = named.map(|(name, (shape, values))| TensorOut::new(*name, shape, values));
    let mut tensors: Vec<TensorOut<'_>> = tensors.collect();
    if pattern.is_sewn() {
        let corners = TensorValues::U32(pattern.corners().into_flattened().into());
        tensors.push(TensorOut::new(PATTERN_FACES, &[faces, 3], corners));
    }
    tensors
}

fn triples(values: &[u32]) -> Vec<[u32; 3]> {
    values.as_chunks::<3>().0.to_vec()
}

/// The coordinates of points.
pub(super) fn flat3(points: &[Vec3]) -> TensorValues<'static> {
    TensorValues::F32(points.iter().flat_map(|p| p.to_array()).collect())
}
