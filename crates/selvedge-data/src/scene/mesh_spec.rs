//! Source of a mesh (the numbers of a generator, or a file with its hash) and its placement.

use std::path::Path;

use glam::{DQuat, DVec3};
use selvedge_cloth::generate::{Sheet, SheetSpec, sheet};
use selvedge_cloth::{Mesh, geometry};
use serde::{Deserialize, Serialize};

use super::problem::field;
use super::strained::Times;
use crate::formats::extent::{extent, unit_remedy};
use crate::formats::file_error::{FileError, Problem};
use crate::formats::input::{check_hash, hash, read_file};
use crate::formats::mesh_file::parse_mesh_bytes;
use crate::formats::polygons::{
    MeshOptions, PatternSource, ReadMesh, RestAngles, Sewing, TextureUnit,
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

/// Source of a mesh.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum MeshSource {
    /// Numbers.
    Generator(SheetSpec),
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

/// Start positions may be stretched or folded up a little against the material, not this much.
const LARGEST_RATIO: f64 = 3.0;

/// Length of a person's cloth `[m]`; others are warned of.
const SIZES: std::ops::RangeInclusive<f64> = 0.01..=20.0;

/// A warning of a cloth at `positions` `[m]` that is hardly a person's.
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
    /// When it cannot be read.
    pub fn obj(path: &str, folder: &Path, options: MeshOptions) -> Result<Self, Problem> {
        Ok(Self::Obj(ObjSource {
            path: path.to_owned(),
            blake3: hash(&read(&folder.join(path))?),
            options,
        }))
    }
}

impl From<SheetSpec> for MeshSpec {
    /// The mesh as it is generated: where it hangs, and with its seams whole.
    fn from(generator: SheetSpec) -> Self {
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
    /// [`Problem`] names the field and what is wrong.
    pub fn build(&self, folder: &Path) -> Result<Sheet, Problem> {
        Ok(self.read(folder)?.sheet)
    }

    /// Makes the mesh with all that its file says of it; files are relative to `folder`.
    ///
    /// # Errors
    /// As for [`Self::build`].
    pub fn read(&self, folder: &Path) -> Result<ReadMesh, Problem> {
        let mut read = self.source.read(folder, &self.sewing)?;
        let mut mesh = self.transform.apply(read.sheet.mesh)?;
        let own = read.is_own_shape && !read.has_rest_angles;
        mesh = match self.rest_angles.or(own.then_some(RestAngles::Start)) {
            None => mesh,
            Some(RestAngles::Start) => mesh.with_rest_angles_of_start(),
            Some(RestAngles::Flat) => {
                let edges = mesh.topology().edges().len();
                mesh.with_rest_angles(vec![0.0; edges])?
            }
        };
        if let Some(factor) = self.seam_stiffness {
            if read.is_own_shape {
                let problem = "is for cloth with a pattern, which has seams; this mesh has none: leave it out";
                return Err(Problem(format!("mesh.seam_stiffness {problem}")));
            }
            mesh = mesh.with_seam_stiffness(factor)?;
        }
        let place = |p| self.transform.placement().place(p);
        read.loose = read.loose.map(|loose| loose.moved(place));
        match &read.loose {
            // Panels that are to be sewn may be far from each other.
            Some(loose) => self.check_units(&loose.mesh(&mesh)?)?,
            None => self.check_units(&mesh)?,
        }
        read.warnings.extend(size_warning(mesh.positions()));
        let (turn, scale) = (self.transform.rotation.turn(), self.transform.scale);
        for velocity in read.velocities.iter_mut().flatten() {
            *velocity = turn * (scale * *velocity);
        }
        read.sheet.mesh = mesh;
        Ok(read)
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
            (PatternSource::Texture, TextureUnit::Metres) => super::strained::PICTURES,
        }
        .to_owned()
    }

    fn check_units(&self, mesh: &Mesh) -> Result<(), Problem> {
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
        Err(Problem(format!(
            "the edges of the mesh are on average {} as long as in its material coordinates: these must be in metres too; {}",
            Times(ratio),
            self.remedy()
        )))
    }
}

impl MeshSource {
    fn read(&self, folder: &Path, sewing: &Sewing) -> Result<ReadMesh, Problem> {
        match self {
            Self::Generator(numbers) => {
                let sheet = sheet(numbers).map_err(|error| field("mesh.generator", error))?;
                Ok(ReadMesh {
                    sheet,
                    velocities: None,
                    has_rest_angles: false,
                    loose: None,
                    is_own_shape: false,
                    warnings: Vec::new(),
                })
            }
            Self::Obj(file) => {
                let full = folder.join(&file.path);
                let bytes = read(&full)?;
                check_hash(&file.path, &file.blake3, &hash(&bytes))
                    .map_err(|problem| field("mesh.obj", problem))?;
                let read = parse_mesh_bytes(&full, &bytes, file.options, sewing);
                let read = read.map_err(FileError::at(&full));
                read.map_err(|error| field("mesh.obj", error))
            }
        }
    }
}

impl Transform {
    fn apply(&self, mesh: Mesh) -> Result<Mesh, Problem> {
        self.validate()?;
        if *self == Self::default() {
            return Ok(mesh);
        }
        let placement = self.placement();
        let positions = mesh.positions().iter().map(|p| placement.place(*p));
        let positions = positions.collect();
        let mesh = mesh.with_positions(positions)?;
        Ok(mesh.with_pattern_scaled(self.scale * self.material_scale)?)
    }

    fn placement(&self) -> Placement {
        Placement {
            scale: self.scale,
            rotation: self.rotation,
            translation: self.translation,
        }
    }

    fn validate(&self) -> Result<(), Problem> {
        let of_material = Placement {
            scale: self.material_scale,
            ..Placement::default()
        };
        for (placement, prefix) in [(self.placement(), ""), (of_material, "material_")] {
            placement.check().map_err(|(key, must, found)| {
                Problem(format!(
                    "mesh.transform.{prefix}{key} must be {must}, found {found}"
                ))
            })?;
        }
        Ok(())
    }
}

impl Rotate {
    /// The turn; the axis must be a direction.
    pub(crate) fn turn(&self) -> DQuat {
        geometry::turn(self.axis.normalize(), self.angle_deg.to_radians())
    }
}

fn read(path: &Path) -> Result<Vec<u8>, Problem> {
    let bytes = read_file(path).map_err(FileError::unread(path));
    bytes.map_err(|error| field("mesh.obj", error))
}
