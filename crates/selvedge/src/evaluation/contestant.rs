//! Who runs along a trajectory: a model, its naive rivals, or the truth itself, each as a `Stepper`
//! with its path.
//!
//! The rivals: the rest pose moved rigidly with the handles, and the physics itself from the other
//! branch of the buckling: what somebody would predict who knew the physics but not to which side
//! this cloth had buckled.

use std::ops::ControlFlow;
use std::sync::Arc;

use anyhow::{Context, anyhow};
use glam::{DVec3, Vec3};
use selvedge_cloth::{HandlePath, Motion, RecordedMotion, Scene, Stepper};
use selvedge_data::{Drive, Playback, Recording, SceneSpec, Setting, Trajectory, record};
use selvedge_model::{LearnedStepper, Model};
use selvedge_sim::{Simulator, Threads};
use serde::{Deserialize, Serialize};

use crate::reference;
use crate::rigid::RigidRest;

/// What somebody is who runs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Who {
    /// A model.
    Model,
    /// The rest pose moved rigidly with the handles.
    Rigid,
    /// The physics from the other branch of the buckling.
    Mirror,
    /// The recorded trajectory itself.
    Truth,
}

/// Somebody who runs.
pub(crate) struct Contestant {
    /// What people call it.
    pub(crate) name: String,
    /// What moves the cloth.
    pub(crate) racer: Racer,
}

/// What moves the cloth.
pub(crate) enum Racer {
    /// A model.
    Model(Arc<Model>),
    /// The rest pose moved rigidly with the handles.
    Rigid,
    /// The physics from the other branch of the buckling.
    Mirror,
    /// The recorded trajectory itself.
    Truth,
}

/// A contestant at its start.
pub(crate) struct Runner {
    stepper: Box<dyn Stepper>,
    path: HandlePath,
    samples_per_frame: usize,
}

/// Scenes that buckle to the other side, with their rest poses: one per setting.
#[derive(Default)]
pub(crate) struct Mirrors {
    rests: Vec<(Setting, Vec<DVec3>)>,
}

/// A scene that buckles to the other side, and its rest pose `[m]`, `[vertices]`.
pub(crate) struct Mirror {
    scene: Scene,
    rest: Vec<DVec3>,
}

impl Contestant {
    /// The naive rivals, and the truth to compare all with.
    pub(crate) fn rivals() -> [Self; 3] {
        [
            ("rigid", Racer::Rigid),
            ("mirror", Racer::Mirror),
            ("truth", Racer::Truth),
        ]
        .map(|(name, racer)| Self {
            name: name.to_owned(),
            racer,
        })
    }

    /// What it is.
    pub(crate) fn who(&self) -> Who {
        match self.racer {
            Racer::Model(_) => Who::Model,
            Racer::Rigid => Who::Rigid,
            Racer::Mirror => Who::Mirror,
            Racer::Truth => Who::Truth,
        }
    }

    /// Ready to run along `truth`. A model starts at frame `start` and knows the true frames before
    /// it; all others start at frame 0.
    ///
    /// # Errors
    /// When its parts do not fit, or there is no `mirror` that can be run.
    pub(crate) fn runner(
        &self,
        motion: &str,
        truth: &Trajectory,
        mirror: Option<&Result<Mirror, String>>,
        start: usize,
    ) -> anyhow::Result<Runner> {
        let stepper: Box<dyn Stepper> = match &self.racer {
            Racer::Model(model) => {
                let graph = selvedge_train::graph_of(motion, truth)?;
                let first = (start + 1).saturating_sub(model.spec().history());
                let known: Vec<&[Vec3]> = (first..=start).map(|frame| truth.frame(frame)).collect();
                Box::new(LearnedStepper::new(Arc::clone(model), graph, &known)?)
            }
            Racer::Rigid => Box::new(RigidRest::new(truth.cloth())),
            Racer::Truth => Box::new(Playback::new(truth.clone())),
            Racer::Mirror => {
                return match mirror {
                    Some(Ok(mirror)) => mirror.runner(),
                    Some(Err(problem)) => Err(anyhow!("{problem}")),
                    None => Err(anyhow!("there is no mirror of this scene")),
                };
            }
        };
        Ok(Runner {
            stepper,
            path: recorded_path(truth, start)?,
            samples_per_frame: 1,
        })
    }
}

impl Runner {
    /// Steps `frames` times. `on_frame` hears of every frame and may stop.
    pub(crate) fn run(
        &mut self,
        frames: usize,
        on_frame: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Recording {
        let drive = Drive {
            path: &self.path,
            samples_per_frame: self.samples_per_frame,
        };
        record(&mut *self.stepper, drive, frames, &mut |_| on_frame())
    }
}

/// The path of the handles as it was recorded, from frame `start` on.
fn recorded_path(truth: &Trajectory, start: usize) -> anyhow::Result<HandlePath> {
    let held = |frame: usize| -> Vec<DVec3> {
        let positions = truth.handles().select(truth.frame(frame));
        positions.iter().map(|p| p.as_dvec3()).collect()
    };
    let positions: Vec<Vec<DVec3>> = (start..truth.frame_count()).map(held).collect();
    Motion::Recorded(RecordedMotion { positions })
        .bind(&held(start), truth.frame_rate())
        .context("the recorded path of the handles")
}

impl Mirrors {
    /// The scene of `truth` on the other branch of the buckling: with the sign of its bulge
    /// turned, and sagged anew. Mesh files are looked for from the current folder.
    ///
    /// # Errors
    /// When the trajectory has no scene, or the scene cannot be made or does not come to rest.
    pub(crate) fn of(&mut self, truth: &Trajectory) -> anyhow::Result<Mirror> {
        let json = &truth.provenance().scene;
        if json.is_null() {
            return Err(anyhow!("the trajectory has no scene"));
        }
        let mut spec = SceneSpec::from_json(json)?;
        spec.setting.sag.bulge = -spec.setting.sag.bulge;
        let scene = spec.build("".as_ref())?;
        if scene.mesh.topology() != truth.topology() {
            return Err(anyhow!("the scene's mesh is not that of the trajectory"));
        }
        let known = self.rests.iter().find(|rest| rest.0 == spec.setting);
        let rest = match known {
            Some((_, rest)) => rest.clone(),
            None => {
                let rest = reference::rest_pose(&scene)?.positions;
                self.rests.push((spec.setting, rest.clone()));
                rest
            }
        };
        Ok(Mirror { scene, rest })
    }
}

impl Mirror {
    /// At rest, before the first frame.
    fn runner(&self) -> anyhow::Result<Runner> {
        let still = vec![DVec3::ZERO; self.rest.len()];
        let mut simulator = Simulator::with_state(&self.scene, self.rest.clone(), still)?;
        // Those of the pool that the run was given.
        simulator.set_threads(Threads::Pool);
        Ok(Runner {
            stepper: Box::new(simulator),
            path: self.scene.handle_path()?,
            samples_per_frame: self.scene.physics.substeps as usize,
        })
    }
}
