//! Stress tests: a model, or physics alone, along random motions, without a truth, and the share
//! of runs that stay whole.
//!
//! Each run is the work of one thread from its start to its end, and its motion follows from seed
//! and number alone.

use std::io::Write;
use std::path::Path;
use std::sync::Arc;
use std::time::Instant;

use glam::DVec3;
use selvedge_cloth::generate::{NamedSheet, named_sheets};
use selvedge_cloth::{
    Cloth, ClothError, HandleError, Motion, MotionError, RandomMotion, Scene, StepError, Stepper,
};
use selvedge_data::{
    LoadedScene, NamedCloth, SceneSpec, SceneSpecError, WriteError, metrics, write_atomically,
};
use selvedge_guard::GuardSettings;
use selvedge_model::Departure;
use selvedge_sim::{Simulator, SimulatorError, Threads};
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::cause::chain;
use crate::csv::Csv;
use crate::domain::{self, Beyond, DomainError};
use crate::event::{OnEvent, Reporter, Task};
use crate::machine::{Machine, Mover};
use crate::models::{NamedModel, SceneGraphError, StartModelError, graph_of_scene};
use crate::physics::{self, RestPoseError};
use crate::watched::{DIVERGED_FRAMES, DIVERGED_STRAIN, GuardSummary, WatchError, WatchedModel};
use crate::workers::{self, Crew, Packing, WorkerError};

/// A stress test to be made.
#[derive(Clone, Debug)]
pub struct StressPlan {
    /// Numbers of the motions, rising.
    pub numbers: Vec<usize>,
    /// Frames of each run.
    pub frames: usize,
    /// Seed of the motions.
    pub seed: u64,
    /// Peak speed of the handles, in parts of that of the shipped training motions.
    pub speed: f64,
    /// The guard of the model.
    pub guard: GuardSettings,
    /// Those who share the runs. Rank 0 has them.
    pub crew: Crew,
}

/// A contestant that is driven.
pub enum Driven {
    /// A model.
    Model(NamedModel),
    /// The physics of the scene with so many substeps, to compare with.
    Physics(u32),
}

impl Driven {
    /// The name for people.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Model(model) => model.name.clone(),
            Self::Physics(1) => "physics, 1 substep".to_owned(),
            Self::Physics(substeps) => format!("physics, {substeps} substeps"),
        }
    }

    fn domain(&self, scene: &Scene, frames: usize) -> Result<Option<Beyond>, DomainError> {
        match self {
            Self::Model(model) => domain::of_scene(&model.model, scene, frames),
            Self::Physics(_) => Ok(None),
        }
    }

    /// Starts at rest on the cloth of `stage`.
    fn start(&self, stage: &StressStage) -> Result<Mover, DriveError> {
        let (scene, cloth) = (&stage.scene, &stage.cloth);
        match self {
            Self::Model(model) => {
                let graph = graph_of_scene(scene, cloth, &model.model)?;
                let start = cloth.rest_positions();
                Ok(model.start(graph, start, &Machine::Cpu, scene)?)
            }
            Self::Physics(substeps) => {
                let mut scene = Scene::clone(scene);
                scene.physics.substeps = *substeps;
                let rest = cloth.rest_positions().iter().map(|p| p.as_dvec3());
                let start = rest.collect();
                let still = vec![DVec3::ZERO; cloth.vertex_count()];
                let mut simulator = Simulator::with_state(&scene, start, still)?;
                simulator.set_threads(Threads::One);
                Ok(Box::new(simulator))
            }
        }
    }
}

/// Cloths in the place of the scene's own.
#[derive(Clone, Debug)]
pub struct MeshChoice {
    /// Names of sheets, or `all` alone.
    pub names: Vec<String>,
    /// Density `[vertices/m²]`.
    pub density: f64,
    /// Seed of the places of inner vertices.
    pub seed: u64,
}

