//! Errors of models, and of their naive rivals, along recorded trajectories: whole runs, and runs
//! of k steps from the truth.
//!
//! Everyone is a `Stepper`, starts from the trajectory's first frame or from a rest pose of its
//! own, and runs with the handles where they were recorded. Every run is the work of one thread
//! from its start to its end, so that the numbers are the same for any number of threads; only the
//! time of a frame depends on the machine and is taken afterwards, from runs that have it for
//! themselves.
//!
//! What is measured stands in `measures`, errors over k steps in `horizons`, who runs in
//! `contestant`, means over motions in `summary`.

mod contestant;
mod horizons;
mod measures;
mod meshes;
mod summary;
mod timing;

use std::ops::ControlFlow;
use std::sync::Arc;

use selvedge_cloth::Scene;
use selvedge_cluster::{Ranks, Shard};
use selvedge_data::metrics::Character;
use selvedge_data::{Dataset, DatasetError, Entry, RecordingEnd, Split, Trajectory, metrics};
use serde::{Deserialize, Serialize};
use thiserror::Error;

pub use self::contestant::{Contestant, ContestantError, Racer, Who};
pub(crate) use self::horizons::spread;
pub use self::horizons::{Horizon, Horizons};
pub use self::measures::{Curves, MeasureError, Measures, STRAIN_LIMIT};
pub use self::summary::{Summary, summary};
pub use self::timing::Timing;

use self::contestant::{Course, Mirror, Mirrors, Scenes};
use self::meshes::Meshes;
use crate::cause::chain;
use crate::event::{End, OnEvent, Reporter, Task};
use crate::watched::{DIVERGED_FRAMES, DIVERGED_STRAIN, GuardSummary};
use crate::workers::{self, Crew, Packing, WorkerError};

/// A choice of motions or of numbers of steps that the data do not have.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct SelectionError(pub String);

/// An evaluation that failed as a whole.
#[derive(Debug, Error)]
#[error(transparent)]
#[allow(missing_docs, reason = "the messages are those of the parts")]
pub enum EvaluateError {
    Read(#[from] DatasetError),
    Threads(#[from] WorkerError),
}

/// Trajectories of a data set to run along.
pub struct TestData {
    /// Its name in tables.
    pub name: String,
    data: Dataset,
    entries: Vec<Entry>,
}

/// Contestants and the trajectories that they run along.
pub struct EvaluationPlan<'a> {
    /// One after another.
    pub data: &'a [TestData],
    /// In the order of a table.
    pub contestants: &'a [Contestant],
    /// Runs of k steps.
    pub horizons: &'a Horizons,
    /// Those who share the runs. Rank 0 has the outcome.
    pub crew: Crew,
    /// The part of the runs to be made, the first of which takes the times; all without one.
    pub part: Option<Shard>,
}

/// The outcome of an evaluation.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Evaluation {
    /// By data set, motion and contestant.
    pub rows: Vec<Row>,
    /// By mesh and contestant.
    pub timings: Vec<Timing>,
}

/// One contestant along one trajectory.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// The data set.
    pub data: String,
    /// The mesh, in words.
    pub mesh: String,
    /// The motion.
    pub motion: String,
    /// The contestant's name.
    pub name: String,
    /// The kind of the contestant.
    pub who: Who,
    /// Frames per second.
    pub frame_rate: f64,
    /// Of the whole run; none where it failed.
    pub measures: Option<Measures>,
    /// The first frame in which an edge strains over [`STRAIN_LIMIT`], or that was not reached.
    pub unstable_frame: Option<usize>,
    /// The first of more than ten frames in a row in which some edge strains over 30 %, or the
    /// first that was not reached.
    pub diverged_frame: Option<usize>,
    /// Counts of the guard in the whole run; none without a guard.
    pub guarded: Option<GuardSummary>,
    /// Errors over k steps from the truth.
    pub horizons: Vec<Horizon>,
    /// The character of the run's motion, and of its truth's; none where it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub character: Option<(Character, Character)>,
    /// Parts of the motion that a model was not trained on, in words, if its file says so much.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub beyond: Vec<String>,
    /// The reason where there are no measures.
    pub failure: Option<String>,
    /// Frame by frame, as far as the run went.
    pub curves: Curves,
}

/// A trajectory to run along, its mesh in words, and the mirror of its scene where somebody runs
/// there.
struct Trial<'a> {
    data: &'a TestData,
    entry: &'a Entry,
    mesh: String,
    mirror: Option<Result<Mirror, ContestantError>>,
    scene: Option<Arc<Scene>>,
}

impl Trial<'_> {
    fn course<'a>(&'a self, truth: &'a Trajectory) -> Course<'a> {
        Course {
            motion: &self.entry.motion,
            truth,
            mirror: self.mirror.as_ref(),
            scene: self.scene.as_ref(),
        }
    }
}

