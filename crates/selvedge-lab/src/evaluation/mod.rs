//! One way of measuring methods: every [`Method`] runs on every [`Case`], from true states spread
//! over its motion, and from its first frame to its last.
//!
//! A case is a recorded trajectory, a scene whose converged physics is the truth, or a random
//! motion without a truth. The **error after k frames** is that at the k-th frame of a run that
//! started in a true state (and, for a network, with the true frames before it); where several k
//! are asked for they are taken from the same runs. A **whole run** starts in the first frame and is
//! measured in every frame. Runs become rows of one table, `errors.csv`; [`summaries`] are their
//! means over starts and then over cases.
//!
//! Each run is the work of one thread, so that the numbers are the same for any number of threads;
//! only the time of a frame depends on the machine, and is taken afterwards on one thread from runs
//! that have the machine for themselves.

mod case;
mod error;
mod measures;
mod method;
mod run;
mod runner;
mod summary;
#[cfg(test)]
mod tests;
mod truth;
mod watch;

use std::ops::ControlFlow;
use std::path::PathBuf;

use glam::{DVec3, Vec3};
use rayon::prelude::*;
use selvedge_cloth::Scene;
use selvedge_data::metrics::{self, Character};
use selvedge_data::{Frames, Trajectory};
use selvedge_model::{Departure, Model};
use serde::{Deserialize, Serialize};
use serde_json::Value;

pub use self::case::{Case, RandomCases};
pub use self::error::{ChoiceError, EvaluateError};
pub use self::measures::{Errors, FrameErrors};
pub use self::method::{Kind, Method, Mover, PhysicsMethod};
pub use self::run::{Evaluation, Run, Timing};
pub use self::summary::{Summary, richardson, summaries, time_of};

use self::case::{Meshes, Source};
use self::measures::Gauge;
use self::runner::Runner;
use self::truth::{Prepared, Reference, Truth};
use self::watch::Watch;
use crate::cause::chain;
use crate::domain::{self, DomainError};
use crate::event::{End, OnEvent, Reporter};
use crate::folder;
use crate::physics;
use crate::watched::{DIVERGED_FRAMES, DIVERGED_STRAIN};
use crate::workers::{self, Crew, Packing};

/// Runs from true states, and whole runs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Horizons {
    /// Frames k after the start at which errors are taken, rising; those that do not fit into a case
    /// are left out there.
    pub frames: Vec<usize>,
    /// True states per case from which runs start, spread evenly.
    pub starts: usize,
    /// Each method also runs from the first frame to the last.
    pub whole: bool,
    /// Frame of the first start; by default the first of the case.
    pub from: Option<usize>,
    /// Frame in which the last run ends; by default the last of the case.
    pub to: Option<usize>,
}

/// An evaluation to be made.
pub struct EvaluationPlan<'a> {
    /// In the order of tables.
    pub cases: &'a [Case],
    /// In the order of tables.
    pub methods: &'a [Method],
    /// The runs.
    pub horizons: &'a Horizons,
    /// The folder in which converged runs are kept; without it they are made anew.
    pub references: Option<PathBuf>,
    /// Those who share the cases. Rank 0 has the outcome.
    pub crew: Crew,
}

impl Horizons {
    /// Frames k where nobody asks for others.
    pub const USUAL: [usize; 7] = [1, 5, 10, 20, 50, 100, 200];

    /// Runs of `frames` from so many true states per case, and whole runs.
    #[must_use]
    pub fn new(frames: impl IntoIterator<Item = usize>, starts: usize) -> Self {
        let mut frames: Vec<usize> = frames.into_iter().collect();
        frames.sort_unstable();
        frames.dedup();
        Self {
            frames,
            starts,
            whole: true,
            from: None,
            to: None,
        }
    }

