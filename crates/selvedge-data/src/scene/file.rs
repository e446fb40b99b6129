//! Scenes as people write them: TOML, in which an unknown key is an error, and everything that is
//! named (a mesh, a material, a motion) is looked up and checked at once.
//!
//! ```toml
//! name = "a corner let go"
//! material = "gray-interlock"            # a shipped one, or a TOML file
//! mesh = { generator = { kind = "square", vertices = 289, size = 1.0, seed = 1 } }
//! handles = { label = "upper-corners" }  # or vertices = [..], or box = { min = [..], max = [..] }
//! motion = { named = "forward" }         # or inline, file = "x.toml", recorded = "x.csv"
//! ```
//!
//! `environment`, `physics`, `sag` and `frame_rate` (60) have defaults. A mesh may be
//! `{ obj = "x.obj", transform = { .. } }`. Paths are relative to the scene's folder.

use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::generate::Sheet;
use selvedge_cloth::{Environment, Material, Mesh, PhysicsSettings, SagSettings, Scene};
use serde::Deserialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

use super::mesh_spec::{GeneratorSpec, MeshSource, MeshSpec, MeshSpecError, Transform};
use super::motion_source::MotionSource;
use super::shipped::{material_text, materials, shipped_scene_text, shipped_scenes};
use super::spec::{SceneSpec, SceneSpecError, Setting};

/// A scene, and the spec that it came from.
#[derive(Clone, Debug, PartialEq)]
pub struct LoadedScene {
    /// Resolved: what results carry.
    pub spec: SceneSpec,
    /// Built: what is run.
    pub scene: Scene,
}

/// A scene that cannot be used.
#[derive(Debug, Error)]
#[error("{origin}: {problem}")]
pub struct SceneFileError {
    /// The file, or the name of a shipped scene.
    pub origin: String,
    /// What is wrong with it.
    #[source]
    pub problem: SceneProblem,
}

