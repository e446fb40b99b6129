//! Source of a mesh (the numbers of a generator, or a file with its hash) and its placement.

use std::path::Path;

use glam::{DQuat, DVec3};
use selvedge_cloth::generate::{GenerateError, Shape, Sheet, SheetSpec, sheet};
use selvedge_cloth::{Mesh, MeshError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::formats::hash::hash;
use crate::formats::obj::{
    ObjError, ObjOptions, ReadObjError, Seams, TextureUnit, parse_obj_bytes,
};

/// A mesh, resolved: the same spec makes the same mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshSpec {
    /// Source of the mesh.
    pub source: MeshSource,
    /// Placement of the mesh.
    pub transform: Transform,
}

/// Source of a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum MeshSource {
    /// Numbers.
    Generator(GeneratorSpec),
    /// A file.
    Obj {
        /// Path of the file, as the scene names it: relative to the scene's folder.
        path: String,
        /// BLAKE3 hash of its bytes, in hexadecimal.
        blake3: String,
        /// Treatment of vertices with two texture coordinates.
        #[serde(default, skip_serializing_if = "is_default")]
        seams: Seams,
        /// The unit of texture coordinates.
        #[serde(default, skip_serializing_if = "is_default")]
        texture: TextureUnit,
    },
}

/// The numbers of a generated mesh, which hangs flat; see [`sheet`]. A file may give a `density`
/// `[vertices/m²]` instead of `vertices`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "GeneratorFields")]
pub struct GeneratorSpec {
    /// Shape of the sheet.
    pub kind: Shape,
    /// Number of vertices.
    pub vertices: usize,
    /// The unit of length of the shape, as the side of a square `[m]`.
    pub size: f64,
    /// Decides where the inner vertices lie.
    pub seed: u64,
}

/// [`GeneratorSpec`] as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct GeneratorFields {
    kind: Shape,
    vertices: Option<usize>,
    density: Option<f64>,
    size: f64,
    seed: u64,
}

/// Keys that do not make a [`GeneratorSpec`].
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum GeneratorError {
    #[error("density must be finite and positive, found {density} vertices/m²")]
    Density { density: f64 },
    #[error("give `vertices` or `density`, not both")]
    Both,
    #[error("missing field: `vertices` or `density`")]
    Neither,
}

impl TryFrom<GeneratorFields> for GeneratorSpec {
    type Error = GeneratorError;

    fn try_from(fields: GeneratorFields) -> Result<Self, GeneratorError> {
        let GeneratorFields {
            kind, size, seed, ..
        } = fields;
        let vertices = match (fields.vertices, fields.density) {
            (Some(vertices), None) => vertices,
            (None, Some(density)) if density.is_finite() && density > 0.0 => {
                kind.vertices(size, density)
            }
            (None, Some(density)) => return Err(GeneratorError::Density { density }),
            (Some(_), Some(_)) => return Err(GeneratorError::Both),
            (None, None) => return Err(GeneratorError::Neither),
        };
        Ok(Self {
            kind,
            vertices,
            size,
            seed,
        })
    }
}

/// Placement of a mesh: scaled, then turned about the origin, then moved.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Transform {
    /// Multiplies positions and material coordinates, as 0.01 for a file in centimetres.
    pub scale: f64,
    /// Multiplies the material coordinates once more, as where texture coordinates run from 0 to 1
    /// over a sheet of another size.
    pub material_scale: f64,
    /// Turns the positions.
    pub rotation: Rotate,
    /// Moves the positions `[m]`.
    pub translation: DVec3,
}

/// A turn about an axis through the origin.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Rotate {
    /// The axis; need not have length one.
    pub axis: DVec3,
    /// Right-handed angle `[degrees]`.
    pub angle_deg: f64,
}

/// A mesh that cannot be made.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum MeshSpecError {
    #[error("mesh.generator: {0}")]
    Generate(#[from] GenerateError),
    #[error("mesh.obj: {0}")]
    Obj(#[from] ReadObjError),
    #[error(
        "mesh.obj: {path} has changed since the scene was resolved (hash {found}, expected {expected})"
    )]
    Changed {
        path: String,
        expected: String,
        found: String,
    },
    #[error("mesh.transform.{field} must be {expected}, found {found}")]
    Transform {
        field: &'static str,
        expected: &'static str,
        found: String,
    },
    #[error(
        "the edges of the mesh are on average {ratio:.3} × as long as in its material coordinates: these must be in metres too; set mesh.transform.material_scale, or mesh.texture = \"fit\" for an obj"
    )]
    Units { ratio: f64 },
    #[error("mesh: {0}")]
    Mesh(#[from] MeshError),
}

/// Start positions may be stretched or folded up a little against the material, not this much.
const LARGEST_RATIO: f64 = 3.0;