    /// The runs on a case.
    ///
    /// # Errors
    /// Frames that the case does not have.
    fn on(&self, case: &Case) -> Result<Starts, ChoiceError> {
        let [first, all] = case.span()?;
        let about = |problem: String| Err(ChoiceError(format!("{}: {problem}", case.name)));
        if !case.has_truth() {
            return Ok(Starts {
                starts: Vec::new(),
                frames: Vec::new(),
                span: [first, all],
            });
        }
        let (from, last) = (self.from.unwrap_or(first), self.to.unwrap_or(all));
        if from < first {
            return about(format!(
                "from: the run begins in frame {first}, after {from}: choose a later frame"
            ));
        }
        if last > all {
            return about(format!(
                "to: the motion has {all} frames, fewer than {last}: choose an earlier frame"
            ));
        }
        let fits = |k: &&usize| from + **k <= last;
        let frames: Vec<usize> = self.frames.iter().filter(fits).copied().collect();
        let starts = frames.last().map_or_else(Vec::new, |longest| {
            let room = last - from - longest;
            spread(room, self.starts.min(room + 1))
        });
        Ok(Starts {
            starts: starts.into_iter().map(|start| from + start).collect(),
            frames,
            span: [first, last],
        })
    }
}

/// The runs on a case.
struct Starts {
    /// Frames of the starts, rising.
    starts: Vec<usize>,
    /// Frames after them at which errors are taken.
    frames: Vec<usize>,
    /// The first frame and the last of whole runs.
    span: [usize; 2],
}

/// `count` numbers from 0 to `last`, spread evenly; the middle where there is one.
fn spread(last: usize, count: usize) -> Vec<usize> {
    match count {
        0 => Vec::new(),
        1 => vec![last / 2],
        count => (0..count).map(|k| k * last / (count - 1)).collect(),
    }
}

/// Checks that a plan makes sense before any work; horizons that nobody asked for (the usual ones)
/// need not fit.
///
/// # Errors
/// Names the field or the case, and what would be right.
pub fn check(plan: &EvaluationPlan<'_>, are_asked: bool) -> Result<(), ChoiceError> {
    let wrong = |problem: String| Err(ChoiceError(problem));
    let horizons = plan.horizons;
    if plan.methods.is_empty() {
        return wrong("there is nothing to measure: name a model or physics".to_owned());
    }
    if horizons.starts == 0 || horizons.frames.first() == Some(&0) {
        return wrong("horizons, starts: give numbers of 1 at least".to_owned());
    }
    let mut longest = None;
    for (number, case) in plan.cases.iter().enumerate() {
        if plan.cases[..number]
            .iter()
            .any(|other| (&other.set, &other.name) == (&case.set, &case.name))
        {
            return wrong(format!(
                "two cases are called {:?}: give each a name",
                case.name
            ));
        }
        let starts = horizons.on(case)?;
        if case.has_truth() {
            let span = starts.span[1] - horizons.from.unwrap_or(starts.span[0]).min(starts.span[1]);
            longest = longest.max(Some(span));
        }
        if let Source::Converged(loaded, reference) = &case.source {
            check_reference(case, loaded, reference, plan.methods)?;
        }
        // Random motions are of one frame rate.
        let is_looked_at = number == 0 || case.has_truth();
        for method in plan.methods.iter().filter(|_| is_looked_at) {
            if let Mover::Model(model, ..) = &method.mover {
                let checked = departures(model, case, None);
                checked.map_err(|error| {
                    ChoiceError(format!("{:?} by {}: {error}", case.name, method.name))
                })?;
            }
        }
    }
    let does_not_fit = |k: &&usize| longest.is_some_and(|longest| **k > longest);
    match horizons.frames.iter().find(does_not_fit) {
        Some(k) if are_asked => wrong(format!(
            "horizons: {k} frames fit into no case: the longest has {}",
            longest.unwrap_or(0)
        )),
        _ => Ok(()),
    }
}

fn check_reference(
    case: &Case,
    loaded: &selvedge_data::LoadedScene,
    reference: &PhysicsMethod,
    methods: &[Method],
) -> Result<(), ChoiceError> {
    let substeps = reference.substeps;
    if substeps < 2 || substeps % 2 == 1 {
        return Err(ChoiceError(format!(
            "reference: a second run has half as many substeps, so that the number must be even, found {substeps}"
        )));
    }
    let own = reference.scene(&loaded.scene).physics;
    for method in methods {
        let Mover::Physics(physics) = &method.mover else {
            continue;
        };
        let its = physics.scene(&loaded.scene).physics;
        its.validate()
            .map_err(|error| ChoiceError(format!("scene {:?} by {physics}: {error}", case.name)))?;
        if its.integrator == own.integrator && its.substeps >= substeps {
            return Err(ChoiceError(format!(
                "reference: {physics} is no coarser than the reference, {reference}: ask for more substeps of the reference"
            )));
        }
    }
    Ok(())
}

