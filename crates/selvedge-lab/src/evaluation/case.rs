//! Test cases: recorded trajectories, scenes against their own converged physics, and random
//! motions without a truth.

use std::path::Path;

use anyhow::Result;
use selvedge_cloth::generate::{NamedSheet, named_sheets};
use selvedge_cloth::{Checkpoint, Cloth, Integrator, Motion, PhysicsSettings, RandomMotion};
use selvedge_data::{
    Dataset, Entry, FileError, LoadedScene, NamedCloth, Problem, SceneSpec, Split,
};
use serde_json::Value;

use super::ChoiceError;
use super::method::PhysicsMethod;
use crate::event::OnEvent;
use crate::physics;

/// A cloth and a motion on which methods are measured.
#[derive(Clone)]
pub struct Case {
    /// The data set, or the kind of scenes.
    pub set: String,
    /// The motion, or the scene.
    pub name: String,
    pub(super) source: Source,
}

/// Where the truth of a case comes from.
#[derive(Clone)]
pub(super) enum Source {
    /// A file of a data set.
    Recorded(Dataset, Entry),
    /// A run of the scene with so many substeps that it counts as the truth.
    Converged(Box<LoadedScene>, PhysicsMethod),
    /// Nowhere: a random motion from the rest pose, for so many frames.
    Random(Box<LoadedScene>, Checkpoint, usize),
}

/// Random motions of the handles.
#[derive(Clone, Debug)]
pub struct RandomCases {
    /// Number of motions.
    pub count: usize,
    /// Frames of each.
    pub frames: usize,
    /// Seed of all.
    pub seed: u64,
    /// Peak speed of the handles, in parts of that of the shipped training motions.
    pub speed: f64,
    /// Cloths in turn in the place of the scene's own, by name; `all` alone for all.
    pub meshes: Vec<String>,
    /// Density of these cloths `[vertices/m²]`.
    pub density: f64,
}

impl Case {
    /// The trajectories of `split`, or those of `motions` where there are any, of a data set that
    /// is called so in tables.
    pub fn recorded(
        set: &str,
        data: &Dataset,
        split: Split,
        motions: &[String],
    ) -> Result<Vec<Self>, ChoiceError> {
        let entries = data.entries(split);
        for motion in motions {
            if !entries.iter().any(|entry| entry.motion == *motion) {
                let known: Vec<&str> = entries.iter().map(|e| e.motion.as_str()).collect();
                let known = known.join(", ");
                let problem = format!("motion {motion}: the split of data set {set} has {known}");
                return Err(ChoiceError(problem));
            }
        }
        let is_chosen = |entry: &&Entry| motions.is_empty() || motions.contains(&entry.motion);
        let cases = entries.iter().filter(is_chosen).map(|entry| Self {
            set: set.to_owned(),
            name: entry.motion.clone(),
            source: Source::Recorded(data.clone(), entry.clone()),
        });
        let cases: Vec<Self> = cases.collect();
        if cases.is_empty() {
            let problem = format!("data set {set}: the split has no trajectories");
            return Err(ChoiceError(problem));
        }
        Ok(cases)
    }

    /// Every one of `scenes` of every one of `materials` and with every one of `motions`; with its
    /// own where there are none. A run by `reference` is the truth.
    pub fn converged(
        scenes: &[LoadedScene],
        materials: &[String],
        motions: &[String],
        reference: &PhysicsMethod,
    ) -> Result<Vec<Self>> {
        let mut named: Vec<(String, LoadedScene)> = Vec::new();
        for scene in scenes {
            named.push((scene.spec.name.clone(), fixed(scene)));
        }
        named = varied(named, materials, LoadedScene::of_material)?;
        named = varied(named, motions, LoadedScene::of_motion)?;
        let cases = named.into_iter().map(|(name, scene)| Self {
            set: "scenes".to_owned(),
            name,
            source: Source::Converged(Box::new(scene), reference.clone()),
        });
        Ok(cases.collect())
    }

