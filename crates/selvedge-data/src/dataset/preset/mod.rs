//! Presets of data sets: one setting, the motions to train on and to test on, and the rule for
//! sections. Written in TOML by people (docs/src/guides/data.md), resolved to JSON that the data set
//! keeps as its configuration.
//!
//! No motion may be in both splits, none of one's own in neither or with the name of a shipped one.
//! This crate plans the runs; the physics is run elsewhere.

mod cloths;

use self::cloths::{ClothFile, MeshesFile, Other, all_of};
use crate::dataset::Split;
use crate::dataset::plan::DatasetPlan;
use crate::dataset::sections::{Section, SectionRule};
use crate::formats::file_error::{FileError, Problem};
use crate::obstacle::ObstacleSpec;
use crate::scene::{
    LoadedScene, MeshSpec, MotionSource, ResolvedSetting, SceneSpec, Setting, SettingFile, Stand,
    StartSpec, field, not_understood, parse_toml, read_text, unknown,
};
use selvedge_assets::DATASETS as PRESETS;
use selvedge_cloth::motion::named;
use selvedge_cloth::{ContactSettings, Environment, HandleSchedule, Material, Mesh, Motion};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// The most motions that are drawn at random.
const MOST_RANDOM: u32 = 100_000;

/// Frames per second in which the paper's sections are counted.
const PAPER_RATE: f64 = 60.0;

/// A mesh, its handles and its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedCloth {
    /// Name of the cloth.
    pub name: String,
    /// Source of the mesh.
    pub mesh: MeshSpec,
    /// The held vertices, in the order of the handle targets.
    pub handles: Vec<u32>,
    /// When they let go.
    #[serde(default, skip_serializing_if = "HandleSchedule::is_empty")]
    pub schedule: HandleSchedule,
    /// Its material; the setting's own where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub material: Option<Material>,
    /// Gravity and air around it; the setting's own where none are named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub environment: Option<Environment>,
    /// Contact with bodies of its own, where it has some.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactSettings>,
    /// The bodies that it touches; the setting's own where none are named.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleSpec>,
}

/// The configuration of a data set, as its index keeps it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DatasetConfig {
    /// Name of the data set.
    pub name: String,
    /// Rule for the sections to learn from.
    pub sections: SectionRule,
    /// All of the scenes but their motions.
    pub setting: Setting,
    /// Cloths beside the setting's own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub cloths: Vec<NamedCloth>,
    /// Motions of the training split, in order.
    pub train: Vec<NamedMotion>,
    /// Motions of the test split, in order.
    pub test: Vec<NamedMotion>,
}

/// A motion and its name.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NamedMotion {
    /// Name of the motion and of its file.
    pub name: String,
    /// Motion of the handles.
    pub motion: Motion,
    /// The cloth that they move; the setting's own where none is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cloth: Option<String>,
}

/// Forecast of the data set that a preset will make.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Forecast {
    /// The trajectories, in order; training first.
    pub runs: Vec<PlannedRun>,
    /// Sections of the training split to learn from.
    pub sections: Vec<Section>,
}

/// A planned trajectory.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct PlannedRun {
    /// Part of the data set.
    pub split: Split,
    /// Name of the trajectory in the data set.
    pub name: String,
    /// Vertices of its mesh.
    pub vertices: usize,
    /// Number of frames, the start included.
    pub frames: usize,
}

impl Forecast {
    /// Frames in all, starts included.
    pub fn frames(&self) -> usize {
        self.runs.iter().map(|run| run.frames).sum()
    }

    /// Positions in all: vertices of every frame.
    pub fn positions(&self) -> usize {
        self.runs.iter().map(|run| run.frames * run.vertices).sum()
    }

    /// Samples in the sections.
    pub fn samples(&self) -> usize {
        self.sections.iter().map(|s| s.samples().count()).sum()
    }
}