/// Ways in which a case goes beyond the training of a model.
///
/// # Errors
/// A model of another frame rate, or a motion that cannot drive the handles.
fn departures(
    model: &Model,
    case: &Case,
    trajectory: Option<&Trajectory>,
) -> Result<Vec<Departure>, DomainError> {
    let of_scene = |scene: &Scene, frames| {
        let beyond = domain::of_scene(model, scene, frames)?;
        Ok(beyond.map_or_else(Vec::new, |beyond| beyond.departures))
    };
    match (&case.source, trajectory) {
        (Source::Converged(loaded, _) | Source::Random(loaded, ..), _) => {
            let frames = case.span().map_or(0, |[_, last]| last);
            of_scene(&loaded.scene, frames)
        }
        (Source::Recorded(..), Some(trajectory)) => {
            let found = domain::of_trajectory(model, &case.name, trajectory)?;
            Ok(found.unwrap_or_default())
        }
        (Source::Recorded(..), None) => Ok(Vec::new()),
    }
}

/// Runs every method on every case. An interrupted evaluation has the starts from which every method
/// has run.
///
/// # Errors
/// A plan that makes no sense, a trajectory that cannot be read, a scene that comes to no rest, a
/// reference run that fails.
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
    check(plan, false)?;
    if let Some(folder) = &plan.references {
        folder::make_folder(folder)?;
    }
    let interrupted = |runs| {
        let timings = Vec::new();
        Ok((Evaluation { runs, timings }, End::Interrupted))
    };
    let Some(prepared) = prepare(plan, reporter)? else {
        return interrupted(Vec::new());
    };
    let ranks = &plan.crew.ranks;
    // The share of a rank, about.
    let frames = frames(plan, &prepared)?.div_ceil(ranks.count());
    let task = reporter.count("evaluating", frames, "frames");
    let watch = Watch { task: &task, ranks };
    let runs = workers::share_with(&plan.crew, &prepared, &PACKING, |prepared| {
        task.note(&prepared.case.name);
        let runs = on_case(plan, prepared, watch)?;
        Ok::<_, EvaluateError>(Some(runs).filter(|_| !ranks.is_halted()))
    })?;
    drop(task);
    if !ranks.is_first() {
        return Ok((Evaluation::default(), End::Complete));
    }
    let are_all = runs.iter().all(Option::is_some);
    let runs: Vec<Run> = runs.into_iter().flatten().flatten().collect();
    if reporter.is_stopped() || !are_all {
        return interrupted(runs);
    }
    match timings(plan, &prepared, reporter)? {
        Some(timings) => Ok((Evaluation { runs, timings }, End::Complete)),
        None => interrupted(runs),
    }
}

