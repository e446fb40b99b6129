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
mod course;
mod horizons;
mod measures;
mod method;
mod plan;
mod run;
mod runner;
mod summary;
#[cfg(test)]
mod tests;
mod truth;

use std::collections::BTreeSet;

use anyhow::{Context, Result};
use rayon::prelude::*;
use selvedge_cloth::Checkpoint;
use thiserror::Error;

pub use self::case::{Case, RandomCases};
pub use self::horizons::Horizons;
pub use self::measures::{Errors, FrameErrors};
pub use self::method::{Kind, Method, Mover, PhysicsMethod};
pub use self::plan::{EvaluationPlan, check};
pub use self::run::{Evaluation, Run, Timing};
pub use self::summary::{Summary, richardson, summaries, time_of};

use self::case::{Meshes, Source};
use self::course::Course;
use self::measures::Gauge;
use self::runner::Runner;
use self::truth::{Prepared, Reference, Truth};
use crate::event::{End, OnEvent, Reporter, Task};
use crate::{folder, workers};

/// A choice of cases, methods or numbers that makes no sense; the message names the field and the
/// remedy.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{0}")]
pub struct ChoiceError(pub String);

/// Runs every method on every case. An interrupted evaluation has the starts from which every method
/// has run.
pub fn evaluate(
    plan: &EvaluationPlan<'_>,
    on_event: &mut OnEvent<'_>,
) -> Result<(Evaluation, End)> {
    let reporter = &Reporter::new(on_event);
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
    let task = reporter.count("evaluating", frames(plan, &prepared), "frames");
    // One case at a time for each thread: blocks of them would leave threads idle at the end.
    let jobs = prepared.par_iter().with_max_len(1);
    let runs = jobs.map(|prepared| {
        task.note(&prepared.case.name);
        on_case(plan, prepared, &task)
    });
    let pool = workers::pool(plan.threads)?;
    let runs: Vec<Vec<Run>> = pool.install(|| runs.collect::<Result<_>>())?;
    drop(task);
    let runs = runs.concat();
    if reporter.is_stopped() {
        return interrupted(runs);
    }
    match timings(plan, &prepared, reporter)? {
        Some(timings) => Ok((Evaluation { runs, timings }, End::Complete)),
        None => interrupted(runs),
    }
}

/// Names meshes and finds the starts of references that are to be made. None where an end is asked for.
fn prepare<'a>(
    plan: &EvaluationPlan<'a>,
    reporter: &Reporter<'_>,
) -> Result<Option<Vec<Prepared<'a>>>> {
    let mut meshes = Meshes::default();
    let mut all: Vec<Prepared<'a>> = Vec::with_capacity(plan.cases.len());
    for case in plan.cases {
        let on = plan.horizons.on(case)?;
        let (cloth, spec) = match &case.source {
            Source::Recorded(data, entry) => {
                let truth = data.read(entry)?;
                let spec = truth.provenance().scene.clone();
                (Some(truth.cloth().clone()), spec)
            }
            Source::Random(loaded, ..) | Source::Converged(loaded, _) => {
                let spec = loaded.spec.to_json();
                let spec = spec.context("the resolved scene as JSON")?;
                (truth::standing(&loaded.scene), spec)
            }
        };
        let start = match start_of_reference(plan, case, on.span[1], reporter) {
            Err(_) if reporter.is_stopped() => return Ok(None),
            found => found?,
        };
        if reporter.is_stopped() {
            return Ok(None);
        }
        let mesh = cloth.map(|cloth| meshes.name(&cloth, &spec));
        all.push(Prepared {
            case,
            on,
            mesh: mesh.unwrap_or_default(),
            start,
        });
    }
    Ok(Some(all))
}

/// The start of the reference of a case up to frame `last`; none where the reference is kept already,
/// or there is none.
fn start_of_reference(
    plan: &EvaluationPlan<'_>,
    case: &Case,
    last: usize,
    reporter: &Reporter<'_>,
) -> Result<Option<Checkpoint>> {
    let Source::Converged(loaded, method) = &case.source else {
        return Ok(None);
    };
    let reference = Reference {
        case,
        loaded,
        method,
        last,
    };
    if let Some(folder) = &plan.references
        && reference.is_kept(folder)?
    {
        return Ok(None);
    }
    let found = selvedge::Scene::from((**loaded).clone()).start(&mut reporter.listener())?;
    found
        .warnings
        .iter()
        .for_each(|warning| reporter.remark(warning));
    Ok(Some(found.state))
}