/// A resolved preset.
#[derive(Clone, Debug, PartialEq)]
pub struct DatasetPreset {
    config: DatasetConfig,
    mesh: Mesh,
    /// Meshes of the configuration's cloths, in their order.
    meshes: Vec<Mesh>,
    forecast: Forecast,
    /// The folder that files of obstacles are relative to.
    folder: PathBuf,
    /// Warnings of what was mended or passed over in the files of meshes.
    warnings: Vec<String>,
}

/// The file's own words.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct PresetFile {
    name: String,
    sections: SectionRule,
    train: MotionList,
    test: MotionList,
    setting: SettingFile,
    meshes: Option<MeshesFile>,
    #[serde(default)]
    cloths: Vec<ClothFile>,
    #[serde(default)]
    motions: BTreeMap<String, MotionSource>,
}

/// Names of motions, or what stands for many.
#[derive(Deserialize)]
#[serde(
    untagged,
    expecting = "expected a list of motions, the name of a set, or a table of set and random"
)]
enum MotionList {
    Set(String),
    More(MoreMotions),
    Names(Vec<String>),
}

/// A set, and the first of the motions drawn at random.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct MoreMotions {
    set: String,
    random: u32,
}

/// The motions of the set that is called so, all as fast as it says.
fn set_of(name: &str) -> Option<Vec<String>> {
    let (set, speed) = name.split_at(name.find('@').unwrap_or(name.len()));
    let names = match set {
        "all-training" => named::training(),
        "all-test" => named::test(),
        "all-generalisation" => named::generalisation(),
        _ => return None,
    };
    let names = names.into_iter();
    Some(names.map(|name| name.to_owned() + speed).collect())
}

impl DatasetPreset {
    /// Opens a preset by the path of its file or by the name of a shipped one.
    ///
    /// # Errors
    /// [`FileError`] names the preset, the field and what is wrong.
    pub fn open(path_or_name: &str) -> Result<Self, FileError<Problem>> {
        let path = Path::new(path_or_name);
        let shipped = PRESETS.iter().find(|preset| preset.0 == path_or_name);
        let result = match shipped {
            Some((_, text)) => Self::parse(text, Path::new("")),
            None if path.exists() => read_text(path).and_then(|text| {
                let folder = path.parent().map_or_else(PathBuf::new, Path::to_owned);
                Self::parse(&text, &folder)
            }),
            None => Err(unknown("preset", PRESETS)),
        };
        result.map_err(FileError::at(path))
    }

    /// Reads a preset from the text of its file; paths in it are relative to `folder`.
    ///
    /// # Errors
    /// [`Problem`] names the field and what is wrong.
    pub fn parse(text: &str, folder: &Path) -> Result<Self, Problem> {
        let file: PresetFile = parse_toml(text)?;
        let setting = &file.setting;
        let is_of_scene = setting.name.is_some() || setting.motion.is_some();
        if is_of_scene || setting.start.is_some() || setting.dress.is_some() {
            let problem = "has name, motion, start or dress, which only a scene has: take them out";
            return Err(field("setting", problem));
        }
        let ResolvedSetting {
            setting,
            read,
            groups,
            ..
        } = file.setting.resolve(folder, &mut Vec::new())?;
        let (mesh, mut warnings) = (read.sheet.mesh, read.warnings);
        let mut own = BTreeMap::new();
        let stand = Stand::of(&setting, &mesh, &groups);
        for (name, source) in &file.motions {
            if named::by_name(name).is_some() {
                let problem = format!("{name:?} is the name of a shipped motion: choose another");
                return Err(field("motions", problem));
            }
            own.insert(name.clone(), source.resolve(folder, &stand)?);
        }
        let train = file.train.resolve("train", &own)?;
        let test = file.test.resolve("test", &own)?;
        let cloths = all_of(file.meshes, file.cloths, &own, folder, &mut warnings)?;
        let learned = cloths.iter().filter_map(|other| other.train.as_ref());
        let mut config = DatasetConfig {
            name: file.name,
            sections: file.sections,
            setting,
            cloths: cloths.iter().map(|other| other.cloth.clone()).collect(),
            train: train.iter().chain(learned.flatten()).cloned().collect(),
            test,
        };
        config.check(&own)?;
        config.train = train;
        config.run_on(&cloths)?;
        let mut preset = Self {
            config,
            mesh,
            meshes: cloths.into_iter().map(|other| other.mesh).collect(),
            folder: folder.to_owned(),
            warnings,
            forecast: Forecast::default(),
        };
        preset.forecast = preset.foresee()?;
        Ok(preset)
    }