/// A choice of scene or cloths that cannot be stressed.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct StressChoiceError(String);

/// A stress test that failed as a whole.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum StressError {
    Choice(#[from] StressChoiceError),
    #[error("mesh {mesh}: {source}")]
    Mesh {
        mesh: String,
        source: SceneSpecError,
    },
    RestPose(#[from] RestPoseError),
    #[error("the rest pose of scene {scene:?}: {source}")]
    Cloth {
        scene: String,
        source: ClothError,
    },
    Graph(#[from] SceneGraphError),
    Threads(#[from] WorkerError),
}

/// A run that failed.
#[derive(Debug, Error)]
#[error(transparent)]
enum DriveError {
    Motion(#[from] MotionError),
    Graph(#[from] SceneGraphError),
    Start(#[from] StartModelError),
    Physics(#[from] SimulatorError),
    Guard(#[from] WatchError),
    Targets(#[from] HandleError),
    Step(#[from] StepError),
    Domain(#[from] DomainError),
}

/// Runs of one cloth, or of all.
#[derive(Serialize)]
pub struct StressSummary {
    /// The name of the cloth, or `all`.
    pub mesh: String,
    /// Vertices of the cloth.
    pub vertices: usize,
    /// Runs that were made.
    pub runs: usize,
    /// Runs that did not diverge.
    pub stable: usize,
    /// The same as a share of the runs.
    pub stable_share: f64,
    /// Counts of the guard.
    pub guarded: GuardSummary,
    /// Quantiles (0, 1/4, 1/2, 3/4, 95 %, 1) of the largest strain of each run; none where a run
    /// failed.
    pub strain_quantiles: [Option<f64>; 6],
}

/// One run.
#[derive(Clone, Serialize, Deserialize)]
pub struct StressRun {
    /// The number of its motion.
    pub number: usize,
    /// The name of the cloth.
    pub mesh: String,
    /// The frame in which it diverged.
    pub diverged_frame: Option<usize>,
    /// Over all frames, against the material; none where the run failed.
    pub largest_strain: Option<f64>,
    /// Counts of the guard.
    pub guarded: GuardSummary,
    /// Parts of motion and cloth that the model was not trained on; nothing where its file does not
    /// say.
    pub beyond: Vec<Departure>,
    /// The reason of an early end.
    pub failure: Option<String>,
    /// Wall time of a frame `[ms]`.
    #[serde(skip)]
    pub ms_per_frame: f64,
}

/// A cloth in its rest pose, ready to be driven.
pub struct StressStage {
    /// The name of the cloth.
    pub mesh: String,
    scene: Arc<Scene>,
    /// The cloth.
    pub cloth: Cloth,
}

const QUANTILES: [f64; 6] = [0.0, 0.25, 0.5, 0.75, 0.95, 1.0];

/// Makes ready the cloth of a scene called `name`, or the cloths that take its place, each in its
/// rest pose.
///
/// # Errors
/// A scene that lets handles go, an unknown cloth, or a rest pose that is not found.
pub fn stages(
    name: &str,
    loaded: LoadedScene,
    meshes: &MeshChoice,
    on_event: &mut OnEvent<'_>,
) -> Result<Vec<StressStage>, StressError> {
    let reporter = Reporter::new(on_event);
    if !loaded.scene.schedule.is_empty() {
        let problem = format!("scene {name}: lets handles go, which no model can follow");
        return Err(StressChoiceError(problem).into());
    }
    if meshes.names.is_empty() {
        return Ok(vec![stage(name.to_owned(), loaded.scene, &reporter)?]);
    }
    let mut stages = Vec::new();
    for sheet in sheets(&meshes.names)? {
        let (cloth, _) = NamedCloth::of_sheet(&sheet, meshes.density, meshes.seed)
            .map_err(|problem| StressChoiceError(format!("mesh {}: {problem}", sheet.name)))?;
        let mut spec: SceneSpec = loaded.spec.clone();
        (spec.setting.mesh, spec.setting.handles) = (cloth.mesh, cloth.handles);
        spec.motion = Motion::still(1.0);
        let scene = spec.build("".as_ref()).map_err(|source| {
            let mesh = sheet.name.to_owned();
            StressError::Mesh { mesh, source }
        })?;
        stages.push(stage(sheet.name.to_owned(), scene, &reporter)?);
    }
    Ok(stages)
}

fn sheets(names: &[String]) -> Result<Vec<NamedSheet>, StressChoiceError> {
    if names == ["all"] {
        return Ok(named_sheets().to_vec());
    }
    let by_name = |name: &String| {
        NamedSheet::by_name(name).ok_or_else(|| {
            let known: Vec<&str> = named_sheets().iter().map(|sheet| sheet.name).collect();
            let known = known.join(", ");
            StressChoiceError(format!(
                "mesh: no mesh is called {name:?}; known are {known}"
            ))
        })
    };
    names.iter().map(by_name).collect()
}

fn stage(mesh: String, scene: Scene, reporter: &Reporter<'_>) -> Result<StressStage, StressError> {
    let rest = physics::find_rest_pose(&scene, reporter)?;
    let cloth = Cloth::of_scene(&scene, physics::rounded(&rest.positions)).map_err(|source| {
        let scene = scene.name.clone();
        StressError::Cloth { scene, source }
    })?;
    Ok(StressStage {
        mesh,
        scene: Arc::new(scene),
        cloth,
    })
}

/// Checks that a model was trained at the frame rate of the cloths, if its file says so.
///
/// # Errors
/// [`DomainError::FrameRate`].
pub fn check_rate(driven: &Driven, stages: &[StressStage]) -> Result<(), DomainError> {
    for stage in stages {
        driven.domain(&stage.scene, 0)?;
    }
    Ok(())
}

/// Drives a model or the physics through the motions of `plan`, each on one of `stages` in turn.
/// The answer lacks the runs that were not finished when the listener asked to stop.
///
/// # Errors
/// Threads that cannot be started. A run that fails is one that diverged.
pub fn drive(
    plan: &StressPlan,
    driven: &Driven,
    stages: &[StressStage],
    on_event: &mut OnEvent<'_>,
) -> Result<Vec<StressRun>, WorkerError> {
    let reporter = Reporter::new(on_event);
    // The share of a rank, about.
    let numbers = plan.numbers.len().div_ceil(plan.crew.ranks.count());
    let task = reporter.count("driving", numbers * plan.frames, "frames");
    let runs = workers::share_with(&plan.crew, &plan.numbers, &PACKING, |&number| {
        let stage = &stages[number % stages.len()];
        let run = Drive {
            plan,
            driven,
            stage,
            task: &task,
        }
        .run(number);
        Ok::<_, WorkerError>(run)
    })?;
    Ok(runs.into_iter().flatten().collect())
}

/// One run under way.
struct Drive<'a, 'l> {
    plan: &'a StressPlan,
    driven: &'a Driven,
    stage: &'a StressStage,
    task: &'a Task<'a, 'l>,
}

/// A run as it travels between ranks and is kept in parts: with its time, and with a strain that
/// JSON may not know.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct KeptRun {
    run: StressRun,
    strain_bits: Option<u64>,
    ms_per_frame: f64,
}

impl From<StressRun> for KeptRun {
    fn from(run: StressRun) -> Self {
        Self {
            strain_bits: run.largest_strain.map(f64::to_bits),
            ms_per_frame: run.ms_per_frame,
            run,
        }
    }
}

impl From<KeptRun> for StressRun {
    fn from(kept: KeptRun) -> Self {
        Self {
            largest_strain: kept.strain_bits.map(f64::from_bits),
            ms_per_frame: kept.ms_per_frame,
            ..kept.run
        }
    }
}

const PACKING: Packing<StressRun> = Packing {
    pack: |run| serde_json::to_vec(&KeptRun::from(run.clone())).unwrap_or_default(),
    unpack: |bytes| Some(serde_json::from_slice::<KeptRun>(bytes).ok()?.into()),
};

impl Drive<'_, '_> {
    fn is_stopped(&self) -> bool {
        self.task.is_stopped() || self.plan.crew.ranks.is_halted()
    }

    /// Makes the run of this number; none where the listener asked to stop.
    fn run(&self, number: usize) -> Option<StressRun> {
        if self.is_stopped() {
            return None;
        }
        let mut run = StressRun {
            number,
            mesh: self.stage.mesh.clone(),
            diverged_frame: None,
            largest_strain: None,
            guarded: GuardSummary::default(),
            beyond: Vec::new(),
            failure: None,
            ms_per_frame: 0.0,
        };
        let mut strains = Vec::with_capacity(self.plan.frames);
        let driven = self.steps(&mut run, &mut strains);
        if self.is_stopped() {
            return None;
        }
        // The first strain is that after the first step.
        run.diverged_frame = metrics::diverged_frame(&strains, DIVERGED_STRAIN, DIVERGED_FRAMES)
            .map(|frame| frame + 1);
        match driven {
            Ok(()) => run.largest_strain = Some(strains.into_iter().fold(0.0, f64::max)),
            Err(error) => {
                run.failure = Some(chain(&error));
                run.diverged_frame = run.diverged_frame.or(Some(strains.len() + 1));
            }
        }
        Some(run)
    }

    /// Steps along the motion of the run and notes the largest strain of every frame.
    fn steps(&self, run: &mut StressRun, strains: &mut Vec<f64>) -> Result<(), DriveError> {
        let (plan, stage) = (self.plan, self.stage);
        let rate = stage.scene.frame_rate;
        let motion = RandomMotion {
            seed: plan.seed,
            number: run.number as u64,
            duration: plan.frames as f64 / rate,
            speed: plan.speed,
        };
        let moving = Scene {
            motion: motion.motion(),
            ..Scene::clone(&stage.scene)
        };
        let beyond = self.driven.domain(&moving, plan.frames)?;
        run.beyond = beyond.map_or_else(Vec::new, |beyond| beyond.departures);
        let held = stage.scene.handles.select(stage.scene.mesh.positions());
        let path = motion.motion().bind(&held, rate)?;
        let stepper = self.driven.start(stage)?;
        let scene = Some(Arc::clone(&stage.scene));
        let mut watched = WatchedModel::new(stepper, &stage.cloth, rate, scene, plan.guard)?;
        let started = Instant::now();
        let mut stepped = || -> Result<(), DriveError> {
            for frame in 0..plan.frames {
                if self.is_stopped() {
                    return Ok(());
                }
                watched.step(&path.targets(frame, 1)?)?;
                // The next frame asks whether to go on.
                let _ = self.task.advance();
            }
            Ok(())
        };
        let result = stepped();
        let elapsed_ms = 1e3 * started.elapsed().as_secs_f64();
        strains.extend(watched.log().iter().map(|trust| trust.given.largest_strain));
        run.ms_per_frame = elapsed_ms / strains.len().max(1) as f64;
        run.guarded = watched.summary();
        result
    }
}

/// Sums up the runs of `mesh`, or of `all`.
#[must_use]
pub fn summary(mesh: &str, vertices: usize, runs: &[StressRun]) -> StressSummary {
    let here = || runs.iter().filter(|run| mesh == "all" || run.mesh == mesh);
    let stable = here().filter(|run| run.diverged_frame.is_none()).count();
    let strains: Vec<f64> = here()
        .map(|run| run.largest_strain.unwrap_or(f64::INFINITY))
        .collect();
    StressSummary {
        mesh: mesh.to_owned(),
        vertices,
        runs: strains.len(),
        stable,
        stable_share: stable as f64 / strains.len().max(1) as f64,
        guarded: GuardSummary::sum(here().map(|run| run.guarded)),
        strain_quantiles: QUANTILES
            .map(|share| quantile(strains.clone(), share).filter(|strain| strain.is_finite())),
    }
}

/// The value below which `share` of the others are, to the nearest; none of none.
#[must_use]
pub fn quantile(mut values: Vec<f64>, share: f64) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let last = values.len().checked_sub(1)?;
    values.get((share * last as f64).round() as usize).copied()
}

/// Writes a line per run (.csv).
///
/// # Errors
/// A file that cannot be written.
pub fn write_runs(path: &Path, runs: &[StressRun]) -> Result<(), WriteError> {
    let text = runs_csv(runs);
    write_atomically(path, |out| out.write_all(text.as_bytes()))
}

fn runs_csv(runs: &[StressRun]) -> String {
    let mut csv = Csv::new(
        "run,mesh,diverged_frame,largest_strain,frames,corrected,lost,largest_correction,ms_per_frame,failure",
    );
    for run in runs {
        let guarded = &run.guarded;
        csv.number(Some(run.number as f64));
        csv.texts([&run.mesh]);
        csv.number(run.diverged_frame.map(|frame| frame as f64));
        csv.number(run.largest_strain);
        csv.number(Some(guarded.frames as f64));
        csv.number(Some(guarded.corrected as f64));
        csv.number(Some(guarded.lost as f64));
        csv.number(Some(guarded.largest_correction));
        csv.number(Some(run.ms_per_frame));
        csv.texts([run.failure.as_deref().unwrap_or_default()]);
        csv.end();
    }
    csv.text()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(number: usize, mesh: &str, strain: Option<f64>) -> StressRun {
        StressRun {
            number,
            mesh: mesh.to_owned(),
            diverged_frame: strain.is_none().then_some(7),
            largest_strain: strain,
            guarded: GuardSummary {
                frames: 10,
                corrected: 2,
                lost: 1,
                lost_to_physics: 1,
                physics_failures: 0,
                pushed_apart: 0,
                lost_to_contact: 0,
                largest_correction: 0.001 * number as f64,
            },
            beyond: Vec::new(),
            failure: None,
            ms_per_frame: 1.0,
        }
    }

    #[test]
    fn names_and_failures_with_commas_and_quotes_are_quoted() {
        let mut one = run(3, "a, \"b\".obj", Some(0.5));
        one.failure = Some("frame 2: \"x\", lost".to_owned());
        let text = runs_csv(&[one]);
        let line = text.lines().nth(1).unwrap();
        let expected = "3,\"a, \"\"b\"\".obj\",,0.5,10,2,1,0.003,1,\"frame 2: \"\"x\"\", lost\"";
        assert_eq!(line, expected);
    }

    #[test]
    fn runs_are_summed_up_by_mesh() {
        let strains = [Some(0.4), Some(0.1), None, Some(0.2), Some(0.3)];
        let runs: Vec<StressRun> = strains
            .into_iter()
            .enumerate()
            .map(|(k, strain)| run(k, if k < 2 { "a" } else { "b" }, strain))
            .collect();
        let all = summary("all", 4, &runs);
        assert_eq!((all.runs, all.stable, all.stable_share), (5, 4, 0.8));
        // A run that failed counts as the most strained.
        let expected = [Some(0.1), Some(0.2), Some(0.3), Some(0.4), None, None];
        assert_eq!(all.strain_quantiles, expected);
        assert_eq!((all.guarded.lost, all.guarded.frames), (5, 50));
        assert_eq!(all.guarded.share(), 0.3);
        let a = summary("a", 4, &runs);
        assert_eq!((a.runs, a.stable), (2, 2));
        assert_eq!(a.guarded.largest_correction, 0.001);
        assert_eq!(summary("c", 4, &runs).strain_quantiles, [None; 6]);
    }
}
