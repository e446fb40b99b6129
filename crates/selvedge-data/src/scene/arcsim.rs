//! Scenes of ARCSim (Narain et al. 2012, 2013) as they are: its JSON, in which comments are allowed.
//!
//! Read are one cloth of one material, the held nodes and their motions, obstacles and what contact
//! with them needs, gravity, wind, and the times. Such a scene is run as ARCSim runs it: from where
//! the mesh stands, in its mode of the physics. Every other key, and every wrong value, is an error
//! that names the key; a part of ARCSim that the scene does not disable and that Selvedge lacks is
//! named in a warning. Files are looked for beside the scene and then in the working directory.
//!
//! Contact is Selvedge's own: of ARCSim's numbers it takes the thickness of repulsion and the
//! coefficients of friction, which a pair has the lesser of.

use std::collections::BTreeMap;
use std::ops::RangeInclusive;
use std::path::{Path, PathBuf};

use glam::DVec3;
use selvedge_cloth::{
    BendTable, ContactSettings, Environment, HandleSchedule, Material, Motion, PhysicsMode,
    PhysicsSettings, PoseKeyframe, Release, SagSettings, SplineGroup, SplineMotion, StretchTable,
};
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::file::moving_mesh;
use super::loaded::LoadedScene;
use super::material_source::shipped_material;
use super::mesh_spec::{BuiltMesh, MeshSource, MeshSpec, Rotate, Transform};
use super::problem::read_text;
use super::problem::{SceneProblem, field};
use super::spec::{SceneSpec, SceneSpecError, Setting};
use super::start::StartSpec;
use crate::formats::polygons::{MeshOptions, Sewing};
use crate::obstacle::{BodySpec, ObstacleMotion, ObstacleSpec, Placement};

/// Seconds that a scene lasts that does not say how long.
const DEFAULT_SECONDS: f64 = 10.0;
/// ARCSim's own values where a scene is silent: friction of cloth on cloth and on obstacles, and
/// thickness `[m]`.
const FRICTION: f64 = 0.6;
const OBSTACLE_FRICTION: f64 = 0.3;
const THICKNESS: f64 = 1e-3;
/// Ranges of factors and densities of a material, and of the density and the drag of air.
const FACTORS: RangeInclusive<f64> = 1e-6..=1e6;
const AIR: RangeInclusive<f64> = 0.0..=1e6;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct SceneFile {
    frame_time: f64,
    frame_steps: Option<u32>,
    end_time: Option<f64>,
    end_frame: Option<u32>,
    /// Old scenes of ARCSim say `end_time` so.
    duration: Option<f64>,
    cloths: Vec<ClothFile>,
    #[serde(default)]
    handles: Vec<HandleFile>,
    #[serde(default)]
    motions: Vec<Vec<KeyframeFile>>,
    #[serde(default)]
    obstacles: Vec<ObstacleFile>,
    #[serde(default)]
    gravity: DVec3,
    wind: Option<Wind>,
    #[serde(default)]
    disable: Vec<Part>,
    #[serde(default)]
    magic: Magic,
    friction: Option<f64>,
    obs_friction: Option<f64>,
}

