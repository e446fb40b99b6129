//! A setting as people write it in a scene or in a preset of data sets: mesh, handles, material and
//! air.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::generate::SheetSpec;
use selvedge_cloth::{ContactSettings, DEFAULT_FRAME_RATE, Environment, SagSettings};
use serde::Deserialize;
use serde::de::Error;
use toml::Value;

use super::handle_selection::{Groups, HandleSelection, Selected};
use super::material_source::MaterialSource;
use super::mesh_spec::{MeshSource, MeshSpec, Transform};
use super::motion_source::MotionSource;
use super::physics_file::PhysicsFile;
use super::problem::field;
use super::spec::{Setting, StartFile};
use crate::formats::file_error::Problem;
use crate::formats::polygons::{
    MeshOptions, PanelPlace, PatternSource, ReadMesh, RestAngles, SeamPair, Seams, Sewing,
    TextureUnit,
};
use crate::obstacle::{ObstacleFile, ObstacleSpec};

/// A scene as people write it; a data set's preset has one without name, motion and start.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SettingFile {
    pub(crate) name: Option<String>,
    pub(crate) motion: Option<MotionSource>,
    pub(crate) start: Option<StartFile>,
    pub(crate) dress: Option<String>,
    mesh: MeshFile,
    /// None: the cloth is free.
    handles: Option<HandleSelection>,
    material: MaterialSource,
    #[serde(default)]
    fabrics: BTreeMap<String, MaterialSource>,
    #[serde(default)]
    seams: Vec<SeamPair>,
    #[serde(default)]
    environment: Environment,
    #[serde(default)]
    physics: PhysicsFile,
    #[serde(default)]
    sag: SagSettings,
    #[serde(default = "default_frame_rate")]
    frame_rate: f64,
    contact: Option<ContactFile>,
    #[serde(default)]
    obstacles: Vec<ObstacleFile>,
}

/// Contact as people write it.
#[derive(Deserialize)]
#[serde(try_from = "Value")]
enum ContactFile {
    Choice(bool),
    /// Settings, and the keys that are written.
    Settings(ContactSettings, Vec<String>),
}

impl TryFrom<Value> for ContactFile {
    type Error = toml::de::Error;

    fn try_from(written: Value) -> Result<Self, toml::de::Error> {
        match written {
            Value::Boolean(choice) => Ok(Self::Choice(choice)),
            Value::Table(table) => {
                let keys = table.keys().cloned().collect();
                Ok(Self::Settings(table.try_into()?, keys))
            }
            _ => Err(Error::custom(
                "expected a table of contact's keys, or false",
            )),
        }
    }
}

fn default_frame_rate() -> f64 {
    DEFAULT_FRAME_RATE
}

/// A mesh in the file's own words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct MeshFile {
    generator: Option<SheetSpec>,
    #[serde(alias = "obj")]
    file: Option<String>,
    seams: Option<Seams>,
    texture: Option<TextureUnit>,
    pattern: Option<PatternSource>,
    thread: Option<DVec3>,
    weld: Option<f64>,
    rest_angles: Option<RestAngles>,
    seam_stiffness: Option<f64>,
    #[serde(default)]
    objects: Vec<String>,
    #[serde(default)]
    panels: Vec<PanelPlace>,
    #[serde(default)]
    transform: Transform,
}

/// A setting that has been looked up, with its mesh.
pub(crate) struct ResolvedSetting {
    pub(crate) setting: Setting,
    pub(crate) read: ReadMesh,
    /// Groups of the handles.
    pub(crate) groups: Groups,
    /// True if the file says nothing of contact.
    pub(crate) leaves_contact_open: bool,
}

impl SettingFile {
    /// Looks up what is named, and builds the mesh. The files of the materials are added to
    /// `files`: what is resolved does not name them.
    pub(crate) fn resolve(
        self,
        folder: &Path,
        files: &mut Vec<PathBuf>,
    ) -> Result<ResolvedSetting, Problem> {
        let mut mesh = self.mesh.resolve(folder)?;
        mesh.sewing.seams = self.seams;
        if !mesh.sewing.is_empty() && matches!(mesh.source, MeshSource::Generator(_)) {
            let problem = "mesh.objects and mesh.panels are for a mesh from a file";
            return Err(field("seams", problem));
        }
        let mut read = mesh.read(folder)?;
        let leaves_contact_open = self.contact.is_none();
        let contact = match self.contact {
            Some(written) => written.resolve(&mut read)?,
            None => None,
        };
        let fabrics = self.fabrics.into_iter();
        let fabrics = fabrics.map(|(name, source)| Ok((name, source.resolve(folder, files)?)));
        let fabrics = fabrics.collect::<Result<_, Problem>>()?;
        let Selected {
            vertices,
            groups,
            schedule,
        } = match self.handles {
            Some(handles) => handles.select(&read.sheet)?,
            None => Selected::default(),
        };
        let setting = Setting {
            handles: vertices,
            schedule,
            mesh,
            material: self.material.resolve(folder, files)?,
            fabrics,
            environment: self.environment,
            physics: self.physics.0,
            sag: self.sag,
            frame_rate: self.frame_rate,
            contact,
            obstacles: resolved_obstacles(self.obstacles, folder)?,
        };
        Ok(ResolvedSetting {
            setting,
            read,
            groups,
            leaves_contact_open,
        })
    }
}

