//! The scenes that a model learns to correct: those of data sets' motions to train on, in their
//! rest poses, or as their mesh hangs where the data set says so.

use std::sync::Arc;

use glam::DVec3;
use selvedge_cloth::{Cloth, ClothError, Scene, SceneError};
use selvedge_corrected::cloth_graph;
use selvedge_data::{DatasetPreset, SceneFileError, SceneSpecError, Setting, Split, StartSpec};
use selvedge_model::{ClothGraph, Domain, GraphError};
use thiserror::Error;

use crate::event::{OnEvent, Reporter};
use crate::physics::{self, RestPoseError};

/// Scenes that cannot be made ready.
#[derive(Debug, Error)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum TeachingScenesError {
    #[error("teacher.scenes: {0}")]
    Preset(#[from] SceneFileError),
    #[error("teacher.scenes: {0}")]
    Spec(#[from] SceneSpecError),
    #[error(transparent)]
    Scene(#[from] SceneError),
    #[error(transparent)]
    RestPose(#[from] RestPoseError),
    #[error("the cloth of scene {scene:?}: {source}")]
    Cloth { scene: String, source: ClothError },
    #[error("the graph of scene {scene:?}: {source}")]
    Graph { scene: String, source: GraphError },
}

/// Scenes with their cloths.
pub struct TeachingScenes {
    pub(super) scenes: Vec<TeachingScene>,
    /// Of all scenes.
    pub(super) domain: Option<Domain>,
}

/// A scene with the cloth where it starts.
pub(super) struct TeachingScene {
    pub(super) scene: Scene,
    pub(super) graph: Arc<ClothGraph>,
    /// Positions at the start `[m]`, `[vertices]`.
    pub(super) rest: Arc<Vec<DVec3>>,
}

/// A cloth where it starts.
struct Hanging {
    setting: Setting,
    start: StartSpec,
    graph: Arc<ClothGraph>,
    rest: Arc<Vec<DVec3>>,
}

impl TeachingScenes {
    /// Opens the presets `names` and finds the rest pose of every cloth; none where an end is asked
    /// for.
    ///
    /// # Errors
    /// A preset that is not there, a cloth that comes to no rest.
    pub fn open(
        names: &[String],
        on_event: &mut OnEvent<'_>,
    ) -> Result<Option<Self>, TeachingScenesError> {
        let reporter = Reporter::new(on_event);
        let mut known: Vec<Hanging> = Vec::new();
        let mut scenes = Vec::new();
        let mut domain: Option<Domain> = None;
        for name in names {
            let preset = DatasetPreset::open(name)?;
            for warning in preset.warnings() {
                reporter.remark(&format!("{name}: {warning}"));
            }
            for motion in preset.motions(Split::Train) {
                let loaded = preset.scene(motion)?;
                let (setting, start) = (loaded.spec.setting, loaded.spec.start);
                let scene = loaded.scene;
                let frames = scene.frame_count().map_err(SceneError::from)?;
                let its = Domain::of_scene(&scene, frames).map_err(SceneError::from)?;
                Domain::widen(&mut domain, its);
                let place = known
                    .iter()
                    .position(|cloth| cloth.setting == setting && cloth.start == start);
                let place = match place {
                    Some(place) => place,
                    None => {
                        match hanging(setting, start, &scene, &reporter) {
                            Err(_) if reporter.is_stopped() => return Ok(None),
                            cloth => known.push(cloth?),
                        }
                        known.len() - 1
                    }
                };
                let cloth = &known[place];
                scenes.push(TeachingScene {
                    scene,
                    graph: Arc::clone(&cloth.graph),
                    rest: Arc::clone(&cloth.rest),
                });
            }
        }
        Ok(Some(Self { scenes, domain }))
    }
}

fn hanging(
    setting: Setting,
    start: StartSpec,
    scene: &Scene,
    reporter: &Reporter<'_>,
) -> Result<Hanging, TeachingScenesError> {
    let rest = match start {
        StartSpec::Mesh => scene.mesh.positions().to_vec(),
        _ => physics::find_rest_pose(scene, reporter)?.positions,
    };
    let name = || scene.name.clone();
    let cloth = Cloth::of_scene(scene, physics::rounded(&rest)).map_err(|source| {
        let scene = name();
        TeachingScenesError::Cloth { scene, source }
    })?;
    let graph = cloth_graph(scene, &cloth).map_err(|source| {
        let scene = name();
        TeachingScenesError::Graph { scene, source }
    })?;
    Ok(Hanging {
        setting,
        start,
        graph: Arc::new(graph),
        rest: Arc::new(rest),
    })
}