    /// Every scene, made once to see that it can be, and what comes of it.
    fn foresee(&self) -> Result<Forecast, Problem> {
        let mut runs = Vec::new();
        for split in Split::BOTH {
            for motion in self.motions(split) {
                let scene = self.scene(motion)?.scene;
                runs.push(PlannedRun {
                    split,
                    name: motion.name.clone(),
                    vertices: scene.mesh.topology().vertex_count(),
                    frames: scene.frame_count()? + 1,
                });
            }
        }
        let train = runs.iter().filter(|run| run.split == Split::Train);
        let lengths: Vec<(&str, usize)> = train.map(|r| (r.name.as_str(), r.frames)).collect();
        let sections = self.config.sections.sections(&lengths);
        let sections = sections.map_err(|error| field("sections", error))?;
        Ok(Forecast { runs, sections })
    }

    /// Warnings of what was mended or passed over in the files of its meshes.
    pub fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// Forecast of the data set.
    pub fn forecast(&self) -> &Forecast {
        &self.forecast
    }

    /// The configuration.
    pub fn config(&self) -> &DatasetConfig {
        &self.config
    }

    /// The motions of a split, in order.
    pub fn motions(&self, split: Split) -> &[NamedMotion] {
        split.of(&self.config.train, &self.config.test)
    }

    /// The scene in which the cloth moves so.
    ///
    /// # Errors
    /// [`Problem`] when the motion cannot drive the handles.
    pub fn scene(&self, motion: &NamedMotion) -> Result<LoadedScene, Problem> {
        let mut setting = self.config.setting.clone();
        let mut mesh = &self.mesh;
        let cloths = self.config.cloths.iter().zip(&self.meshes);
        for (cloth, other) in cloths {
            if motion.cloth.as_ref() == Some(&cloth.name) {
                setting.mesh = cloth.mesh.clone();
                setting.handles.clone_from(&cloth.handles);
                setting.schedule.clone_from(&cloth.schedule);
                setting.material = cloth.material.clone().unwrap_or(setting.material);
                setting.environment = cloth.environment.unwrap_or(setting.environment);
                if cloth.contact.is_some() {
                    setting.contact = setting.contact.or(cloth.contact);
                    setting.obstacles.clone_from(&cloth.obstacles);
                }
                mesh = other;
            }
        }
        let spec = SceneSpec {
            name: format!("{}/{}", self.config.name, motion.name),
            setting,
            motion: motion.motion.clone(),
            start: StartSpec::Rest,
            dress: None,
        };
        let mut warnings = Vec::new();
        let scene = spec.with_mesh(mesh.clone(), &self.folder, &mut warnings)?;
        Ok(LoadedScene {
            spec,
            scene,
            state: None,
            loose: None,
            is_own_shape: false,
            warnings,
            files: Vec::new(),
        })
    }

    /// The plan for [`DatasetWriter`](crate::DatasetWriter).
    ///
    /// # Errors
    /// As of [`SceneSpec::to_json`].
    pub fn plan(&self) -> Result<DatasetPlan, Problem> {
        let names = |split| self.motions(split).iter().map(|m| m.name.clone()).collect();
        let config: Value = serde_json::to_value(&self.config).map_err(not_understood)?;
        Ok(DatasetPlan {
            name: self.config.name.clone(),
            config,
            train: names(Split::Train),
            test: names(Split::Test),
            sections: self.config.sections,
        })
    }
}