/// Names meshes, finds the starts of references that are to be made, and the mirrored buckling
/// modes. None where an end is asked for.
fn prepare<'a>(
    plan: &EvaluationPlan<'a>,
    reporter: &Reporter<'_>,
) -> Result<Option<Vec<Prepared<'a>>>, EvaluateError> {
    let is_mirror = |method: &Method| matches!(method.mover, Mover::Mirror);
    let with_mirror = plan.horizons.whole && plan.methods.iter().any(is_mirror);
    let mut meshes = Meshes::default();
    // Rest poses in the mirrored mode, by the setting of the scene.
    let mut mirrored_rests: Vec<(Value, Vec<DVec3>)> = Vec::new();
    let mut all: Vec<Prepared<'a>> = Vec::with_capacity(plan.cases.len());
    for case in plan.cases {
        let (cloth, spec, start) = match &case.source {
            Source::Recorded(data, entry) => {
                let truth = data.read(entry)?;
                let spec = truth.provenance().scene.clone();
                (Some(truth.cloth().clone()), spec, None)
            }
            Source::Random(loaded, ..) => {
                let spec = loaded.spec.to_json().map_err(EvaluateError::Scene)?;
                (truth::standing(&loaded.scene), spec, None)
            }
            Source::Converged(loaded, method) => {
                let reference = Reference {
                    case,
                    loaded,
                    method,
                    last: plan.horizons.on(case)?.span[1],
                };
                let is_kept = match &plan.references {
                    Some(folder) => reference.is_kept(folder)?,
                    None => false,
                };
                let start = match is_kept {
                    true => None,
                    false => match Case::start(loaded, reporter) {
                        Err(_) if reporter.is_stopped() => return Ok(None),
                        start => Some(start?),
                    },
                };
                let spec = loaded.spec.to_json().map_err(EvaluateError::Scene)?;
                (truth::standing(&loaded.scene), spec, start)
            }
        };
        let mirror = with_mirror.then(|| {
            let known = mirrored_rests
                .iter()
                .find(|known| known.0 == spec["setting"]);
            let found = mirrored(case, known.map(|known| known.1.clone()), reporter);
            if let (None, Ok((_, rest))) = (known, &found) {
                mirrored_rests.push((spec["setting"].clone(), rest.clone()));
            }
            found
        });
        if reporter.is_stopped() {
            return Ok(None);
        }
        let mesh = cloth.map(|cloth| meshes.name(&cloth, &spec));
        all.push(Prepared {
            case,
            mesh: mesh.unwrap_or_default(),
            start,
            mirror,
        });
    }
    Ok(Some(all))
}

/// The scene of a case in the mirrored buckling mode: with the sign of its bulge turned, and its
/// rest pose, where that is not `known`.
fn mirrored(
    case: &Case,
    known: Option<Vec<DVec3>>,
    reporter: &Reporter<'_>,
) -> Result<(Scene, Vec<DVec3>), String> {
    let mut scene = match &case.source {
        Source::Converged(loaded, _) | Source::Random(loaded, ..) => loaded.scene.clone(),
        Source::Recorded(data, entry) => {
            let trajectory = data.read(entry).map_err(|error| chain(&error))?;
            truth::built(&truth::spec_of(&trajectory)?, &trajectory)?
        }
    };
    scene.sag.bulge = -scene.sag.bulge;
    if let Some(rest) = known {
        return Ok((scene, rest));
    }
    let rest = physics::find_rest_pose(&scene, reporter).map_err(|error| chain(&error))?;
    Ok((scene, rest.positions))
}

/// Frames of all runs that are to be made.
fn frames(plan: &EvaluationPlan<'_>, prepared: &[Prepared<'_>]) -> Result<usize, ChoiceError> {
    let mut count = 0;
    for job in prepared {
        let on = plan.horizons.on(job.case)?;
        let whole = on.span[1] - on.span[0];
        let starts = on.starts.len() * on.frames.last().copied().unwrap_or(0);
        let runs = starts + usize::from(is_whole(plan, job.case)) * whole;
        count += runs * plan.methods.len() + job.start.as_ref().map_or(0, |_| whole);
    }
    Ok(count)
}

fn is_whole(plan: &EvaluationPlan<'_>, case: &Case) -> bool {
    plan.horizons.whole || !case.has_truth()
}

/// Runs of a case travel between ranks as they are kept in files.
const PACKING: Packing<Vec<Run>> = Packing {
    pack: |runs| serde_json::to_vec(runs).unwrap_or_default(),
    unpack: |bytes| serde_json::from_slice(bytes).ok(),
};