/// Parts of ARCSim that can be disabled.
#[derive(Clone, Copy, PartialEq, Deserialize)]
#[serde(rename_all = "lowercase")]
enum Part {
    Proximity,
    StrainLimiting,
    Collision,
    Remeshing,
    Separation,
    PopFilter,
    Plasticity,
    Fracture,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ClothFile {
    mesh: String,
    #[serde(default)]
    transform: TransformFile,
    materials: Vec<MaterialFile>,
    #[serde(rename = "remeshing")]
    _remeshing: Option<IgnoredAny>,
}

/// `rotate` is degrees and an axis.
#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct TransformFile {
    scale: Option<f64>,
    rotate: [f64; 4],
    translate: DVec3,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialFile {
    data: String,
    density_mult: Option<f64>,
    stretching_mult: Option<f64>,
    bending_mult: Option<f64>,
    thicken: Option<f64>,
    damping: Option<f64>,
    strain_limits: Option<IgnoredAny>,
    yield_curv: Option<f64>,
    weakening: Option<f64>,
}

/// A material in ARCSim's own form: density `[kg/m²]`, six rows of stretching `[N/m]`, three of
/// bending `[N·m]`.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MaterialData {
    density: f64,
    stretching: [[f64; 4]; 6],
    bending: [[f64; 5]; 3],
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct HandleFile {
    nodes: Vec<u32>,
    motion: Option<usize>,
    end_time: Option<f64>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct KeyframeFile {
    time: f64,
    #[serde(default)]
    transform: TransformFile,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct ObstacleFile {
    mesh: String,
    #[serde(default)]
    transform: TransformFile,
    motion: Option<usize>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Wind {
    #[serde(default)]
    velocity: DVec3,
    density: Option<f64>,
    drag: Option<f64>,
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct Magic {
    repulsion_thickness: Option<f64>,
    collision_stiffness: Option<f64>,
}

/// Motions by their numbers.
type Motions = [Vec<PoseKeyframe>];

/// Reads a scene from the text of its file; paths in it are relative to `folder`.
pub(super) fn parse_arcsim(
    text: &str,
    folder: &Path,
    name: &str,
) -> Result<LoadedScene, SceneProblem> {
    let mut file: SceneFile = parse_json(text)?;
    let mut warnings = Vec::new();
    let count = file.cloths.len();
    let (Some(cloth), true) = (file.cloths.pop(), count == 1) else {
        return Err(wrong("cloths", "must have one cloth", count));
    };
    let (material, material_file) = material(&cloth, &file.disable, folder, &mut warnings)?;
    let frame_time = within("frame_time", file.frame_time, 1e-5..=1.0)?;
    let substeps = file.frame_steps.unwrap_or(1);
    let substeps = within("frame_steps", f64::from(substeps), 1.0..=1000.0)? as u32;
    let end_frame = file.end_frame.map(|end| f64::from(end) * frame_time);
    let ends = [file.end_time, end_frame, file.duration].into_iter();
    let duration = ends.flatten().reduce(f64::min).unwrap_or_else(|| {
        warnings.push(format!(
            "neither end_time nor end_frame says how long the scene lasts: {DEFAULT_SECONDS} s are taken"
        ));
        DEFAULT_SECONDS
    });
    let motions = motions(&file.motions)?;
    let (handles, schedule, groups) = handles(&file.handles, &motions, duration)?;
    let (contact, obstacles) = contact(&file, &motions, folder, &mut warnings)?;
    if !file.disable.contains(&Part::Remeshing) {
        let text = "remeshing is not disabled, but Selvedge has none: the mesh stays as it is";
        warnings.push(text.to_owned());
    }
    let spec = SceneSpec {
        name: name.to_owned(),
        setting: Setting {
            mesh: mesh(&cloth, folder)?,
            handles,
            schedule,
            material,
            fabrics: BTreeMap::new(),
            environment: environment(&file)?,
            physics: PhysicsSettings {
                substeps,
                ..PhysicsSettings::in_mode(PhysicsMode::Arcsim)
            },
            sag: SagSettings::default(),
            frame_rate: 1.0 / frame_time,
            contact,
            obstacles,
        },
        motion: Motion::Splines(SplineMotion {
            duration,
            // ARCSim takes hold of a node in its first solve, where the node then is; so the motion
            // is relative to its transform at the end of that solve.
            taken: frame_time / f64::from(substeps),
            groups,
        }),
        start: StartSpec::Mesh,
        dress: None,
    };
    let mut files = spec.files(folder);
    files.extend(material_file);
    let built = spec.setting.mesh.read(folder);
    let BuiltMesh {
        sheet,
        velocities,
        is_own_shape,
        warnings: mended,
        ..
    } = built.map_err(SceneSpecError::from)?;
    warnings.extend(mended);
    let state = moving_mesh(&spec.start, &sheet.mesh, velocities);
    let scene = spec.with_mesh(sheet.mesh, folder, &mut warnings)?;
    let loaded = LoadedScene {
        state,
        is_own_shape,
        warnings,
        files,
        ..LoadedScene::new(spec, scene)
    };
    Ok(loaded.looked_over("scale the texture coordinates of the mesh's file"))
}

fn environment(file: &SceneFile) -> Result<Environment, SceneProblem> {
    within("the length of gravity", file.gravity.length(), 0.0..=1e6)?;
    let mut environment = Environment {
        gravity: file.gravity,
        ..Environment::default()
    };
    if let Some(wind) = &file.wind {
        within(
            "the length of wind.velocity",
            wind.velocity.length(),
            0.0..=1e3,
        )?;
        environment.wind = wind.velocity;
        environment.air_density = within("wind.density", wind.density.unwrap_or(1.0), AIR)?;
        environment.air_drag = within("wind.drag", wind.drag.unwrap_or(0.0), AIR)?;
    }
    Ok(environment)
}

fn mesh(cloth: &ClothFile, folder: &Path) -> Result<MeshSpec, SceneProblem> {
    let path = mesh_file("cloths[0].mesh", &cloth.mesh, folder)?;
    let placed = &cloth.transform;
    Ok(MeshSpec {
        source: MeshSource::obj(&path, folder, MeshOptions::default())?,
        transform: Transform {
            scale: placed.scale.unwrap_or(1.0),
            rotation: placed.rotation("cloths[0].transform")?,
            translation: placed.translate,
            ..Transform::default()
        },
        rest_angles: None,
        sewing: Sewing::default(),
        seam_stiffness: None,
    })
}

/// The material, and the file that it is in. Where there is no such file, it is the shipped one of
/// its name.
fn material(
    cloth: &ClothFile,
    disabled: &[Part],
    folder: &Path,
    warnings: &mut Vec<String>,
) -> Result<(Material, Option<PathBuf>), SceneProblem> {
    let [used] = cloth.materials.as_slice() else {
        let must = "must have one material, that of all faces";
        return Err(wrong("cloths[0].materials", must, cloth.materials.len()));
    };
    let key = |key: &str| format!("cloths[0].materials[0].{key}");
    let path = used.data.as_str();
    let name = Path::new(path).file_stem().unwrap_or_default();
    let name = name.to_string_lossy();
    let (mut material, file) = match find_file(path, folder) {
        Some(found) => {
            let file = folder.join(found);
            let text = read_text(&file);
            let data = text.and_then(|text| material_data(&text, &name));
            let data = data.map_err(|problem| field(key("data"), format!("{path}: {problem}")))?;
            (data, Some(file))
        }
        None => {
            let shipped = shipped_material(&name).ok_or_else(|| SceneProblem::Key {
                key: key("data"),
                problem: format!(
                    "there is no file {path}, and no shipped material is called {name}"
                ),
            })??;
            warnings.push(format!(
                "{}: there is no file {path}: the shipped material {name} is taken",
                key("data")
            ));
            (shipped, None)
        }
    };
    let factor = |name, value: Option<f64>, range| within(&key(name), value.unwrap_or(1.0), range);
    let layers = factor("thicken", used.thicken, FACTORS)?;
    let stretching = factor("stretching_mult", used.stretching_mult, FACTORS)?;
    // A cloth that does not resist bending is one that can be run.
    let bending = factor("bending_mult", used.bending_mult, 0.0..=*FACTORS.end())?;
    material.density *= factor("density_mult", used.density_mult, FACTORS)? * layers;
    for stiffness in material.stretch.0.as_flattened_mut() {
        *stiffness *= stretching * layers;
    }
    for stiffness in material.bend.0.as_flattened_mut() {
        *stiffness *= bending * layers;
    }
    if let Some(damping) = used.damping {
        material.damping = within(&key("damping"), damping, 0.0..=100.0)?;
    }
    if used.strain_limits.is_some() && !disabled.contains(&Part::StrainLimiting) {
        let text =
            "strainlimiting is not disabled, but Selvedge has none: strain_limits has no effect";
        warnings.push(text.to_owned());
    }
    let has_yield = used.yield_curv.is_some() || used.weakening.is_some();
    if has_yield && !disabled.contains(&Part::Plasticity) {
        let text = "plasticity is not disabled, but Selvedge has none: yield_curv and weakening have no effect";
        warnings.push(text.to_owned());
    }
    Ok((material, file))
}

fn material_data(text: &str, name: &str) -> Result<Material, SceneProblem> {
    let data: MaterialData = parse_json(text)?;
    Ok(Material {
        name: name.to_owned(),
        source: format!("{name}.json"),
        density: within("density", data.density, FACTORS)?,
        damping: 0.0,
        stretch: StretchTable(data.stretching),
        bend: BendTable(data.bending),
    })
}

fn motions(files: &[Vec<KeyframeFile>]) -> Result<Vec<Vec<PoseKeyframe>>, SceneProblem> {
    let keyframe = |motion: usize, k: usize, file: &KeyframeFile| {
        let rotation = file
            .transform
            .rotation(&format!("motions[{motion}][{k}].transform"))?;
        Ok(PoseKeyframe {
            time: file.time,
            scale: file.transform.scale.unwrap_or(1.0),
            axis: rotation.axis,
            angle_deg: rotation.angle_deg,
            translation: file.transform.translate,
        })
    };
    let motion = |(motion, keyframes): (usize, &Vec<KeyframeFile>)| {
        let numbered = keyframes.iter().enumerate();
        numbered
            .map(|(k, file)| keyframe(motion, k, file))
            .collect()
    };
    files.iter().enumerate().map(motion).collect()
}

fn motion_of(
    key: &str,
    number: usize,
    motions: &Motions,
) -> Result<Vec<PoseKeyframe>, SceneProblem> {
    let must = || format!("must be one of the {} motions, from 0", motions.len());
    let found = motions.get(number).cloned();
    found.ok_or_else(|| wrong(key, &must(), number))
}

/// The held vertices, when they are let go, and their motions.
type Handles = (Vec<u32>, HandleSchedule, Vec<SplineGroup>);

fn handles(
    files: &[HandleFile],
    motions: &Motions,
    duration: f64,
) -> Result<Handles, SceneProblem> {
    let (mut vertices, mut groups) = (Vec::new(), Vec::new());
    let mut schedule = HandleSchedule::default();
    for (number, file) in files.iter().enumerate() {
        let first = vertices.len();
        vertices.extend(&file.nodes);
        let own: Vec<usize> = (first..vertices.len()).collect();
        if let Some(motion) = file.motion {
            groups.push(SplineGroup {
                handles: own.clone(),
                keyframes: motion_of(&format!("handles[{number}].motion"), motion, motions)?,
            });
        }
        match file.end_time {
            Some(end) if end <= 0.0 => {
                let must = "must be later than the start, or the handle never holds";
                return Err(wrong(&format!("handles[{number}].end_time"), must, end));
            }
            Some(end) if end < duration => schedule.releases.push(Release {
                handles: own,
                from: end,
                to: None,
            }),
            _ => {}
        }
    }
    Ok((vertices, schedule, groups))
}

/// Contact, and the obstacles that take part in it.
type Contact = (Option<ContactSettings>, Vec<ObstacleSpec>);

fn contact(
    file: &SceneFile,
    motions: &Motions,
    folder: &Path,
    warnings: &mut Vec<String>,
) -> Result<Contact, SceneProblem> {
    let [proximity, collision] =
        [Part::Proximity, Part::Collision].map(|p| file.disable.contains(&p));
    if proximity && collision {
        if !file.obstacles.is_empty() {
            warnings.push(format!(
                "obstacles are left out, {} of them: proximity and collision are disabled, so that nothing touches them",
                file.obstacles.len()
            ));
        }
        return Ok((None, Vec::new()));
    }
    if proximity || collision {
        let disabled = if proximity { "proximity" } else { "collision" };
        warnings.push(format!(
            "disable: {disabled} has no effect: Selvedge's contact has no such parts, disable proximity and collision to have none"
        ));
    }
    if file.magic.collision_stiffness.is_some() {
        let text = "magic.collision_stiffness has no effect: Selvedge's contact is as stiff as masses and substeps allow";
        warnings.push(text.to_owned());
    }
    let friction = within("friction", file.friction.unwrap_or(FRICTION), 0.0..=100.0)?;
    let on_obstacles = file.obs_friction.unwrap_or(OBSTACLE_FRICTION);
    let on_obstacles = within("obs_friction", on_obstacles, 0.0..=100.0)?;
    if on_obstacles > friction && !file.obstacles.is_empty() {
        warnings.push(format!(
            "obs_friction is {on_obstacles}, but a pair has the lesser of two, which is the cloth's {friction}"
        ));
    }
    let mut obstacles = Vec::with_capacity(file.obstacles.len());
    for (number, obstacle) in file.obstacles.iter().enumerate() {
        let key = |key: &str| format!("obstacles[{number}].{key}");
        let name = format!("obstacle {number}");
        let path = mesh_file(&key("mesh"), &obstacle.mesh, folder)?;
        obstacles.push(ObstacleSpec {
            body: BodySpec::mesh(path, folder, &name).map_err(SceneSpecError::from)?,
            name,
            transform: Placement {
                scale: obstacle.transform.scale.unwrap_or(1.0),
                rotation: obstacle.transform.rotation(&key("transform"))?,
                translation: obstacle.transform.translate,
            },
            motion: match obstacle.motion {
                None => ObstacleMotion::Still,
                Some(motion) => {
                    ObstacleMotion::Splines(motion_of(&key("motion"), motion, motions)?)
                }
            },
            friction: Some(on_obstacles),
            thickness: None,
        });
    }
    let thickness = file.magic.repulsion_thickness.unwrap_or(THICKNESS);
    let settings = ContactSettings {
        thickness: within("magic.repulsion_thickness", thickness, 1e-5..=1.0)?,
        friction,
        ..ContactSettings::default()
    };
    Ok((Some(settings), obstacles))
}

impl TransformFile {
    fn rotation(&self, place: &str) -> Result<Rotate, SceneProblem> {
        let [angle_deg, x, y, z] = self.rotate;
        match DVec3::new(x, y, z) {
            DVec3::ZERO if angle_deg != 0.0 => {
                let found = format!("{angle_deg}° about no axis");
                Err(wrong(
                    &format!("{place}.rotate"),
                    "must be degrees and an axis",
                    found,
                ))
            }
            DVec3::ZERO => Ok(Rotate {
                axis: DVec3::Y,
                angle_deg,
            }),
            axis => Ok(Rotate { axis, angle_deg }),
        }
    }
}

/// The mesh that `path` means, as a scene in `folder` names it.
fn mesh_file(key: &str, path: &str, folder: &Path) -> Result<String, SceneProblem> {
    let must = "must be an OBJ file beside the scene or in the working directory";
    find_file(path, folder).ok_or_else(|| wrong(key, must, path))
}

fn find_file(path: &str, folder: &Path) -> Option<String> {
    if folder.join(path).is_file() {
        return Some(path.to_owned());
    }
    let here: PathBuf = std::path::absolute(path).ok()?;
    here.is_file().then(|| here.to_string_lossy().into_owned())
}

fn within(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, SceneProblem> {
    if range.contains(&value) {
        return Ok(value);
    }
    let must = format!("must be between {} and {}", range.start(), range.end());
    Err(wrong(key, &must, value))
}

fn wrong(key: &str, must: &str, found: impl std::fmt::Display) -> SceneProblem {
    field(key, format!("{must}, found {found}"))
}

/// Reads JSON in which `//` and `/* */` are comments; errors name the key and the line.
fn parse_json<T: DeserializeOwned>(text: &str) -> Result<T, SceneProblem> {
    let text = without_comments(text);
    let mut reader = serde_json::Deserializer::from_str(&text);
    let read = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let key = error.path().to_string();
        match error.into_inner() {
            syntax if !syntax.is_data() => SceneProblem::Json(syntax),
            data => field(key, data.to_string()),
        }
    })?;
    reader.end().map_err(SceneProblem::Json)?;
    Ok(read)
}

/// The text with blanks for comments, so that lines and columns stay.
fn without_comments(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let length = match first {
            _ if rest.starts_with("//") => rest.find('\n').unwrap_or(rest.len()),
            _ if rest.starts_with("/*") => rest.find("*/").map_or(rest.len(), |end| end + 2),
            '"' => string_length(rest),
            other => other.len_utf8(),
        };
        let (piece, after) = rest.split_at(length);
        if first == '/' && length > 1 {
            let blank = |c: char| if c == '\n' { '\n' } else { ' ' };
            plain.extend(piece.chars().map(blank));
        } else {
            plain.push_str(piece);
        }
        rest = after;
    }
    plain
}

/// Bytes of the string that `text` begins with, its quotation marks included.
fn string_length(text: &str) -> usize {
    let mut is_escaped = false;
    let end = text.char_indices().skip(1).find(|&(_, letter)| {
        let ends = letter == '"' && !is_escaped;
        is_escaped = letter == '\\' && !is_escaped;
        ends
    });
    end.map_or(text.len(), |(at, _)| at + 1)
}

#[cfg(test)]
mod tests;
