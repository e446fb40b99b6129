//! A resolved scene: every default and every name filled in, as JSON beside what is made from it.
//!
//! Only a mesh from a file stays a reference, with its hash. The same spec makes the same scene.
//!
//! A run starts in the sagged rest pose, where the mesh has the vertices, from there moved apart
//! where it meets itself or relaxed into its pattern, or in a state that was saved.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use selvedge_cloth::{
    Checkpoint, ContactSettings, Environment, HandleSchedule, Handles, Material, Mesh, Motion,
    PhysicsSettings, SagSettings, Scene,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::mesh_spec::{MeshSource, MeshSpec};
use super::problem::{field, not_understood};
use crate::formats::file_error::Problem;
use crate::obstacle::ObstacleSpec;
use crate::trajectory::state_file::{StateChoice, StateSpec};

/// A resolved scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SceneSpec {
    /// Name of the scene.
    pub name: String,
    /// Everything but the motion and the start.
    pub setting: Setting,
    /// Motion of the handles.
    pub motion: Motion,
    /// Start of a run.
    #[serde(default, skip_serializing_if = "is_rest")]
    pub start: StartSpec,
    /// The obstacle that the cloth is put onto at the start.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub dress: Option<String>,
}

/// A resolved scene without its motion.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Setting {
    /// The cloth.
    pub mesh: MeshSpec,
    /// The held vertices, in the order of the handle targets.
    pub handles: Vec<u32>,
    /// Times at which handles let go.
    #[serde(default, skip_serializing_if = "HandleSchedule::is_empty")]
    pub schedule: HandleSchedule,
    /// The material of the cloth.
    pub material: Material,
    /// Materials of faces by the names of their fabrics in the mesh; all others have `material`.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub fabrics: BTreeMap<String, Material>,
    /// Gravity, air and wind.
    pub environment: Environment,
    /// Settings of the reference simulator.
    pub physics: PhysicsSettings,
    /// Settings of the search for the sagged rest pose.
    pub sag: SagSettings,
    /// Frames per second.
    pub frame_rate: f64,
    /// Contact with obstacles and of the cloth with itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub contact: Option<ContactSettings>,
    /// The bodies that the cloth touches.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub obstacles: Vec<ObstacleSpec>,
}

impl SceneSpec {
    /// The spec as JSON, as trajectories carry it. A number that is not finite becomes `null`,
    /// which [`Self::from_json`] refuses; no spec that makes a scene has one.
    ///
    /// # Errors
    /// When a part cannot be written as JSON, which today none can cause.
    pub fn to_json(&self) -> Result<Value, Problem> {
        serde_json::to_value(self).map_err(not_understood)
    }

    /// A spec from JSON.
    ///
    /// # Errors
    /// Names the key that is unknown or missing.
    pub fn from_json(json: &Value) -> Result<Self, Problem> {
        Self::deserialize(json).map_err(not_understood)
    }

    /// The files that stay references: of the mesh and of the state that it starts in, which are
    /// relative to `folder`.
    pub(super) fn files(&self, folder: &Path) -> Vec<PathBuf> {
        let mut files = Vec::new();
        if let MeshSource::Obj(file) = &self.setting.mesh.source {
            files.push(folder.join(&file.path));
        }
        if let StartSpec::State(state) = &self.start {
            files.push(folder.join(&state.path));
        }
        let obstacles = self.setting.obstacles.iter();
        files.extend(obstacles.flat_map(|obstacle| obstacle.files(folder)));
        files
    }

    /// Makes the scene; a mesh file is relative to `folder`.
    ///
    /// # Errors
    /// [`Problem`] names the part that cannot be used.
    pub fn build(&self, folder: &Path) -> Result<Scene, Problem> {
        let mesh = self.setting.mesh.build(folder)?.mesh;
        self.with_mesh(mesh, folder, &mut Vec::new())
    }

    /// Makes the scene with a mesh that has been built already; files of obstacles are relative to
    /// `folder`. What of these is left out is said in `warnings`.
    pub(crate) fn with_mesh(
        &self,
        mesh: Mesh,
        folder: &Path,
        warnings: &mut Vec<String>,
    ) -> Result<Scene, Problem> {
        let setting = &self.setting;
        let obstacles = setting.obstacles.iter();
        let obstacles: Result<_, _> = obstacles
            .map(|obstacle| obstacle.build(folder, setting.frame_rate, warnings))
            .collect();
        let scene = Scene {
            name: self.name.clone(),
            handles: Handles::new(&setting.handles, mesh.topology().vertex_count())?,
            mesh,
            fabrics: setting.fabrics.clone(),
            schedule: setting.schedule.clone(),
            material: setting.material.clone(),
            environment: setting.environment,
            motion: self.motion.clone(),
            physics: setting.physics,
            sag: setting.sag,
            frame_rate: setting.frame_rate,
            contact: setting.contact,
            obstacles: obstacles?,
        };
        scene.validate()?;
        Ok(scene)
    }
}

fn is_rest(start: &StartSpec) -> bool {
    *start == StartSpec::Rest
}

/// Start of a run, resolved.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case", deny_unknown_fields)]
pub enum StartSpec<State = StateSpec> {
    /// In the sagged rest pose.
    #[default]
    Rest,
    /// At the vertices of the mesh, at rest.
    Mesh,
    /// At the vertices of the mesh, moved apart where the cloth meets itself.
    Untangle,
    /// Relaxed into its pattern from the vertices of the mesh, at rest.
    Fit,
    /// In a saved state.
    State(State),
}

/// Start of a run, as files have it.
pub(crate) type StartFile = StartSpec<StateChoice>;

impl StartFile {
    /// Reads the state, if one is named, of a cloth of `vertices` that is run at `frame_rate`.
    pub(super) fn resolve(
        self,
        folder: &Path,
        vertices: usize,
        frame_rate: f64,
    ) -> Result<(StartSpec, Option<Checkpoint>), Problem> {
        let mut choice = match self {
            Self::Rest => return Ok((StartSpec::Rest, None)),
            Self::Mesh => return Ok((StartSpec::Mesh, None)),
            Self::Untangle => return Ok((StartSpec::Untangle, None)),
            Self::Fit => return Ok((StartSpec::Fit, None)),
            Self::State(choice) => choice,
        };
        choice.frame_rate = Some(frame_rate);
        let read = choice.read(folder, vertices);
        let (state, spec) = read.map_err(|error| field("start.state", error))?;
        Ok((StartSpec::State(spec), Some(state)))
    }
}
