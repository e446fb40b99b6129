//! Contestants along a trajectory: a model, its naive rivals, or the truth itself, each as a
//! `Stepper` with its path.
//!
//! The rivals: the rest pose moved rigidly with the handles, and the physics itself from the other
//! branch of the buckling: what somebody would predict who knew the physics but not to which side
//! this cloth had buckled.

use std::ops::ControlFlow;
use std::sync::Arc;

use glam::{DVec3, Vec3};
use selvedge_cloth::{HandlePath, Motion, MotionError, RecordedMotion, Scene, Stepper};
use selvedge_data::{
    Drive, Playback, Recording, SceneSpec, SceneSpecError, Setting, Trajectory, record,
};
use selvedge_guard::{Correction, GuardSettings};
use selvedge_model::Model;
use selvedge_sim::{Simulator, SimulatorError, Threads};
use selvedge_train::TrainingSetError;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::measures::MeasureError;
use crate::cause::chain;
use crate::domain::{self, DomainError};
use crate::event::Reporter;
use crate::machine::{Machine, StartError};
use crate::physics::{RestPoseError, find_rest_pose};
use crate::rigid::RigidRest;
use crate::watched::{GuardSummary, WatchError, WatchedModel};

/// A kind of contestant.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Who {
    /// A model.
    Model,
    /// The rest pose moved rigidly with the handles.
    Rigid,
    /// The physics from the other branch of the buckling.
    Mirror,
    /// The physics itself, with as many substeps as it is asked for.
    Physics,
    /// The recorded trajectory itself.
    Truth,
}

