//! A resolved scene: every default and every name filled in, as JSON beside what is made from it.
//!
//! Only a mesh from a file stays a reference, with its hash. The same spec makes the same scene.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use selvedge_cloth::{
    ContactSettings, Environment, HandleError, HandleSchedule, Handles, Material, Mesh, Motion,
    PhysicsSettings, SagSettings, Scene, SceneError,
};
use serde::{Deserialize, Serialize};
use serde_json::Value;
use thiserror::Error;

use super::mesh_spec::{MeshSource, MeshSpec, MeshSpecError};
use super::start::StartSpec;
use crate::formats::file_error::Problem;
use crate::obstacle::ObstacleSpec;

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
    #[serde(default, skip_serializing_if = "StartSpec::is_rest")]
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

/// A spec that makes no scene.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "each message is its source's")]
pub enum SceneSpecError {
    #[error("the scene cannot be understood: {0}")]
    Json(#[from] serde_json::Error),
    #[error(transparent)]
    Mesh(#[from] MeshSpecError),
    #[error("handles: {0}")]
    Handles(#[from] HandleError),
    #[error(transparent)]
    Obstacle(#[from] Problem),
    #[error(transparent)]
    Scene(#[from] SceneError),
}

impl SceneSpec {
    /// The spec as JSON, as trajectories carry it. A number that is not finite becomes `null`,
    /// which [`Self::from_json`] refuses; no spec that makes a scene has one.
    ///
    /// # Errors
    /// [`SceneSpecError::Json`] when a part cannot be written as JSON, which today none can cause.
    pub fn to_json(&self) -> Result<Value, SceneSpecError> {
        Ok(serde_json::to_value(self)?)
    }

    /// A spec from JSON.
    ///
    /// # Errors
    /// [`SceneSpecError::Json`] names the key that is unknown or missing.
    pub fn from_json(json: &Value) -> Result<Self, SceneSpecError> {
        Ok(Self::deserialize(json)?)
    }

    /// The files that stay references: of the mesh and of the state that it starts in, which are
    /// relative to `folder`.
    pub(super) fn files(&self, folder: &Path) -> Vec<PathBuf> {
        let mesh = match &self.setting.mesh.source {
            MeshSource::Obj(file) => Some(&file.path),
            MeshSource::Generator(_) => None,
        };
        let state = match &self.start {
            StartSpec::State(state) => Some(&state.path),
            StartSpec::Rest | StartSpec::Mesh | StartSpec::Untangle | StartSpec::Fit => None,
        };
        let files = mesh.into_iter().chain(state);
        let files = files.map(|file| folder.join(file));
        let obstacles = self.setting.obstacles.iter();
        files
            .chain(obstacles.flat_map(|obstacle| obstacle.files(folder)))
            .collect()
    }

    /// Makes the scene; a mesh file is relative to `folder`.
    ///
    /// # Errors
    /// [`SceneSpecError`] names the part that cannot be used.
    pub fn build(&self, folder: &Path) -> Result<Scene, SceneSpecError> {
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
    ) -> Result<Scene, SceneSpecError> {
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