impl ContactFile {
    /// The settings for this mesh, which hears of what is hardly meant.
    fn resolve(self, read: &mut ReadMesh) -> Result<Option<ContactSettings>, Problem> {
        let (mut settings, keys) = match self {
            Self::Choice(false) => return Ok(None),
            Self::Choice(true) => {
                let problem = "write contact = {} for the usual contact";
                return Err(field("contact", problem));
            }
            Self::Settings(settings, keys) => (settings, keys),
        };
        let is_said = |key: &str| keys.iter().any(|written| written == key);
        if !is_said("thickness") {
            settings.thickness = usual_contact(read).thickness;
        }
        if !is_said("floor") {
            settings.floor = ContactSettings::of_thickness(settings.thickness).floor;
        }
        Ok(Some(settings))
    }
}

/// Thickness of contact that is worth a warning `[m]`.
const THIN: f64 = 2e-4;

/// The usual contact for a mesh; warns where a short edge makes it thin.
pub(crate) fn usual_contact(read: &mut ReadMesh) -> ContactSettings {
    let mesh = &read.sheet.mesh;
    let lengths = mesh.pattern().edge_lengths();
    let edges = mesh.topology().edges().iter().zip(lengths);
    let shortest = edges.min_by(|a, b| a.1.total_cmp(&b.1));
    let Some((edge, length)) = shortest else {
        return ContactSettings::default();
    };
    let contact = ContactSettings::for_edges(length);
    if contact.thickness < THIN {
        let [a, b] = edge.vertices;
        read.warnings.push(format!(
            "contact.thickness is {:.1e} m, a fifth of the shortest edge, {length:.1e} m from vertex {a} to {b}: merge such vertices (mesh.weld), or choose the thickness",
            contact.thickness
        ));
    }
    contact
}

/// Obstacles with names of their own.
pub(crate) fn resolved_obstacles(
    files: Vec<ObstacleFile>,
    folder: &Path,
) -> Result<Vec<ObstacleSpec>, Problem> {
    let mut made: Vec<ObstacleSpec> = Vec::with_capacity(files.len());
    for file in files {
        let spec = file.resolve(folder)?;
        if made.iter().any(|other| other.name == spec.name) {
            let problem = format!("two are called {:?}: rename one", spec.name);
            return Err(field("obstacles.name", problem));
        }
        made.push(spec);
    }
    Ok(made)
}

impl MeshFile {
    /// Looks for a mesh file from `folder`.
    pub(crate) fn resolve(self, folder: &Path) -> Result<MeshSpec, Problem> {
        let options = MeshOptions {
            seams: self.seams.unwrap_or_default(),
            texture: self.texture.unwrap_or_default(),
            pattern: self.pattern.unwrap_or_default(),
            thread: self.thread,
            weld: self.weld,
        };
        let choices = (self.seams, self.texture, self.pattern);
        let for_files = choices != (None, None, None) || (self.thread, self.weld) != (None, None);
        let source = match (self.generator, self.file) {
            (Some(_), None) if for_files => {
                let problem = "seams, texture, pattern, thread and weld are for a mesh from a file";
                return Err(field("mesh", problem));
            }
            (Some(generator), None) => MeshSource::Generator(generator),
            (None, Some(path)) => MeshSource::obj(&path, folder, options)?,
            (None, None) => return Err(field("mesh", "needs a generator or a file")),
            (Some(_), Some(_)) => {
                return Err(field("mesh", "has both a generator and a file: keep one"));
            }
        };
        Ok(MeshSpec {
            source,
            transform: self.transform,
            rest_angles: self.rest_angles,
            seam_stiffness: self.seam_stiffness,
            sewing: Sewing {
                objects: self.objects,
                panels: self.panels,
                seams: Vec::new(),
            },
        })
    }
}