impl Default for Transform {
    fn default() -> Self {
        Self {
            scale: 1.0,
            material_scale: 1.0,
            rotation: Rotate {
                axis: DVec3::Y,
                angle_deg: 0.0,
            },
            translation: DVec3::ZERO,
        }
    }
}

impl MeshSource {
    /// The file at `path`, which is relative to `folder`, as it is now.
    ///
    /// # Errors
    /// [`MeshSpecError::Obj`] when it cannot be read.
    pub fn obj(path: &str, folder: &Path, options: ObjOptions) -> Result<Self, MeshSpecError> {
        Ok(Self::Obj {
            path: path.to_owned(),
            blake3: hash(&read(&folder.join(path))?),
            seams: options.seams,
            texture: options.texture,
        })
    }
}

impl MeshSpec {
    /// Makes the mesh; files are relative to `folder`.
    ///
    /// # Errors
    /// [`MeshSpecError`] names the field and what is wrong.
    pub fn build(&self, folder: &Path) -> Result<Sheet, MeshSpecError> {
        let sheet = match &self.source {
            MeshSource::Generator(numbers) => sheet(&SheetSpec {
                shape: numbers.kind,
                vertices: numbers.vertices,
                size: numbers.size,
                seed: numbers.seed,
            })?,
            MeshSource::Obj {
                path,
                blake3,
                seams,
                texture,
            } => {
                let (seams, texture) = (*seams, *texture);
                build_obj(path, blake3, folder, ObjOptions { seams, texture })?
            }
        };
        let sheet = self.transform.apply(sheet)?;
        check_units(&sheet.mesh)?;
        Ok(sheet)
    }
}

impl Transform {
    fn apply(&self, sheet: Sheet) -> Result<Sheet, MeshSpecError> {
        self.validate()?;
        if *self == Self::default() {
            return Ok(sheet);
        }
        let axis = self.rotation.axis.normalize();
        let turn = DQuat::from_axis_angle(axis, self.rotation.angle_deg.to_radians());
        let mesh = &sheet.mesh;
        let place = |p: &DVec3| turn * (self.scale * *p) + self.translation;
        let material = self.scale * self.material_scale;
        let coordinates = mesh.material_coordinates();
        Ok(Sheet {
            mesh: Mesh::new(
                &mesh.topology().face_indices(),
                coordinates.iter().map(|c| material * *c).collect(),
                mesh.positions().iter().map(place).collect(),
            )?,
            labels: sheet.labels,
        })
    }

    fn validate(&self) -> Result<(), MeshSpecError> {
        let error = |field, expected, found| MeshSpecError::Transform {
            field,
            expected,
            found,
        };
        for (field, value) in [
            ("scale", self.scale),
            ("material_scale", self.material_scale),
        ] {
            if !(value.is_finite() && value > 0.0) {
                return Err(error(field, "finite and positive", value.to_string()));
            }
        }
        let axis = self.rotation.axis;
        if axis.try_normalize().is_none() {
            return Err(error("rotation.axis", "a direction", axis.to_string()));
        }
        if !self.rotation.angle_deg.is_finite() {
            let found = self.rotation.angle_deg.to_string();
            return Err(error("rotation.angle_deg", "finite", found));
        }
        if !self.translation.is_finite() {
            return Err(error("translation", "finite", self.translation.to_string()));
        }
        Ok(())
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ReadObjError> {
    std::fs::read(path).map_err(|source| ReadObjError {
        path: path.to_owned(),
        source: ObjError::Read(source),
    })
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

fn build_obj(
    path: &str,
    expected: &str,
    folder: &Path,
    options: ObjOptions,
) -> Result<Sheet, MeshSpecError> {
    let full = folder.join(path);
    let bytes = read(&full)?;
    let found = hash(&bytes);
    if found != expected {
        return Err(MeshSpecError::Changed {
            path: path.to_owned(),
            expected: expected.to_owned(),
            found,
        });
    }
    parse_obj_bytes(&bytes, options)
        .map_err(|source| MeshSpecError::Obj(ReadObjError { path: full, source }))
}

fn check_units(mesh: &Mesh) -> Result<(), MeshSpecError> {
    let (mut length, mut material) = (0.0, 0.0);
    for edge in mesh.topology().edges() {
        let [a, b] = edge.vertices.map(|v| v.index());
        length += mesh.positions()[a].distance(mesh.positions()[b]);
        material += mesh.material_coordinates()[a].distance(mesh.material_coordinates()[b]);
    }
    let ratio: f64 = length / material;
    if (1.0 / LARGEST_RATIO..=LARGEST_RATIO).contains(&ratio) {
        Ok(())
    } else {
        Err(MeshSpecError::Units { ratio })
    }
}