/// A contestant that cannot run, or whose run cannot be measured.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum ContestantError {
    Graph(#[from] TrainingSetError),
    Model(#[from] StartError),
    Guard(#[from] WatchError),
    Domain(#[from] DomainError),
    #[error("{0}")]
    Mirror(String),
    #[error("there is no mirror of this scene")]
    NoMirror,
    #[error("the trajectory has no scene")]
    NoScene,
    #[error("the scene's mesh is not that of the trajectory")]
    OtherMesh,
    Scene(#[from] SceneSpecError),
    RestPose(#[from] RestPoseError),
    Physics(#[from] SimulatorError),
    Motion(#[from] MotionError),
    #[error("the recorded path of the handles: {0}")]
    Path(MotionError),
    Measure(#[from] MeasureError),
}

/// A contestant with its name.
pub struct Contestant {
    /// Its name in tables.
    pub name: String,
    /// The mover of the cloth.
    pub racer: Racer,
}

/// The mover of the cloth.
pub enum Racer {
    /// A model, guarded so, on this machine.
    Model(Arc<Model>, GuardSettings, Machine),
    /// The rest pose moved rigidly with the handles.
    Rigid,
    /// The physics from the other branch of the buckling.
    Mirror,
    /// The physics itself, with so many substeps per frame.
    Physics(u32),
    /// The recorded trajectory itself.
    Truth,
}

/// A trajectory to run along, with what contestants may need of its scene.
#[derive(Clone, Copy)]
pub struct Course<'a> {
    /// The motion's name.
    pub motion: &'a str,
    /// The trajectory.
    pub truth: &'a Trajectory,
    /// Its scene on the other branch of the buckling, where somebody runs there.
    pub mirror: Option<&'a Result<Mirror, ContestantError>>,
    /// Its own scene, where somebody needs it and it is known.
    pub scene: Option<&'a Arc<Scene>>,
}

/// A contestant at its start.
pub struct Runner {
    stepper: Mover,
    path: HandlePath,
    samples_per_frame: usize,
}

/// The mover of a contestant at its start.
enum Mover {
    Watched(Box<WatchedModel>),
    Other(Box<dyn Stepper>),
}

/// Scenes of trajectories, but for their motion: one per setting.
#[derive(Default)]
pub(super) struct Scenes {
    known: Vec<(Setting, Arc<Scene>)>,
}

/// Scenes that buckle to the other side, with their rest poses: one per setting.
#[derive(Default)]
pub(super) struct Mirrors {
    rests: Vec<(Setting, Vec<DVec3>)>,
}

/// A scene that buckles to the other side, and its rest pose `[m]`, `[vertices]`.
pub struct Mirror {
    scene: Scene,
    rest: Vec<DVec3>,
}

impl Contestant {
    /// The physics itself with so many substeps per frame.
    pub fn physics(substeps: u32) -> Self {
        Self {
            name: format!("physics, {substeps} per frame"),
            racer: Racer::Physics(substeps),
        }
    }

    /// The naive rivals, and the truth to compare all with.
    pub fn rivals() -> [Self; 3] {
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

    /// The kind of the contestant.
    pub fn who(&self) -> Who {
        match self.racer {
            Racer::Model(..) => Who::Model,
            Racer::Rigid => Who::Rigid,
            Racer::Mirror => Who::Mirror,
            Racer::Physics(_) => Who::Physics,
            Racer::Truth => Who::Truth,
        }
    }

    /// Returns `true` where the contestant wants the scene of its course.
    pub fn wants_scene(&self) -> bool {
        match &self.racer {
            Racer::Model(model, guard, _) => {
                guard.correction != Correction::None || model.spec().base.is_some()
            }
            Racer::Rigid | Racer::Mirror | Racer::Physics(_) | Racer::Truth => false,
        }
    }

    /// Parts of a trajectory that a model was not trained on, in words; nothing where its file does
    /// not say, or for another contestant.
    ///
    /// # Errors
    /// Another frame rate than that of the training.
    pub(super) fn beyond(&self, course: &Course<'_>) -> Result<Vec<String>, DomainError> {
        let Racer::Model(model, ..) = &self.racer else {
            return Ok(Vec::new());
        };
        let found = domain::of_trajectory(model, course.motion, course.truth)?;
        Ok(found.into_iter().flatten().map(|d| d.words).collect())
    }

    /// Makes the contestant ready to run along `course`. A model starts at frame `start` and knows
    /// the true frames before it; all others start at frame 0.
    ///
    /// # Errors
    /// When its parts do not fit, or there is no `mirror` that can be run.
    pub fn runner(&self, course: &Course<'_>, start: usize) -> Result<Runner, ContestantError> {
        let truth = course.truth;
        let stepper = match &self.racer {
            Racer::Model(model, guard, machine) => guarded(model, machine, *guard, course, start)?,
            Racer::Rigid => Mover::Other(Box::new(RigidRest::new(truth.cloth()))),
            Racer::Truth => Mover::Other(Box::new(Playback::new(truth.clone()))),
            Racer::Mirror => {
                return match course.mirror {
                    Some(Ok(mirror)) => simulated(&mirror.scene, mirror.rest.clone()),
                    Some(Err(problem)) => Err(ContestantError::Mirror(chain(problem))),
                    None => Err(ContestantError::NoMirror),
                };
            }
            Racer::Physics(substeps) => return physics(truth, *substeps),
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
    pub fn run(
        &mut self,
        frames: usize,
        on_frame: &mut dyn FnMut() -> ControlFlow<()>,
    ) -> Recording {
        let drive = Drive {
            path: &self.path,
            samples_per_frame: self.samples_per_frame,
        };
        let stepper: &mut dyn Stepper = match &mut self.stepper {
            Mover::Watched(watched) => &mut **watched,
            Mover::Other(other) => &mut **other,
        };
        record(stepper, drive, frames, &mut |_| on_frame())
    }

    /// Counts of the guard so far; none without a guard.
    pub fn guarded(&self) -> Option<GuardSummary> {
        match &self.stepper {
            Mover::Watched(watched) => Some(watched.summary()),
            Mover::Other(_) => None,
        }
    }
}

/// A model that knows the true frames up to `start`, with a guard where that is to do something.
fn guarded(
    model: &Arc<Model>,
    machine: &Machine,
    guard: GuardSettings,
    course: &Course<'_>,
    start: usize,
) -> Result<Mover, ContestantError> {
    let truth = course.truth;
    let graph = selvedge_train::graph_of(course.motion, truth)?;
    let first = (start + 1).saturating_sub(model.spec().history());
    let known: Vec<&[Vec3]> = (first..=start).map(|frame| truth.frame(frame)).collect();
    let scene = course.scene.map(|scene| &**scene);
    let stepper = machine.start(model, graph, &known, scene)?;
    if guard.correction == Correction::None {
        return Ok(Mover::Other(Box::new(stepper)));
    }
    let (cloth, rate) = (truth.cloth(), truth.frame_rate());
    let scene = course.scene.map(Arc::clone);
    let watched = WatchedModel::new(stepper, cloth, rate, scene, guard)?;
    Ok(Mover::Watched(Box::new(watched)))
}

impl Scenes {
    /// The scene of `truth`, whatever its motion; none where it has none that can be made.
    pub(super) fn of(&mut self, truth: &Trajectory) -> Option<Arc<Scene>> {
        let spec = SceneSpec::from_json(&truth.provenance().scene).ok()?;
        if let Some((_, scene)) = self.known.iter().find(|known| known.0 == spec.setting) {
            return Some(Arc::clone(scene));
        }
        let scene = Arc::new(spec.build("".as_ref()).ok()?);
        let fits = scene.mesh.topology() == truth.topology() && scene.handles == *truth.handles();
        if !fits {
            return None;
        }
        self.known.push((spec.setting, Arc::clone(&scene)));
        Some(scene)
    }
}

/// The physics of the scene of `truth` with so many substeps per frame, from the same rest pose.
/// Mesh files are looked for from the current folder.
fn physics(truth: &Trajectory, substeps: u32) -> Result<Runner, ContestantError> {
    let mut spec = spec_of(truth)?;
    spec.setting.physics.substeps = substeps;
    let scene = built(&spec, truth)?;
    let rest = truth.cloth().rest_positions().iter();
    simulated(&scene, rest.map(|p| p.as_dvec3()).collect())
}

/// The scene that a trajectory says it was made from.
fn spec_of(truth: &Trajectory) -> Result<SceneSpec, ContestantError> {
    let json = &truth.provenance().scene;
    if json.is_null() {
        return Err(ContestantError::NoScene);
    }
    Ok(SceneSpec::from_json(json)?)
}

/// The scene of `spec`, which is to be of the mesh of `truth`.
fn built(spec: &SceneSpec, truth: &Trajectory) -> Result<Scene, ContestantError> {
    let scene = spec.build("".as_ref())?;
    if scene.mesh.topology() != truth.topology() {
        return Err(ContestantError::OtherMesh);
    }
    Ok(scene)
}

/// The physics of `scene`, at rest at `rest` `[m]`, `[vertices]`, before its first frame.
fn simulated(scene: &Scene, rest: Vec<DVec3>) -> Result<Runner, ContestantError> {
    let still = vec![DVec3::ZERO; rest.len()];
    let mut simulator = Simulator::with_state(scene, rest, still)?;
    // Those of the pool that the run was given.
    simulator.set_threads(Threads::Pool);
    Ok(Runner {
        stepper: Mover::Other(Box::new(simulator)),
        path: scene.handle_path()?,
        samples_per_frame: scene.physics.substeps as usize,
    })
}

/// The path of the handles as it was recorded, from frame `start` on.
fn recorded_path(truth: &Trajectory, start: usize) -> Result<HandlePath, ContestantError> {
    let held = |frame: usize| -> Vec<DVec3> {
        let positions = truth.handles().select(truth.frame(frame));
        positions.iter().map(|p| p.as_dvec3()).collect()
    };
    let positions: Vec<Vec<DVec3>> = (start..truth.frame_count()).map(held).collect();
    Motion::Recorded(RecordedMotion { positions })
        .bind(&held(start), truth.frame_rate())
        .map_err(ContestantError::Path)
}

impl Mirrors {
    /// The scene of `truth` on the other branch of the buckling: with the sign of its bulge
    /// turned, and sagged anew. Mesh files are looked for from the current folder.
    ///
    /// # Errors
    /// When the trajectory has no scene, or the scene cannot be made or does not come to rest.
    pub(super) fn of(
        &mut self,
        truth: &Trajectory,
        reporter: &Reporter<'_>,
    ) -> Result<Mirror, ContestantError> {
        let mut spec = spec_of(truth)?;
        spec.setting.sag.bulge = -spec.setting.sag.bulge;
        let scene = built(&spec, truth)?;
        let known = self.rests.iter().find(|rest| rest.0 == spec.setting);
        let rest = match known {
            Some((_, rest)) => rest.clone(),
            None => {
                let rest = find_rest_pose(&scene, reporter)?.positions;
                self.rests.push((spec.setting, rest.clone()));
                rest
            }
        };
        Ok(Mirror { scene, rest })
    }
}
