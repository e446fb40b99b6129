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
    BendTable, Compression, ContactSettings, Environment, HandleSchedule, Material, Motion,
    PhysicsMode, PhysicsSettings, PoseKeyframe, Release, SagSettings, SplineGroup, SplineMotion,
    StretchTable,
};
use serde::Deserialize;
use serde::de::{DeserializeOwned, IgnoredAny};

use super::loaded::LoadedScene;
use super::material_source::shipped_material;
use super::mesh_spec::{MeshSource, MeshSpec, Rotate, Transform};
use super::problem::{field, read_text};
use super::spec::{SceneSpec, Setting, StartSpec};
use crate::formats::file_error::Problem;
use crate::formats::polygons::{MeshOptions, Sewing};
use crate::obstacle::{BodySpec, ObstacleMotion, ObstacleSpec, Placement};

/// Seconds that a scene lasts that does not say how long.
const DEFAULT_SECONDS: f64 = 10.0;
/// ARCSim's own values where a scene is silent: friction of cloth on cloth and on obstacles, and
/// thickness `[m]`.
const FRICTION: f64 = 0.6;
const OBSTACLE_FRICTION: f64 = 0.3;
const THICKNESS: f64 = 1e-3;
/// Ranges of factors and densities of a material, of coefficients of friction, and of the density
/// and the drag of air.
const FACTORS: RangeInclusive<f64> = 1e-6..=1e6;
const FRICTIONS: RangeInclusive<f64> = 0.0..=100.0;
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
#[derive(Deserialize)]
#[serde(deny_unknown_fields, default)]
struct TransformFile {
    scale: f64,
    rotate: [f64; 4],
    translate: DVec3,
}

impl Default for TransformFile {
    fn default() -> Self {
        Self {
            scale: 1.0,
            rotate: [0.0; 4],
            translate: DVec3::ZERO,
        }
    }
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

/// A scene on its way to a spec.
struct Reader<'a> {
    file: &'a SceneFile,
    folder: &'a Path,
    /// Motions by their numbers.
    motions: Vec<Vec<PoseKeyframe>>,
    warnings: Vec<String>,
    /// The files that were read but the mesh.
    files: Vec<PathBuf>,
}

/// Reads a scene from the text of its file; paths in it are relative to `folder`.
pub(super) fn parse_arcsim(text: &str, folder: &Path, name: &str) -> Result<LoadedScene, Problem> {
    let file: SceneFile = parse_json(text)?;
    let mut reader = Reader {
        file: &file,
        folder,
        motions: motions(&file.motions)?,
        warnings: Vec::new(),
        files: Vec::new(),
    };
    let spec = reader.spec(name)?;
    let mut read = spec.setting.mesh.read(folder)?;
    reader.warnings.append(&mut read.warnings);
    read.warnings = reader.warnings;
    let remedy = "scale the texture coordinates of the mesh's file";
    LoadedScene::of(spec, read, None, reader.files, folder, remedy)
}