impl TestData {
    /// The trajectories of `split`, or those of `motions` where there are any.
    ///
    /// # Errors
    /// Wrong usage where there is no such motion, or none at all.
    pub fn new(
        name: String,
        data: Dataset,
        split: Split,
        motions: &[String],
    ) -> Result<Self, SelectionError> {
        let entries = data.entries(split);
        for motion in motions {
            if !entries.iter().any(|entry| entry.motion == *motion) {
                let known: Vec<&str> = entries.iter().map(|e| e.motion.as_str()).collect();
                let known = known.join(", ");
                let problem = format!("motion {motion}: the split of data set {name} has {known}");
                return Err(SelectionError(problem));
            }
        }
        let is_chosen = |entry: &&Entry| motions.is_empty() || motions.contains(&entry.motion);
        let entries: Vec<Entry> = entries.iter().filter(is_chosen).cloned().collect();
        if entries.is_empty() {
            let problem = format!("data set {name}: the split has no trajectories");
            return Err(SelectionError(problem));
        }
        Ok(Self {
            name,
            data,
            entries,
        })
    }
}

/// Runs every contestant along every trajectory. An interrupted evaluation has the rows of the runs
/// that were done.
///
/// # Errors
/// A trajectory that cannot be read. A run that fails is a row that says so.
pub fn evaluate(
    plan: &EvaluationPlan<'_>,
    on_event: &mut OnEvent<'_>,
) -> Result<(Evaluation, End), EvaluateError> {
    measure(plan, &Reporter::new(on_event))
}

/// As [`evaluate`], within a longer operation.
pub(crate) fn measure(
    plan: &EvaluationPlan<'_>,
    reporter: &Reporter<'_>,
) -> Result<(Evaluation, End), EvaluateError> {
    let trials = trials(plan, reporter)?;
    let jobs: Vec<(&Trial<'_>, &Contestant)> = trials
        .iter()
        .flat_map(|trial| plan.contestants.iter().map(move |who| (trial, who)))
        .enumerate()
        .filter(|(job, _)| plan.part.is_none_or(|part| part.has(*job)))
        .map(|(_, job)| job)
        .collect();
    let steps = jobs.iter().map(|(trial, contestant)| {
        let runs_from_truth = contestant.who() == Who::Model;
        let more = if runs_from_truth {
            plan.horizons.steps_in(trial.entry.frames)
        } else {
            0
        };
        trial.entry.frames.saturating_sub(1) + more
    });
    let ranks = &plan.crew.ranks;
    // The share of a rank, about.
    let frames = steps.sum::<usize>().div_ceil(ranks.count());
    let task = reporter.count("evaluating", frames, "frames");
    let rows = workers::share_with(&plan.crew, &jobs, &PACKING, |(trial, contestant)| {
        task.note(&format!("{}, {}", contestant.name, trial.entry.motion));
        let work = Work { task: &task, ranks };
        run(trial, contestant, plan.horizons, work)
    })?;
    drop(task);
    if !ranks.is_first() {
        return Ok((Evaluation::default(), End::Complete));
    }
    let are_all = rows.iter().all(Option::is_some);
    let rows: Vec<Row> = rows.into_iter().flatten().collect();
    if reporter.is_stopped() || !are_all {
        let timings = Vec::new();
        return Ok((Evaluation { rows, timings }, End::Interrupted));
    }
    let timings = match plan.part {
        Some(part) if part.number() > 1 => Vec::new(),
        _ => timings(plan, &trials, reporter)?,
    };
    if reporter.is_stopped() {
        // The last of them is of fewer frames than it should be.
        let timings = Vec::new();
        return Ok((Evaluation { rows, timings }, End::Interrupted));
    }
    Ok((Evaluation { rows, timings }, End::Complete))
}

/// Checks that every k fits into at least one trajectory.
///
/// # Errors
/// Wrong usage, with the longest k that there may be.
pub fn check_horizons(data: &[TestData], horizons: &Horizons) -> Result<(), SelectionError> {
    let frames = data.iter().flat_map(|data| &data.entries).map(|e| e.frames);
    let most = frames.max().unwrap_or(0).saturating_sub(1);
    match horizons.steps.iter().find(|steps| **steps > most) {
        None => Ok(()),
        Some(steps) => {
            let problem =
                format!("steps: {steps} fit into no trajectory: the longest has {most} steps");
            Err(SelectionError(problem))
        }
    }
}

fn trials<'a>(
    plan: &EvaluationPlan<'a>,
    reporter: &Reporter<'_>,
) -> Result<Vec<Trial<'a>>, EvaluateError> {
    let is_mirror = |contestant: &Contestant| contestant.who() == Who::Mirror;
    let with_mirror = plan.contestants.iter().any(is_mirror);
    let with_scene = plan.contestants.iter().any(Contestant::wants_scene);
    let (mut mirrors, mut scenes) = (Mirrors::default(), Scenes::default());
    let mut meshes = Meshes::default();
    let mut trials = Vec::new();
    for data in plan.data {
        for entry in &data.entries {
            // Read here for its mesh and scene, and again where it is run along: all may not fit.
            let truth = data.data.read(entry)?;
            let mirror = with_mirror.then(|| mirrors.of(&truth, reporter));
            trials.push(Trial {
                data,
                entry,
                mesh: meshes.name(&truth),
                mirror,
                scene: with_scene.then(|| scenes.of(&truth)).flatten(),
            });
        }
    }
    Ok(trials)
}

