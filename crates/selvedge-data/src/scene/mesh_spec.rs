//! Source of a mesh (the numbers of a generator, or a file with its hash) and its placement.

use std::path::Path;

use glam::{DQuat, DVec3};
use selvedge_cloth::generate::{GenerateError, Shape, Sheet, SheetSpec, sheet};
use selvedge_cloth::geometry;
use selvedge_cloth::{LoosePanels, Mesh, MeshError};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::strained::Times;
use crate::formats::extent::{extent, unit_remedy};
use crate::formats::file_error::FileError;
use crate::formats::input::read_file;
use crate::formats::input::{check_hash, hash};
use crate::formats::mesh_file::parse_mesh_bytes;
use crate::formats::polygons::{
    MeshFileError, MeshOptions, PatternSource, ReadMesh, ReadMeshError, RestAngles, Sewing,
    TextureUnit,
};
use crate::obstacle::Placement;

/// A mesh, resolved: the same spec makes the same mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeshSpec {
    /// Source of the mesh.
    pub source: MeshSource,
    /// Placement of the mesh.
    pub transform: Transform,
    /// Angles at which hinges rest; none for those of the start where there is no pattern, and flat
    /// where there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rest_angles: Option<RestAngles>,
    /// Objects that are taken, panels that are placed, and seams that are sewn, before the mesh is
    /// made.
    #[serde(default, skip_serializing_if = "Sewing::is_empty")]
    pub sewing: Sewing,
    /// Bending stiffness of seams in units of the cloth's own.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seam_stiffness: Option<f64>,
}

/// A mesh that has been made.
#[derive(Clone, Debug, PartialEq)]
pub struct BuiltMesh {
    /// The mesh and its labels.
    pub sheet: Sheet,
    /// Velocities of the vertices, where its file has them `[m/s]`, `[vertices]`.
    pub velocities: Option<Vec<DVec3>>,
    /// The panels before they are sewn, where seams were named.
    pub loose: Option<LoosePanels>,
    /// True where each face rests as it stands in space: there is no pattern.
    pub is_own_shape: bool,
    /// Warnings of what was mended or passed over in its file.
    pub warnings: Vec<String>,
}

/// Source of a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum MeshSource {
    /// Numbers.
    Generator(GeneratorSpec),
    /// A file.
    Obj(ObjSource),
}

/// A mesh in a file, and how it is read.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ObjSource {
    /// Path of the file, as the scene names it: relative to the scene's folder.
    pub path: String,
    /// BLAKE3 hash of its bytes, in hexadecimal.
    pub blake3: String,
    /// Choices for reading it.
    #[serde(flatten)]
    pub options: MeshOptions,
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
    /// The unit of length of the shape, as the side of a square or the height of a rectangle `[m]`.
    pub size: f64,
    /// Width of a rectangle, or the way around a tube `[m]`; none for other shapes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub width: Option<f64>,
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
    width: Option<f64>,
    seed: u64,
}

impl TryFrom<GeneratorFields> for GeneratorSpec {
    type Error = String;