/// The shipped presets: names and TOML texts.
pub fn shipped_presets() -> &'static [(&'static str, &'static str)] {
    PRESETS
}

impl DatasetConfig {
    /// Adds what is learned on the other cloths. Tests are on those that nothing is learned on, where
    /// there are any.
    fn run_on(&mut self, cloths: &[Other]) -> Result<(), Problem> {
        for other in cloths {
            let motions = other.train.as_deref().unwrap_or_default();
            self.train.extend(other.runs(motions)?);
        }
        let tested = cloths.iter().filter(|other| other.train.is_none());
        let runs = tested.map(|other| other.runs(&self.test));
        let runs = runs.collect::<Result<Vec<_>, _>>()?;
        if !runs.is_empty() {
            self.test = runs.concat();
        }
        Ok(())
    }

    /// Checks that the splits are fit to learn from and to test with; `own` are the file's own
    /// motions.
    fn check(&self, own: &BTreeMap<String, Motion>) -> Result<(), Problem> {
        if self.train.is_empty() && self.cloths.is_empty() {
            let problem = "is empty: name at least one motion to learn from";
            return Err(field("train", problem));
        }
        for tested in &self.test {
            let same = |learned: &&NamedMotion| learned.motion == tested.motion;
            if let Some(learned) = self.train.iter().find(same) {
                let (test, train) = (&tested.name, &learned.name);
                let problem = format!("{test:?} is the motion {train:?} of train: test on others");
                return Err(field("test", problem));
            }
        }
        let used = self.train.iter().chain(&self.test).map(|m| &m.name);
        if let Some(name) = own.keys().find(|name| !used.clone().any(|u| u == *name)) {
            let problem = format!("{name:?} is neither in train nor in test: use or remove it");
            return Err(field("motions", problem));
        }
        if self.setting.handles.is_empty() && self.cloths.is_empty() {
            let problem = "are none: a data set's cloths are moved by handles";
            return Err(field("setting.handles", problem));
        }
        let rate = self.setting.frame_rate;
        if self.sections == SectionRule::Paper && rate != PAPER_RATE {
            let problem = format!(
                "\"paper\" counts frames of 1/60 s, but setting.frame_rate is {rate}: take \"whole\""
            );
            return Err(field("sections", problem));
        }
        Ok(())
    }
}

impl MotionList {
    fn resolve(
        self,
        split: &'static str,
        own: &BTreeMap<String, Motion>,
    ) -> Result<Vec<NamedMotion>, Problem> {
        let all_of = |set: &str| {
            let problem = "expected a list of motions, \"all-training\", \"all-test\" or \"all-generalisation\"";
            set_of(set).ok_or_else(|| field(split, format!("{problem}, found {set:?}")))
        };
        let names: Vec<String> = match self {
            Self::Set(set) => all_of(&set)?,
            Self::More(MoreMotions { set, random }) => {
                if random > MOST_RANDOM {
                    let problem = format!("must be at most {MOST_RANDOM}, found {random}");
                    return Err(field(format!("{split}.random"), problem));
                }
                let random = (0..random).map(|number| format!("random-{number}"));
                all_of(&set)?.into_iter().chain(random).collect()
            }
            Self::Names(names) => names
                .into_iter()
                .flat_map(|name| set_of(&name).unwrap_or(vec![name]))
                .collect(),
        };
        let named = |name: String| {
            let motion = own.get(&name).cloned().or_else(|| named::by_name(&name));
            let none = || format!("no motion is called {name:?}, here or by name");
            let motion = motion.ok_or_else(|| field(split, none()))?;
            Ok(NamedMotion {
                name,
                motion,
                cloth: None,
            })
        };
        names.into_iter().map(named).collect()
    }
}