/// Every method from every start of a case, and its whole runs.
fn on_case(
    plan: &EvaluationPlan<'_>,
    prepared: &Prepared<'_>,
    watch: Watch<'_, '_, '_>,
) -> Result<Vec<Run>, EvaluateError> {
    let on = plan.horizons.on(prepared.case)?;
    let methods = methods_on(plan, prepared.case);
    if watch.task.is_stopped() {
        return Ok(Vec::new());
    }
    let [first, last] = on.span;
    let Some(truth) = truth_of(plan, prepared, &on, watch)? else {
        return Ok(Vec::new());
    };
    let course = Course {
        prepared,
        truth: &truth,
        gauge: Gauge::of(truth.trajectory.cloth()),
        watch,
    };
    let mut jobs: Vec<(usize, Span<'_>)> = Vec::new();
    jobs.extend(on.starts.iter().map(|&start| (start, Span::At(&on.frames))));
    jobs.extend(is_whole(plan, prepared.case).then_some((first, Span::Whole(last - first))));
    // A start counts when all methods have run from it.
    let of_start = |&(start, span): &(usize, Span<'_>)| -> Option<Vec<Run>> {
        let runs_here = |(method, _): &&(Method, Kind)| {
            !matches!((&method.mover, span), (Mover::Mirror, Span::At(_)))
        };
        let methods = methods.iter().filter(runs_here);
        let runs = methods.map(|(method, kind)| course.run(method, *kind, start, span));
        runs.collect()
    };
    let runs: Vec<Option<Vec<Run>>> = jobs.par_iter().map(of_start).collect();
    Ok(runs.into_iter().flatten().flatten().collect())
}

/// The methods, and for a converged case the reference's with half its substeps.
fn methods_on(plan: &EvaluationPlan<'_>, case: &Case) -> Vec<(Method, Kind)> {
    let own = plan.methods.iter();
    let mut all: Vec<(Method, Kind)> = own.map(|m| (m.clone(), m.kind())).collect();
    if let Source::Converged(_, reference) = &case.source {
        let half = Method::physics(PhysicsMethod {
            substeps: reference.substeps / 2,
            ..reference.clone()
        });
        all.push((half, Kind::Reference));
    }
    all
}

fn truth_of(
    plan: &EvaluationPlan<'_>,
    prepared: &Prepared<'_>,
    on: &Starts,
    watch: Watch<'_, '_, '_>,
) -> Result<Option<Truth>, EvaluateError> {
    let with_scene = plan.methods.iter().any(Method::wants_scene);
    let references = plan.references.as_deref();
    prepared.truth(on.span[1], with_scene, references, watch)
}

/// Frames of a run that are measured.
#[derive(Clone, Copy)]
enum Span<'a> {
    /// So many frames after the start.
    At(&'a [usize]),
    /// Every frame of so many.
    Whole(usize),
}

/// A case that is run along.
struct Course<'a, 't, 'l> {
    prepared: &'a Prepared<'a>,
    truth: &'a Truth,
    gauge: Gauge<'a>,
    watch: Watch<'a, 't, 'l>,
}

impl Course<'_, '_, '_> {
    /// Runs `method` from the true state of frame `start`. None where an end is asked for.
    fn run(&self, method: &Method, kind: Kind, start: usize, span: Span<'_>) -> Option<Run> {
        let case = self.prepared.case;
        let mut run = Run {
            set: case.set.clone(),
            case: case.name.clone(),
            mesh: self.prepared.mesh.clone(),
            method: method.name.clone(),
            kind,
            start,
            is_whole: matches!(span, Span::Whole(_)),
            frame_rate: self.truth.trajectory.frame_rate(),
            frames: Vec::new(),
            diverged_frame: None,
            guarded: None,
            character: None,
            out_of_distribution: Vec::new(),
            failure: None,
        };
        match self.steps(method, span, &mut run) {
            Ok(ControlFlow::Continue(())) => {}
            Ok(ControlFlow::Break(())) => return None,
            Err(problem) => run.failure = Some(problem),
        }
        if let Span::Whole(frames) = span {
            let strains: Vec<f64> = run.frames.iter().map(|at| at.largest_strain).collect();
            let diverged = metrics::diverged_frame(&strains, DIVERGED_STRAIN, DIVERGED_FRAMES);
            // The first strain is that after the first step.
            let diverged = diverged.map(|frame| frame + 1);
            let lost = (strains.len() < frames).then_some(strains.len() + 1);
            run.diverged_frame = diverged.or(lost);
        }
        Some(run)
    }

    fn steps(
        &self,
        method: &Method,
        span: Span<'_>,
        run: &mut Run,
    ) -> Result<ControlFlow<()>, String> {
        let (case, truth) = (self.prepared.case, self.truth);
        if let (Mover::Model(model, ..), true) = (&method.mover, run.is_whole) {
            let found = departures(model, case, Some(&truth.trajectory));
            run.out_of_distribution = found.map_err(|error| chain(&error))?;
        }
        let mut runner = Runner::start(method, self.prepared, truth, run.start)?;
        let mut positions: Vec<Vec3> = Vec::new();
        let mut keep = |now: &[DVec3]| {
            if run.is_whole && case.has_truth() {
                positions.extend(physics::rounded(now));
            }
        };
        keep(&runner.positions());
        let frames = match span {
            Span::At(frames) => frames.last().copied().unwrap_or(0),
            Span::Whole(frames) => frames,
        };
        for frame in 1..=frames {
            if self.watch.advance().is_break() {
                return Ok(ControlFlow::Break(()));
            }
            runner
                .step()
                .map_err(|problem| format!("frame {}: {problem}", run.start + frame))?;
            run.guarded = runner.guarded();
            let is_measured = match span {
                Span::At(frames) => frames.contains(&frame),
                Span::Whole(_) => true,
            };
            if is_measured {
                let found = runner.positions();
                let expected = truth.positions(run.start + frame);
                let expected = expected.filter(|_| case.has_truth());
                let at = self.gauge.measure(frame, &found, expected.as_deref());
                if !at.is_finite() {
                    return Err(format!("frame {frame} has a measure that is not finite"));
                }
                run.frames.push(at);
                keep(&found);
            }
        }
        if !positions.is_empty() {
            let trajectory = &truth.trajectory;
            let from = run.start - truth.first;
            let true_frames = trajectory.frames().last(trajectory.frame_count() - from);
            let true_frames = true_frames.first(frames + 1);
            let found = Frames::new(&positions, trajectory.vertex_count());
            let found = found.map_err(|error| chain(&error))?;
            let [found, expected] = [found, true_frames].map(|frames| {
                let (cloth, rate) = (trajectory.cloth(), trajectory.frame_rate());
                Character::of(frames, cloth, rate).map_err(|error| chain(&error))
            });
            run.character = Some((found?, expected?));
        }
        Ok(ControlFlow::Continue(()))
    }
}