    fn try_from(fields: GeneratorFields) -> Result<Self, String> {
        let GeneratorFields {
            kind,
            size,
            width,
            seed,
            ..
        } = fields;
        match (kind, width) {
            (Shape::Rectangle | Shape::Tube, None) => {
                return Err("missing field: `width`, in m; `size` is the height".to_owned());
            }
            (Shape::Rectangle | Shape::Tube, Some(_)) | (_, None) => (),
            (_, Some(_)) => return Err("`width` is for a rectangle or a tube".to_owned()),
        }
        let vertices = match (fields.vertices, fields.density) {
            (Some(vertices), None) => vertices,
            (None, Some(density)) if density.is_finite() && density > 0.0 => {
                // Of a rectangle as high as it is wide, and as large.
                let side = width.map_or(size, |width| (size * width).sqrt());
                kind.vertices(side, density)
            }
            (None, Some(density)) => {
                return Err(format!(
                    "density must be finite and positive, found {density} vertices/m²"
                ));
            }
            (Some(_), Some(_)) => return Err("give `vertices` or `density`, not both".to_owned()),
            (None, None) => return Err("missing field: `vertices` or `density`".to_owned()),
        };
        Ok(Self {
            kind,
            vertices,
            size,
            width,
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
#[allow(missing_docs, reason = "each message says all")]
pub enum MeshSpecError {
    #[error("mesh.generator: {0}")]
    Generate(#[from] GenerateError),
    #[error("mesh.obj: {0}")]
    Obj(#[from] ReadMeshError),
    #[error("{0}")]
    Content(String),
    #[error("mesh: {0}")]
    Mesh(#[from] MeshError),
}

/// Start positions may be stretched or folded up a little against the material, not this much.
const LARGEST_RATIO: f64 = 3.0;

/// Length of a person's cloth `[m]`; others are warned of.
const SIZES: std::ops::RangeInclusive<f64> = 0.01..=20.0;

/// A warning of a cloth at `positions` `[m]` that is hardly a person's.
#[must_use]
pub fn size_warning(positions: &[DVec3]) -> Option<String> {
    let size = extent(positions);
    let bound = match size {
        _ if SIZES.contains(&size) => return None,
        0.0..1.0 => "less than 1 cm",
        _ => "more than 20 m",
    };
    let remedy = unit_remedy(size, "mesh.transform.scale");
    Some(format!(
        "mesh: the cloth is {size:.4} m long, {bound}: {remedy}, with its pattern"
    ))
}

impl Default for Transform {
    fn default() -> Self {
        Self {
            scale: 1.0,
            material_scale: 1.0,
            rotation: Rotate::default(),
            translation: DVec3::ZERO,
        }
    }
}

impl Default for Rotate {
    fn default() -> Self {
        Self {
            axis: DVec3::Y,
            angle_deg: 0.0,
        }
    }
}

impl MeshSource {
    /// The file at `path`, which is relative to `folder`, as it is now.
    ///
    /// # Errors
    /// [`MeshSpecError::Obj`] when it cannot be read.
    pub fn obj(path: &str, folder: &Path, options: MeshOptions) -> Result<Self, MeshSpecError> {
        Ok(Self::Obj(ObjSource {
            path: path.to_owned(),
            blake3: hash(&read(&folder.join(path))?),
            options,
        }))
    }
}

impl From<GeneratorSpec> for MeshSpec {
    /// The mesh as it is generated: where it hangs, and with its seams whole.
    fn from(generator: GeneratorSpec) -> Self {
        Self {
            source: MeshSource::Generator(generator),
            transform: Transform::default(),
            rest_angles: None,
            sewing: Sewing::default(),
            seam_stiffness: None,
        }
    }
}

impl MeshSpec {
    /// Makes the mesh; files are relative to `folder`.
    ///
    /// # Errors
    /// [`MeshSpecError`] names the field and what is wrong.
    pub fn build(&self, folder: &Path) -> Result<Sheet, MeshSpecError> {
        Ok(self.read(folder)?.sheet)
    }

    /// Makes the mesh with all that its file says of it; files are relative to `folder`.
    ///
    /// # Errors
    /// As for [`Self::build`].
    pub fn read(&self, folder: &Path) -> Result<BuiltMesh, MeshSpecError> {
        let read = self.source.read(folder, &self.sewing)?;
        let mut sheet = self.transform.apply(read.sheet)?;
        let own = read.is_own_shape && !read.has_rest_angles;
        let angles = self.rest_angles.or(own.then_some(RestAngles::Start));
        sheet.mesh = match angles {
            None => sheet.mesh,
            Some(RestAngles::Start) => sheet.mesh.with_rest_angles_of_start(),
            Some(RestAngles::Flat) => {
                let edges = sheet.mesh.topology().edges().len();
                sheet.mesh.with_rest_angles(vec![0.0; edges])?
            }
        };
        if let Some(factor) = self.seam_stiffness {
            if read.is_own_shape {
                let problem = "mesh.seam_stiffness is for cloth with a pattern, which has seams; this mesh has none: leave it out";
                return Err(MeshSpecError::Content(problem.to_owned()));
            }
            sheet.mesh = sheet.mesh.with_seam_stiffness(factor)?;
        }
        let loose = read.loose;
        let loose = loose.map(|loose| loose.moved(|p| self.transform.place(p)));
        match &loose {
            // Panels that are to be sewn may be far from each other.
            Some(loose) => self.check_units(&loose.mesh(&sheet.mesh)?)?,
            None => self.check_units(&sheet.mesh)?,
        }
        let mut warnings = read.warnings;
        warnings.extend(size_warning(sheet.mesh.positions()));
        let turn = self.transform.rotation.turn();
        let velocities = read.velocities.map(|velocities| {
            let turned = |v: DVec3| turn * (self.transform.scale * v);
            velocities.into_iter().map(turned).collect()
        });
        Ok(BuiltMesh {
            sheet,
            velocities,
            loose,
            is_own_shape: read.is_own_shape,
            warnings,
        })
    }

    /// The remedy for material coordinates that do not fit the positions: of what is not chosen yet.
    pub(super) fn remedy(&self) -> String {
        let by = self.transform.material_scale;
        if by != 1.0 {
            return format!(
                "mesh.transform.scale scales the pattern too, and material_scale, {by}, scales it once more: leave material_scale out, or set another"
            );
        }
        let MeshSource::Obj(ObjSource { options, .. }) = &self.source else {
            return "set mesh.transform.material_scale".to_owned();
        };
        match (options.pattern, options.texture) {
            (PatternSource::Shape, _) => "set mesh.transform.material_scale",
            (PatternSource::Texture, TextureUnit::Fit) => {
                "take the rest shape from the form in space with mesh.pattern = \"shape\""
            }
            (PatternSource::Texture, TextureUnit::Metres) => {
                "where they are made for pictures take the rest shape from the form in space with mesh.pattern = \"shape\"; where they are a pattern in another unit stretch it with mesh.texture = \"fit\" or mesh.transform.material_scale"
            }
        }
        .to_owned()
    }

    fn check_units(&self, mesh: &Mesh) -> Result<(), MeshSpecError> {
        let (mut length, mut material) = (0.0, 0.0);
        let lengths = mesh.pattern().edge_lengths();
        for (edge, rest) in mesh.topology().edges().iter().zip(lengths) {
            let [a, b] = edge.vertices.map(|v| v.index());
            length += mesh.positions()[a].distance(mesh.positions()[b]);
            material += rest;
        }
        let ratio: f64 = length / material;
        if (1.0 / LARGEST_RATIO..=LARGEST_RATIO).contains(&ratio) {
            return Ok(());
        }
        Err(MeshSpecError::Content(format!(
            "the edges of the mesh are on average {} as long as in its material coordinates: these must be in metres too; {}",
            Times(ratio),
            self.remedy()
        )))
    }
}

impl MeshSource {
    fn read(&self, folder: &Path, sewing: &Sewing) -> Result<ReadMesh, MeshSpecError> {
        let sheet = match self {
            Self::Generator(numbers) => sheet(&SheetSpec {
                shape: numbers.kind,
                vertices: numbers.vertices,
                size: numbers.size,
                width: numbers.width.unwrap_or(numbers.size),
                seed: numbers.seed,
            })?,
            Self::Obj(file) => {
                let bytes = unchanged(&file.path, &file.blake3, folder)?;
                let full = folder.join(&file.path);
                let read = parse_mesh_bytes(&full, &bytes, file.options, sewing);
                return Ok(read.map_err(FileError::at(&full))?);
            }
        };
        Ok(ReadMesh {
            sheet,
            velocities: None,
            has_rest_angles: false,
            loose: None,
            is_own_shape: false,
            warnings: Vec::new(),
        })
    }
}

impl Transform {
    fn apply(&self, sheet: Sheet) -> Result<Sheet, MeshSpecError> {
        self.validate()?;
        if *self == Self::default() {
            return Ok(sheet);
        }
        let positions = sheet.mesh.positions().iter();
        let positions = positions.map(|p| self.place(*p)).collect();
        let mesh = sheet.mesh.with_positions(positions)?;
        Ok(Sheet {
            mesh: mesh.with_pattern_scaled(self.scale * self.material_scale)?,
            labels: sheet.labels,
        })
    }

    fn place(&self, position: DVec3) -> DVec3 {
        self.placement().place(position)
    }

    fn placement(&self) -> Placement {
        Placement {
            scale: self.scale,
            rotation: self.rotation,
            translation: self.translation,
        }
    }

    fn validate(&self) -> Result<(), MeshSpecError> {
        let scaled = Placement {
            scale: self.material_scale,
            ..Placement::default()
        };
        let own = self.placement().check();
        let scaled = scaled
            .check()
            .map_err(|(_, must, found)| ("material_scale", must, found));
        let checked = own.and(scaled);
        checked.map_err(|(field, expected, found)| {
            let problem = format!("mesh.transform.{field} must be {expected}, found {found}");
            MeshSpecError::Content(problem)
        })
    }
}

impl Rotate {
    /// The turn; the axis must be a direction.
    pub(crate) fn turn(&self) -> DQuat {
        geometry::turn(self.axis.normalize(), self.angle_deg.to_radians())
    }
}

fn read(path: &Path) -> Result<Vec<u8>, ReadMeshError> {
    let bytes = read_file(path).map_err(MeshFileError::Read);
    bytes.map_err(FileError::at(path))
}

/// The bytes of a file, which must have this hash.
fn unchanged(path: &str, expected: &str, folder: &Path) -> Result<Vec<u8>, MeshSpecError> {
    let bytes = read(&folder.join(path))?;
    let checked = check_hash(path, expected, &hash(&bytes));
    checked.map_err(|problem| MeshSpecError::Content(format!("mesh.obj: {problem}")))?;
    Ok(bytes)
}