/// What is wrong with a scene.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum SceneProblem {
    #[error("could not be read: {0}")]
    Read(#[source] std::io::Error),
    #[error("is neither a file nor a shipped {what}; shipped are {known}")]
    Unknown { what: &'static str, known: String },
    #[error("{}", .0.to_string().trim_end())]
    Toml(#[source] Box<toml::de::Error>),
    #[error("{field}: {problem}")]
    Field {
        field: &'static str,
        problem: String,
    },
    #[error(transparent)]
    Mesh(#[from] MeshSpecError),
    #[error(transparent)]
    Spec(#[from] SceneSpecError),
}

/// Which vertices are held: exactly one way to say so.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum HandleSelection {
    /// By number, from 0; the order is that of the handles.
    Vertices(Vec<u32>),
    /// By the label of a generated mesh, or the name of an object or group of an OBJ.
    Label(String),
    /// All start positions in a box, its faces included, by number.
    Box {
        /// Smallest x, y and z `[m]`.
        min: DVec3,
        /// Largest x, y and z `[m]`.
        max: DVec3,
    },
}

/// The file's own words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    name: String,
    mesh: MeshFile,
    handles: HandleSelection,
    material: String,
    motion: MotionSource,
    #[serde(default)]
    environment: Environment,
    #[serde(default)]
    physics: PhysicsSettings,
    #[serde(default)]
    sag: SagSettings,
    #[serde(default = "sixty")]
    frame_rate: f64,
}

/// All of a scene but name and motion, as a data set's preset has it.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(crate) struct SettingFile {
    mesh: MeshFile,
    handles: HandleSelection,
    material: String,
    #[serde(default)]
    environment: Environment,
    #[serde(default)]
    physics: PhysicsSettings,
    #[serde(default)]
    sag: SagSettings,
    #[serde(default = "sixty")]
    frame_rate: f64,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MeshFile {
    generator: Option<GeneratorSpec>,
    obj: Option<String>,
    #[serde(default)]
    transform: Transform,
}

fn sixty() -> f64 {
    60.0
}

/// Opens a scene by the path of its file or by the name of a shipped one.
///
/// # Errors
/// [`SceneFileError`] names the scene, the field and what is wrong.
pub fn open_scene(path_or_name: &str) -> Result<LoadedScene, SceneFileError> {
    let path = Path::new(path_or_name);
    match shipped_scene_text(path_or_name) {
        Some(text) => parse_scene(text, Path::new(""), path_or_name),
        None if path.exists() => read_scene(path),
        None => {
            let known: Vec<&str> = shipped_scenes().iter().map(|scene| scene.0).collect();
            Err(SceneFileError {
                origin: path_or_name.to_owned(),
                problem: SceneProblem::Unknown {
                    what: "scene",
                    known: known.join(", "),
                },
            })
        }
    }
}

/// Reads a scene file.
///
/// # Errors
/// [`SceneFileError`] names the file, the field and what is wrong.
pub fn read_scene(path: &Path) -> Result<LoadedScene, SceneFileError> {
    let origin = path.display().to_string();
    let text = read_text(path).map_err(|problem| SceneFileError {
        origin: origin.clone(),
        problem,
    })?;
    let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
    parse_scene(&text, &folder, &origin)
}

/// Reads a scene from the text of its file; paths in it are relative to `folder`, and errors
/// begin with `origin`.
///
/// # Errors
/// [`SceneFileError`] names the origin, the field and what is wrong.
pub fn parse_scene(text: &str, folder: &Path, origin: &str) -> Result<LoadedScene, SceneFileError> {
    resolve(text, folder).map_err(|problem| SceneFileError {
        origin: origin.to_owned(),
        problem,
    })
}

fn resolve(text: &str, folder: &Path) -> Result<LoadedScene, SceneProblem> {
    let file: SceneFile = parse_toml(text)?;
    let motion = file.motion.resolve(folder)?;
    let setting = SettingFile {
        mesh: file.mesh,
        handles: file.handles,
        material: file.material,
        environment: file.environment,
        physics: file.physics,
        sag: file.sag,
        frame_rate: file.frame_rate,
    };
    let (setting, mesh) = setting.resolve(folder)?;
    let spec = SceneSpec {
        name: file.name,
        setting,
        motion,
    };
    let scene = spec.with_mesh(mesh)?;
    Ok(LoadedScene { spec, scene })
}

impl SettingFile {
    /// Looks up what is named, and builds the mesh.
    pub(crate) fn resolve(self, folder: &Path) -> Result<(Setting, Mesh), SceneProblem> {
        let mesh = self.mesh.resolve(folder)?;
        let sheet = mesh.build(folder)?;
        let setting = Setting {
            handles: self.handles.select(&sheet)?,
            mesh,
            material: material(&self.material, folder)?,
            environment: self.environment,
            physics: self.physics,
            sag: self.sag,
            frame_rate: self.frame_rate,
        };
        Ok((setting, sheet.mesh))
    }
}

impl MeshFile {
    fn resolve(self, folder: &Path) -> Result<MeshSpec, SceneProblem> {
        let source = match (self.generator, self.obj) {
            (Some(generator), None) => MeshSource::Generator(generator),
            (None, Some(path)) => MeshSource::obj(&path, folder)?,
            (None, None) => return Err(field("mesh", "needs a generator or an obj")),
            (Some(_), Some(_)) => {
                return Err(field("mesh", "has both a generator and an obj: keep one"));
            }
        };
        Ok(MeshSpec {
            source,
            transform: self.transform,
        })
    }
}

impl HandleSelection {
    /// The vertices of `sheet` that are chosen.
    fn select(&self, sheet: &Sheet) -> Result<Vec<u32>, SceneProblem> {
        match self {
            Self::Vertices(vertices) => Ok(vertices.clone()),
            Self::Label(name) => sheet.labels.get(name).cloned().ok_or_else(|| {
                let known: Vec<&str> = sheet.labels.keys().map(String::as_str).collect();
                let known = known.join(", ");
                let problem = format!("the mesh has no label {name:?}; it has [{known}]");
                field("handles.label", problem)
            }),
            Self::Box { min, max } => {
                let is_inside = |p: &DVec3| p.cmpge(*min).all() && p.cmple(*max).all();
                let positions = sheet.mesh.positions().iter().zip(0_u32..);
                let inside: Vec<u32> = positions
                    .filter(|(position, _)| is_inside(position))
                    .map(|(_, vertex)| vertex)
                    .collect();
                if inside.is_empty() {
                    let problem = format!("no vertex starts between {min} and {max}");
                    return Err(field("handles.box", problem));
                }
                Ok(inside)
            }
        }
    }
}

/// A shipped material by name, or one in a TOML file.
fn material(name_or_path: &str, folder: &Path) -> Result<Material, SceneProblem> {
    if let Some(text) = material_text(name_or_path) {
        return parse_toml(text);
    }
    if !name_or_path.ends_with(".toml") {
        let known: Vec<&str> = materials().iter().map(|entry| entry.0).collect();
        let known = known.join(", ");
        let problem = format!("{name_or_path:?} is neither a .toml file nor one of {known}");
        return Err(field("material", problem));
    }
    let path = folder.join(name_or_path);
    let within =
        |problem: SceneProblem| field("material", format!("{}: {problem}", path.display()));
    parse_toml(&read_text(&path).map_err(within)?).map_err(within)
}

pub(crate) fn field(field: &'static str, problem: impl Into<String>) -> SceneProblem {
    SceneProblem::Field {
        field,
        problem: problem.into(),
    }
}

pub(crate) fn parse_toml<T: DeserializeOwned>(text: &str) -> Result<T, SceneProblem> {
    toml::from_str(text).map_err(|error| SceneProblem::Toml(Box::new(error)))
}

pub(crate) fn read_text(path: &Path) -> Result<String, SceneProblem> {
    std::fs::read_to_string(path).map_err(SceneProblem::Read)
}