impl Reader<'_> {
    fn warn(&mut self, text: impl Into<String>) {
        self.warnings.push(text.into());
    }

    fn disables(&self, part: Part) -> bool {
        self.file.disable.contains(&part)
    }

    fn spec(&mut self, name: &str) -> Result<SceneSpec, Problem> {
        let file = self.file;
        let [cloth] = file.cloths.as_slice() else {
            return Err(wrong("cloths", "must have one cloth", file.cloths.len()));
        };
        let material = self.material(cloth)?;
        let frame_time = within("frame_time", file.frame_time, 1e-5..=1.0)?;
        let substeps = f64::from(file.frame_steps.unwrap_or(1));
        let substeps = within("frame_steps", substeps, 1.0..=1000.0)? as u32;
        let end_frame = file.end_frame.map(|end| f64::from(end) * frame_time);
        let ends = [file.end_time, end_frame, file.duration].into_iter();
        let duration = ends.flatten().reduce(f64::min).unwrap_or_else(|| {
            self.warn(format!(
                "neither end_time nor end_frame says how long the scene lasts: {DEFAULT_SECONDS} s are taken"
            ));
            DEFAULT_SECONDS
        });
        let (handles, schedule, groups) = self.handles(duration)?;
        let (contact, obstacles) = self.contact()?;
        if !self.disables(Part::Remeshing) {
            self.warn("remeshing is not disabled, but Selvedge has none: the mesh stays as it is");
        }
        let setting = Setting {
            mesh: self.mesh(cloth)?,
            handles,
            schedule,
            material,
            fabrics: BTreeMap::new(),
            environment: environment(file)?,
            physics: PhysicsSettings {
                substeps,
                ..PhysicsSettings::in_mode(PhysicsMode::Arcsim)
            },
            sag: SagSettings::default(),
            frame_rate: 1.0 / frame_time,
            contact,
            obstacles,
        };
        let motion = Motion::Splines(SplineMotion {
            duration,
            // ARCSim takes hold of a node in its first solve, where the node then is; so the motion
            // is relative to its transform at the end of that solve.
            taken: frame_time / f64::from(substeps),
            groups,
        });
        Ok(SceneSpec {
            name: name.to_owned(),
            setting,
            motion,
            start: StartSpec::Mesh,
            dress: None,
        })
    }

    fn mesh(&self, cloth: &ClothFile) -> Result<MeshSpec, Problem> {
        let path = self.mesh_file("cloths[0].mesh", &cloth.mesh)?;
        let placed = cloth.transform.placement("cloths[0].transform")?;
        Ok(MeshSpec {
            source: MeshSource::obj(&path, self.folder, MeshOptions::default())?,
            transform: Transform {
                scale: placed.scale,
                rotation: placed.rotation,
                translation: placed.translation,
                ..Transform::default()
            },
            rest_angles: None,
            sewing: Sewing::default(),
            seam_stiffness: None,
        })
    }

    fn material(&mut self, cloth: &ClothFile) -> Result<Material, Problem> {
        let [used] = cloth.materials.as_slice() else {
            let must = "must have one material, that of all faces";
            return Err(wrong("cloths[0].materials", must, cloth.materials.len()));
        };
        let key = |key: &str| format!("cloths[0].materials[0].{key}");
        let material = self.named_material(&used.data, &key("data"))?;
        let factor =
            |name, value: Option<f64>, range| within(&key(name), value.unwrap_or(1.0), range);
        let layers = factor("thicken", used.thicken, FACTORS)?;
        let stretching = factor("stretching_mult", used.stretching_mult, FACTORS)?;
        // A cloth that does not resist bending is one that can be run.
        let bending = factor("bending_mult", used.bending_mult, 0.0..=*FACTORS.end())?;
        let density = factor("density_mult", used.density_mult, FACTORS)?;
        let mut material = material.multiplied(stretching * layers, bending * layers);
        material.density *= density * layers;
        if let Some(damping) = used.damping {
            material.damping = within(&key("damping"), damping, 0.0..=100.0)?;
        }
        if used.strain_limits.is_some() && !self.disables(Part::StrainLimiting) {
            self.warn(
                "strainlimiting is not disabled, but Selvedge has none: strain_limits has no effect",
            );
        }
        let has_yield = used.yield_curv.is_some() || used.weakening.is_some();
        if has_yield && !self.disables(Part::Plasticity) {
            self.warn("plasticity is not disabled, but Selvedge has none: yield_curv and weakening have no effect");
        }
        Ok(material)
    }

    /// The material in the file at `path`. Where there is no such file, it is the shipped one of its
    /// name.
    fn named_material(&mut self, path: &str, key: &str) -> Result<Material, Problem> {
        let name = Path::new(path).file_stem().unwrap_or_default();
        let name = name.to_string_lossy();
        if let Some(found) = find_file(path, self.folder) {
            let file = self.folder.join(found);
            let data = read_text(&file).and_then(|text| material_data(&text, &name));
            self.files.push(file);
            return data.map_err(|problem| field(key, format_args!("{path}: {problem}")));
        }
        let none = format!("there is no file {path}, and no shipped material is called {name}");
        let shipped = shipped_material(&name).ok_or_else(|| field(key, none))??;
        self.warn(format!(
            "{key}: there is no file {path}: the shipped material {name} is taken"
        ));
        Ok(shipped)
    }

    fn motion_of(&self, key: &str, number: usize) -> Result<Vec<PoseKeyframe>, Problem> {
        let must = format!("must be one of the {} motions, from 0", self.motions.len());
        let found = self.motions.get(number).cloned();
        found.ok_or_else(|| wrong(key, &must, number))
    }

    /// The held vertices, when they are let go, and their motions.
    fn handles(
        &self,
        duration: f64,
    ) -> Result<(Vec<u32>, HandleSchedule, Vec<SplineGroup>), Problem> {
        let (mut vertices, mut groups) = (Vec::new(), Vec::new());
        let mut schedule = HandleSchedule::default();
        for (number, file) in self.file.handles.iter().enumerate() {
            let key = |key: &str| format!("handles[{number}].{key}");
            let first = vertices.len();
            vertices.extend(&file.nodes);
            let own: Vec<usize> = (first..vertices.len()).collect();
            if let Some(motion) = file.motion {
                groups.push(SplineGroup {
                    handles: own.clone(),
                    keyframes: self.motion_of(&key("motion"), motion)?,
                });
            }
            match file.end_time {
                Some(end) if end <= 0.0 => {
                    let must = "must be later than the start, or the handle never holds";
                    return Err(wrong(&key("end_time"), must, end));
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
    fn contact(&mut self) -> Result<(Option<ContactSettings>, Vec<ObstacleSpec>), Problem> {
        let file = self.file;
        let count = file.obstacles.len();
        match [Part::Proximity, Part::Collision].map(|part| self.disables(part)) {
            [true, true] => {
                if count > 0 {
                    self.warn(format!(
                        "obstacles are left out, {count} of them: proximity and collision are disabled, so that nothing touches them"
                    ));
                }
                return Ok((None, Vec::new()));
            }
            [false, false] => {}
            [proximity, _] => {
                let disabled = if proximity { "proximity" } else { "collision" };
                self.warn(format!(
                    "disable: {disabled} has no effect: Selvedge's contact has no such parts, disable proximity and collision to have none"
                ));
            }
        }
        if file.magic.collision_stiffness.is_some() {
            self.warn("magic.collision_stiffness has no effect: Selvedge's contact is as stiff as masses and substeps allow");
        }
        let friction = within("friction", file.friction.unwrap_or(FRICTION), FRICTIONS)?;
        let on_obstacles = file.obs_friction.unwrap_or(OBSTACLE_FRICTION);
        let on_obstacles = within("obs_friction", on_obstacles, FRICTIONS)?;
        if on_obstacles > friction && count > 0 {
            self.warn(format!(
                "obs_friction is {on_obstacles}, but a pair has the lesser of two, which is the cloth's {friction}"
            ));
        }
        let obstacles = (0..count).map(|number| self.obstacle(number, on_obstacles));
        let obstacles = obstacles.collect::<Result<_, _>>()?;
        let thickness = file.magic.repulsion_thickness.unwrap_or(THICKNESS);
        let settings = ContactSettings {
            thickness: within("magic.repulsion_thickness", thickness, 1e-5..=1.0)?,
            friction,
            ..ContactSettings::default()
        };
        Ok((Some(settings), obstacles))
    }

    fn obstacle(&self, number: usize, friction: f64) -> Result<ObstacleSpec, Problem> {
        let file = &self.file.obstacles[number];
        let key = |key: &str| format!("obstacles[{number}].{key}");
        let name = format!("obstacle {number}");
        let path = self.mesh_file(&key("mesh"), &file.mesh)?;
        let motion = match file.motion {
            None => ObstacleMotion::Still,
            Some(motion) => ObstacleMotion::Splines(self.motion_of(&key("motion"), motion)?),
        };
        Ok(ObstacleSpec {
            body: BodySpec::mesh(path, self.folder, &name)?,
            name,
            transform: file.transform.placement(&key("transform"))?,
            motion,
            friction: Some(friction),
            thickness: None,
        })
    }

    /// The mesh that `path` means, as the scene names it.
    fn mesh_file(&self, key: &str, path: &str) -> Result<String, Problem> {
        let must = "must be an OBJ file beside the scene or in the working directory";
        find_file(path, self.folder).ok_or_else(|| wrong(key, must, path))
    }
}

fn environment(file: &SceneFile) -> Result<Environment, Problem> {
    within("the length of gravity", file.gravity.length(), 0.0..=1e6)?;
    let mut environment = Environment {
        gravity: file.gravity,
        ..Environment::default()
    };
    if let Some(wind) = &file.wind {
        let speed = wind.velocity.length();
        within("the length of wind.velocity", speed, 0.0..=1e3)?;
        environment.wind = wind.velocity;
        environment.air_density = within("wind.density", wind.density.unwrap_or(1.0), AIR)?;
        environment.air_drag = within("wind.drag", wind.drag.unwrap_or(0.0), AIR)?;
    }
    Ok(environment)
}

fn material_data(text: &str, name: &str) -> Result<Material, Problem> {
    let data: MaterialData = parse_json(text)?;
    Ok(Material {
        name: name.to_owned(),
        source: format!("{name}.json"),
        density: within("density", data.density, FACTORS)?,
        damping: 0.0,
        stretch: StretchTable(data.stretching),
        bend: BendTable(data.bending),
        compression: Compression::default(),
    })
}

fn motions(files: &[Vec<KeyframeFile>]) -> Result<Vec<Vec<PoseKeyframe>>, Problem> {
    let mut motions = vec![Vec::new(); files.len()];
    for (motion, keyframes) in files.iter().enumerate() {
        for (k, file) in keyframes.iter().enumerate() {
            let place = format!("motions[{motion}][{k}].transform");
            let placed = file.transform.placement(&place)?;
            motions[motion].push(PoseKeyframe {
                time: file.time,
                scale: placed.scale,
                axis: placed.rotation.axis,
                angle_deg: placed.rotation.angle_deg,
                translation: placed.translation,
            });
        }
    }
    Ok(motions)
}

impl TransformFile {
    /// The transform that `place` has.
    fn placement(&self, place: &str) -> Result<Placement, Problem> {
        let [angle_deg, x, y, z] = self.rotate;
        let axis = match DVec3::new(x, y, z) {
            DVec3::ZERO if angle_deg != 0.0 => {
                let found = format!("{angle_deg}° about no axis");
                let must = "must be degrees and an axis";
                return Err(wrong(&format!("{place}.rotate"), must, found));
            }
            DVec3::ZERO => DVec3::Y,
            axis => axis,
        };
        Ok(Placement {
            scale: self.scale,
            rotation: Rotate { axis, angle_deg },
            translation: self.translate,
        })
    }
}

fn find_file(path: &str, folder: &Path) -> Option<String> {
    if folder.join(path).is_file() {
        return Some(path.to_owned());
    }
    let here: PathBuf = std::path::absolute(path).ok()?;
    here.is_file().then(|| here.to_string_lossy().into_owned())
}

fn within(key: &str, value: f64, range: RangeInclusive<f64>) -> Result<f64, Problem> {
    if range.contains(&value) {
        return Ok(value);
    }
    let must = format!("must be between {} and {}", range.start(), range.end());
    Err(wrong(key, &must, value))
}

fn wrong(key: &str, must: &str, found: impl std::fmt::Display) -> Problem {
    field(key, format_args!("{must}, found {found}"))
}

/// Reads JSON in which `//` and `/* */` are comments; errors name the key and the line.
fn parse_json<T: DeserializeOwned>(text: &str) -> Result<T, Problem> {
    let text = without_comments(text);
    let mut reader = serde_json::Deserializer::from_str(&text);
    let read = serde_path_to_error::deserialize(&mut reader).map_err(|error| {
        let key = error.path().to_string();
        match error.into_inner() {
            syntax if !syntax.is_data() => no_json(&syntax),
            data => field(key, data),
        }
    })?;
    reader.end().map_err(|error| no_json(&error))?;
    Ok(read)
}

fn no_json(error: &serde_json::Error) -> Problem {
    Problem(format!("is no JSON: {error}"))
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