    /// Random motions on the cloth of a scene, or on the cloths that take its place, each from its
    /// rest pose.
    pub fn random(
        loaded: &LoadedScene,
        random: &RandomCases,
        on_event: &mut OnEvent<'_>,
    ) -> Result<Vec<Self>> {
        if !loaded.scene.schedule.is_empty() {
            let problem = format!(
                "scene {}: releases handles, which no model can follow",
                loaded.spec.name
            );
            return Err(ChoiceError(problem).into());
        }
        let mut stages: Vec<(String, LoadedScene, Checkpoint)> = Vec::new();
        for (name, scene) in cloths(loaded, random)? {
            let rest = physics::rest_pose(&scene.scene, on_event)?;
            stages.push((name, scene, Checkpoint::at_rest(rest.positions)));
        }
        let cases = (0..random.count).map(|number| {
            let (name, scene, rest) = &stages[number % stages.len()];
            let motion = RandomMotion {
                seed: random.seed,
                number: number as u64,
                duration: random.frames as f64 / scene.scene.frame_rate,
                speed: random.speed,
            };
            let mut scene = scene.clone();
            scene.scene.motion = motion.motion();
            Self {
                set: name.clone(),
                name: number.to_string(),
                source: Source::Random(Box::new(scene), rest.clone(), random.frames),
            }
        });
        Ok(cases.collect())
    }

    /// Frames of the motion that have passed where the case begins, and where it ends.
    pub(super) fn span(&self) -> Result<[usize; 2], ChoiceError> {
        match &self.source {
            Source::Recorded(_, entry) => Ok([0, entry.frames.saturating_sub(1)]),
            Source::Random(_, _, frames) => Ok([0, *frames]),
            Source::Converged(loaded, _) => {
                let all = loaded.scene.frame_count();
                let all = all.map_err(|error| ChoiceError(format!("{}: {error}", self.name)))?;
                let first = loaded.state.as_ref().map_or(0, |state| state.frame);
                Ok([first, all])
            }
        }
    }

    /// Returns true where there are true states to start from and to compare with.
    pub(super) fn has_truth(&self) -> bool {
        !matches!(self.source, Source::Random(..))
    }

    /// The name as a file may have it.
    pub(super) fn slug(&self) -> String {
        let words = self.name.split(|c: char| !c.is_alphanumeric());
        let words = words.filter(|word| !word.is_empty());
        words.collect::<Vec<_>>().join("-")
    }
}

/// A scene whose number of substeps stays what it is told to be, with the same equations for every
/// integrator.
fn fixed(loaded: &LoadedScene) -> LoadedScene {
    let mut loaded = loaded.clone();
    for physics in [&mut loaded.scene.physics, &mut loaded.spec.setting.physics] {
        let usual = PhysicsSettings {
            integrator: Integrator::default(),
            ..*physics
        };
        physics.least_damping = Some(usual.damping(0.0));
    }
    loaded
}

/// Every one of `scenes` changed to every one of `names`; as they are where there are none.
fn varied(
    scenes: Vec<(String, LoadedScene)>,
    names: &[String],
    change: fn(LoadedScene, &str) -> Result<LoadedScene, FileError<Problem>>,
) -> Result<Vec<(String, LoadedScene)>> {
    if names.is_empty() {
        return Ok(scenes);
    }
    let mut all = Vec::with_capacity(scenes.len() * names.len());
    for (scene, loaded) in &scenes {
        for name in names {
            let stem = Path::new(name).file_stem();
            let short = stem.map_or(name.clone(), |stem| stem.to_string_lossy().into_owned());
            let changed = change(loaded.clone(), name)?;
            all.push((format!("{scene}, {short}"), changed));
        }
    }
    Ok(all)
}