/// Rows travel between ranks as they are kept in files.
const PACKING: Packing<Row> = Packing {
    pack: |row| serde_json::to_vec(row).unwrap_or_default(),
    unpack: |bytes| serde_json::from_slice(bytes).ok(),
};

/// Runs under way on a rank.
#[derive(Clone, Copy)]
struct Work<'a, 't, 'l> {
    task: &'a Task<'t, 'l>,
    ranks: &'a Ranks,
}

impl Work<'_, '_, '_> {
    fn is_stopped(self) -> bool {
        self.task.is_stopped() || self.ranks.is_halted()
    }

    fn advance(self) -> ControlFlow<()> {
        match self.ranks.is_halted() {
            true => ControlFlow::Break(()),
            false => self.task.advance(),
        }
    }
}

/// One contestant along one trajectory; none where an end was asked for.
fn run(
    trial: &Trial<'_>,
    contestant: &Contestant,
    horizons: &Horizons,
    work: Work<'_, '_, '_>,
) -> Result<Option<Row>, EvaluateError> {
    let truth = trial.data.data.read(trial.entry)?;
    let on_frame = &mut || work.advance();
    let mut row = Row {
        data: trial.data.name.clone(),
        mesh: trial.mesh.clone(),
        motion: trial.entry.motion.clone(),
        name: contestant.name.clone(),
        who: contestant.who(),
        frame_rate: truth.frame_rate(),
        measures: None,
        unstable_frame: None,
        diverged_frame: None,
        guarded: None,
        horizons: Vec::new(),
        character: None,
        beyond: Vec::new(),
        failure: None,
        curves: Curves::default(),
    };
    let told = fill(&mut row, trial, contestant, &truth, horizons, on_frame);
    if let Err(error) = told {
        row.failure = Some(chain(&error));
    }
    Ok((!work.is_stopped()).then_some(row))
}

fn fill(
    row: &mut Row,
    trial: &Trial<'_>,
    contestant: &Contestant,
    truth: &Trajectory,
    horizons: &Horizons,
    on_frame: &mut dyn FnMut() -> ControlFlow<()>,
) -> Result<(), ContestantError> {
    let course = trial.course(truth);
    row.beyond = contestant.beyond(&course)?;
    let mut runner = contestant.runner(&course, 0)?;
    let recording = runner.run(truth.frame_count() - 1, on_frame);
    row.guarded = runner.guarded();
    row.curves = Curves::of(truth, &recording.positions)?;
    let reached = row.curves.position_rmse.len();
    let strained = metrics::first_strained_frame(&row.curves.largest_strain, STRAIN_LIMIT);
    let strains = &row.curves.largest_strain;
    row.diverged_frame = metrics::diverged_frame(strains, DIVERGED_STRAIN, DIVERGED_FRAMES);
    match recording.end {
        RecordingEnd::Failed(error) => {
            row.diverged_frame = row.diverged_frame.or(Some(reached));
            row.unstable_frame = Some(strained.unwrap_or(reached));
            row.failure = Some(format!("frame {reached}: {}", chain(&error)));
        }
        RecordingEnd::Complete | RecordingEnd::Stopped => {
            row.unstable_frame = strained;
            row.measures = Some(Measures::of(truth, &recording.positions)?);
            let its = measures::character(truth, &recording.positions)?;
            row.character = Some((its, measures::character(truth, truth.positions())?));
        }
    }
    row.horizons = match contestant.who() {
        Who::Truth => Vec::new(),
        Who::Rigid | Who::Mirror | Who::Physics => {
            horizons.of_whole_run(&row.curves, truth.frame_count())
        }
        Who::Model => horizons.over_true_starts(truth, |start, steps| {
            let mut runner = contestant.runner(&course, start)?;
            Ok::<_, ContestantError>(runner.run(steps, on_frame).positions)
        })?,
    };
    Ok(())
}

/// The time of a frame, of each contestant on the first trajectory of each mesh.
fn timings(
    plan: &EvaluationPlan<'_>,
    trials: &[Trial<'_>],
    reporter: &Reporter<'_>,
) -> Result<Vec<Timing>, EvaluateError> {
    let mut found: Vec<Timing> = Vec::new();
    for trial in trials {
        let mesh = &trial.mesh;
        if found.iter().any(|timing| timing.mesh == *mesh) {
            continue;
        }
        let truth = trial.data.data.read(trial.entry)?;
        for contestant in plan.contestants.iter().filter(|c| c.who() != Who::Truth) {
            let time = || {
                let mut runner = contestant.runner(&trial.course(&truth), 0).ok()?;
                timing::milliseconds(&mut runner, truth.frame_count() - 1, reporter)
            };
            // Who cannot run has a row that says why.
            if let Some(ms_per_frame) = workers::alone(plan.crew.threads, time)? {
                found.push(Timing {
                    mesh: mesh.clone(),
                    name: contestant.name.clone(),
                    who: contestant.who(),
                    ms_per_frame,
                });
            }
        }
    }
    Ok(found)
}

#[cfg(test)]
mod tests;