/// The time of a frame of each method on the first case of each mesh, from its middle on. None where
/// an end is asked for.
fn timings(
    plan: &EvaluationPlan<'_>,
    prepared: &[Prepared<'_>],
    reporter: &Reporter<'_>,
) -> Result<Option<Vec<Timing>>, EvaluateError> {
    let mut found: Vec<Timing> = Vec::new();
    let mut meshes: Vec<&str> = Vec::new();
    let first = prepared.iter().filter(|job| {
        let is_new = !meshes.contains(&job.mesh.as_str());
        meshes.push(&job.mesh);
        is_new
    });
    let first: Vec<&Prepared<'_>> = first.collect();
    let task = reporter.count("timing frames", first.len() * plan.methods.len(), "runs");
    for job in first {
        let on = plan.horizons.on(job.case)?;
        let watch = Watch {
            task: &task,
            ranks: &plan.crew.ranks,
        };
        let Some(truth) = truth_of(plan, job, &on, watch)? else {
            return Ok(None);
        };
        for method in plan.methods {
            let [first, last] = on.span;
            let start = match (&method.mover, job.case.has_truth()) {
                (Mover::Mirror, _) | (_, false) => first,
                _ => first + (last - first) / 2,
            };
            let time = || {
                let runner = Runner::start(method, job, &truth, start).ok()?;
                runner.milliseconds(last - start, reporter)
            };
            // A method that cannot run has a row that says why.
            if let Some(ms_per_frame) = workers::alone(Some(1), time)? {
                found.push(Timing {
                    mesh: job.mesh.clone(),
                    method: method.name.clone(),
                    kind: method.kind(),
                    ms_per_frame,
                });
            }
            if task.advance().is_break() {
                return Ok(None);
            }
        }
    }
    Ok(Some(found))
}

/// The reference's own position error after each number of frames `[m]`, from a run with half its
/// substeps; nothing where there is none.
#[must_use]
pub fn own_errors(runs: &[Run], order: u32) -> Vec<(usize, f64)> {
    let half: Vec<&Run> = runs
        .iter()
        .filter(|run| run.kind == Kind::Reference)
        .collect();
    let summaries = summaries(&half);
    let after = summaries.iter().flat_map(|summary| &summary.after);
    let error = |at: &FrameErrors| {
        let difference = at.errors?.position_rmse;
        Some((at.frame, richardson(difference, order)))
    };
    after.filter_map(error).collect()
}