/// The cloths that are asked for, still; the scene's own where none is.
fn cloths(loaded: &LoadedScene, random: &RandomCases) -> Result<Vec<(String, LoadedScene)>> {
    if random.meshes.is_empty() {
        return Ok(vec![(loaded.spec.name.clone(), loaded.clone())]);
    }
    let mut cloths = Vec::new();
    for sheet in sheets(&random.meshes)? {
        let wrong = |problem: String| ChoiceError(format!("mesh {}: {problem}", sheet.name));
        let made = NamedCloth::of_sheet(&sheet, random.density, random.seed);
        let (cloth, _) = made.map_err(|problem| wrong(problem.to_string()))?;
        let mut spec: SceneSpec = loaded.spec.clone();
        (spec.setting.mesh, spec.setting.handles) = (cloth.mesh, cloth.handles);
        spec.motion = Motion::still(1.0);
        let scene = spec.build("".as_ref());
        let scene = scene.map_err(|problem| wrong(problem.to_string()))?;
        let mut own = loaded.clone();
        (own.spec, own.scene, own.state) = (spec, scene, None);
        cloths.push((sheet.name.to_owned(), own));
    }
    Ok(cloths)
}

fn sheets(names: &[String]) -> Result<Vec<NamedSheet>, ChoiceError> {
    if names == ["all"] {
        return Ok(named_sheets().to_vec());
    }
    let by_name = |name: &String| {
        NamedSheet::by_name(name).ok_or_else(|| {
            let known: Vec<&str> = named_sheets().iter().map(|sheet| sheet.name).collect();
            let known = known.join(", ");
            ChoiceError(format!(
                "mesh: no mesh is called {name:?}; known are {known}"
            ))
        })
    };
    names.iter().map(by_name).collect()
}

/// Names of meshes: words for a mesh that no other mesh has.
#[derive(Default)]
pub(super) struct Meshes {
    known: Vec<(blake3::Hash, String)>,
}

impl Meshes {
    /// Words for the mesh of `cloth`, of a scene whose spec is `spec`: its source, its vertices and
    /// its handles. A number follows where another mesh, or the same with other handles, has these
    /// words already.
    pub(super) fn name(&mut self, cloth: &Cloth, spec: &Value) -> String {
        let identity = identity(cloth);
        if let Some((_, name)) = self.known.iter().find(|known| known.0 == identity) {
            return name.clone();
        }
        let words = words(cloth, spec);
        let is_known = |name: &String| self.known.iter().any(|known| known.1 == *name);
        let numbered = (2..).map(|number| format!("{words} ({number})"));
        let mut names = std::iter::once(words.clone()).chain(numbered);
        let name = names.find(|name| !is_known(name)).unwrap_or(words);
        self.known.push((identity, name.clone()));
        name
    }
}

/// Of faces, material coordinates, pattern and handles.
fn identity(cloth: &Cloth) -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    for vertex in cloth.topology().faces().iter().flatten() {
        hasher.update(&vertex.index().to_le_bytes());
    }
    let coordinates = cloth.material_coordinates().iter();
    for coordinate in coordinates.flat_map(|p| p.to_array()) {
        hasher.update(&coordinate.to_le_bytes());
    }
    for point in cloth.pattern().corners().iter().flatten() {
        hasher.update(&point.to_le_bytes());
    }
    for vertex in cloth.handles().vertices() {
        hasher.update(&vertex.index().to_le_bytes());
    }
    hasher.finalize()
}

fn words(cloth: &Cloth, spec: &Value) -> String {
    let source = spec.pointer("/setting/mesh/source");
    let text = |pointer| Some(source?.pointer(pointer)?.as_str()?.to_owned());
    let vertices = cloth.vertex_count();
    let handles = match cloth.handles().vertices().len() {
        1 => "1 handle".to_owned(),
        count => format!("{count} handles"),
    };
    match text("/generator/kind").or_else(|| text("/obj/path")) {
        Some(kind) => format!("{kind}, {vertices} vertices, {handles}"),
        None => format!("{vertices} vertices, {handles}"),
    }
}