/// Frames of all runs that are to be made.
fn frames(plan: &EvaluationPlan<'_>, prepared: &[Prepared<'_>]) -> usize {
    let of_case = |job: &Prepared<'_>| {
        let on = &job.on;
        let whole = on.span[1] - on.span[0];
        let starts = on.starts.len() * on.frames.last().copied().unwrap_or(0);
        let runs = starts + usize::from(is_whole(plan, job.case)) * whole;
        runs * methods_on(plan, job.case).len() + job.start.as_ref().map_or(0, |_| whole)
    };
    prepared.iter().map(of_case).sum()
}

fn is_whole(plan: &EvaluationPlan<'_>, case: &Case) -> bool {
    plan.horizons.whole || !case.has_truth()
}

/// Every method from every start of a case, and its whole runs.
fn on_case(
    plan: &EvaluationPlan<'_>,
    prepared: &Prepared<'_>,
    task: &Task<'_, '_>,
) -> Result<Vec<Run>> {
    let on = &prepared.on;
    let methods = methods_on(plan, prepared.case);
    if task.is_stopped() {
        return Ok(Vec::new());
    }
    let [first, last] = on.span;
    let Some(truth) = truth_of(plan, prepared, task)? else {
        return Ok(Vec::new());
    };
    let course = Course {
        prepared,
        truth: &truth,
        gauge: Gauge::of(truth.trajectory.cloth()),
        task,
    };
    let all: Vec<usize> = (1..=last - first).collect();
    let starts = on
        .starts
        .iter()
        .map(|&start| (start, &on.frames[..], false));
    let whole = is_whole(plan, prepared.case).then_some((first, &all[..], true));
    let jobs: Vec<(usize, &[usize], bool)> = starts.chain(whole).collect();
    // A start counts when all methods have run from it.
    let of_start = |&(start, frames, is_whole): &(usize, &[usize], bool)| -> Option<Vec<Run>> {
        let methods = methods.iter();
        let runs = methods.map(|method| course.run(method, start, frames, is_whole));
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
    task: &Task<'_, '_>,
) -> Result<Option<Truth>> {
    let with_scene = plan.methods.iter().any(Method::wants_scene);
    prepared.truth(with_scene, plan.references.as_deref(), task)
}

/// The time of a frame of each method on the first case of each mesh, from its middle on. None where
/// an end is asked for.
fn timings(
    plan: &EvaluationPlan<'_>,
    prepared: &[Prepared<'_>],
    reporter: &Reporter<'_>,
) -> Result<Option<Vec<Timing>>> {
    let mut found: Vec<Timing> = Vec::new();
    let mut meshes = BTreeSet::new();
    let first = prepared.iter().filter(|job| meshes.insert(&job.mesh));
    let first: Vec<&Prepared<'_>> = first.collect();
    let one = workers::pool(Some(1))?;
    let task = reporter.count("timing frames", first.len() * plan.methods.len(), "runs");
    for job in first {
        let Some(truth) = truth_of(plan, job, &task)? else {
            return Ok(None);
        };
        for method in plan.methods {
            let [first, last] = job.on.span;
            let middle = first + (last - first) / 2;
            let start = if job.case.has_truth() { middle } else { first };
            let time = || {
                let runner = Runner::start(method, job, &truth, start).ok()?;
                runner.milliseconds(last - start, reporter)
            };
            // A method that cannot run has a row that says why.
            if let Some(ms_per_frame) = one.install(time) {
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
pub fn own_errors(runs: &[Run], order: u32) -> Vec<(usize, f64)> {
    let half = runs.iter().filter(|run| run.kind == Kind::Reference);
    let half: Vec<&Run> = half.collect();
    let summaries = summaries(&half);
    let after = summaries.iter().flat_map(|summary| &summary.after);
    let error = |at: &FrameErrors| {
        let difference = at.errors?.position_rmse;
        Some((at.frame, richardson(difference, order)))
    };
    after.filter_map(error).collect()
}
