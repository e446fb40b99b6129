//! Convergence studies: how far the physics is from its own converged motion, by substeps and by
//! integrator.
//!
//! A **case** is a scene with a material and a motion. Its **reference** is a run with so many
//! substeps that it counts as the truth; its states are kept in f64. From **starts** spread over
//! that run, each a true state, every **rival** (an integrator with so many substeps) runs for the
//! longest of the **horizons**, and is measured against the reference at each of them. A second
//! reference run with half the substeps tells the error of the first. Where **whole runs** are
//! asked for, each method also runs from the first frame of the case to the last.
//!
//! Runs are the work of one thread each, so that all numbers but the times are the same for any
//! number of threads. Times are taken afterwards, from runs that have the machine for themselves.
//!
//! `settings` checks what is asked for, `reference` makes and keeps the truth, `runs`, `whole` and
//! `deviation` measure, `order` and `outcome` sum up, `report` writes.

mod case;
mod deviation;
mod error;
mod method;
mod order;
mod outcome;
mod reference;
mod report;
mod runner;
mod runs;
mod settings;
mod whole;

use std::path::{Path, PathBuf};

use rayon::prelude::*;
use selvedge_data::SavedState;

pub use self::case::Case;
pub use self::deviation::Deviation;
pub use self::error::{ChoiceError, ConvergenceError};
pub use self::method::{Method, NamedIntegrator};
pub use self::outcome::{CaseOutcome, Mean, Outcome, Run, Series};
pub use self::report::{TABLES, report};
pub use self::settings::{Plan, Settings};
pub use self::whole::WholeRun;

use self::deviation::Gauge;
use self::reference::{Reference, ReferenceJob};
use self::runs::{Bench, TimedFrames, milliseconds};
use self::settings::Window;
use crate::event::{End, OnEvent, Reporter, Task};
use crate::folder;
use crate::workers;

/// A case on the way: its reference is kept in a file, or is to be made.
struct Prepared<'a> {
    case: &'a Case,
    window: &'a Window,
    /// The file of its reference.
    path: PathBuf,
    /// The start of a reference that is to be made.
    start: Option<SavedState>,
}

/// A case that is measured, but for its times.
struct Measured {
    outcome: CaseOutcome,
    /// A true state in the middle, from which frames are timed.
    middle: SavedState,
}

/// Makes the study; references are kept in the folder `references`, which is made, and which the
/// caller has claimed. What was measured until the listener asks to stop is in the answer.
///
/// # Errors
/// A scene that comes to no rest, a reference run that fails, or a file that cannot be written. A
/// rival that fails is no error.
pub fn run(
    plan: &Plan,
    references: &Path,
    on_event: &mut OnEvent<'_>,
) -> Result<Outcome, ConvergenceError> {
    let reporter = Reporter::new(on_event);
    folder::make_folder(references)?;
    let mut outcome = Outcome {
        settings: plan.settings.clone(),
        cases: Vec::new(),
        kept: 0,
        end: End::Interrupted,
    };
    let Some(prepared) = prepare(plan, references, &reporter)? else {
        return Ok(outcome);
    };
    outcome.kept = prepared.iter().filter(|job| job.start.is_none()).count();
    let solves = plan.solves(&prepared);
    let task = reporter.count("running from true states", solves, "substeps");
    let measured = workers::share(plan.settings.threads, &prepared, |job| {
        plan.measure(job, &task)
    })?;
    drop(task);
    let mut measured: Vec<Measured> = measured.into_iter().flatten().collect();
    let timed = plan.time(&mut measured, &reporter);
    let is_whole = |case: &Measured| {
        let mut series = case.outcome.rivals.iter().chain([&case.outcome.half]);
        case.outcome.starts.len() == plan.settings.starts
            && (!plan.settings.whole || series.all(|series| series.whole.is_some()))
    };
    if timed == End::Complete && measured.len() == prepared.len() && measured.iter().all(is_whole) {
        outcome.end = End::Complete;
    }
    outcome.cases = measured.into_iter().map(|case| case.outcome).collect();
    Ok(outcome)
}

/// Looks for kept references, and finds the starts of those that are to be made. None where an end
/// is asked for.
fn prepare<'a>(
    plan: &'a Plan,
    references: &Path,
    reporter: &Reporter<'_>,
) -> Result<Option<Vec<Prepared<'a>>>, ConvergenceError> {
    let method = &plan.settings.reference;
    let mut prepared: Vec<Prepared<'a>> = Vec::with_capacity(plan.cases.len());
    for (case, window) in &plan.cases {
        if reporter.is_stopped() {
            return Ok(None);
        }
        let path = reference::path(references, case, method)?;
        let kept = reference::open(&path, case, method, window.last);
        let start = match kept {
            Some(_) => None,
            None => match start_of(case, &prepared, reporter) {
                Err(_) if reporter.is_stopped() => return Ok(None),
                start => Some(start?),
            },
        };
        prepared.push(Prepared {
            case,
            window,
            path,
            start,
        });
    }
    Ok(Some(prepared))
}

/// The start of `case`: that of one before it, where only the motion differs.
fn start_of(
    case: &Case,
    before: &[Prepared<'_>],
    reporter: &Reporter<'_>,
) -> Result<SavedState, ConvergenceError> {
    let mut same = before.iter().filter(|other| other.case.rests_as(case));
    match same.find_map(|other| other.start.clone()) {
        Some(start) => Ok(start),
        None => case.start(reporter),
    }
}

impl Plan {
    /// Substeps of all runs that are to be made.
    fn solves(&self, prepared: &[Prepared<'_>]) -> usize {
        let settings = &self.settings;
        let half = settings.half();
        let methods = settings.rivals.iter().chain([&half]);
        let per_frame: usize = methods.map(|method| method.substeps as usize).sum();
        let of = |job: &Prepared<'_>| {
            let frames = job.start.as_ref();
            let frames = frames.map_or(0, |start| job.window.last.saturating_sub(start.frame));
            let first = job.case.first_frame();
            let whole = usize::from(settings.whole) * job.window.last.saturating_sub(first);
            frames * settings.reference.substeps as usize
                + (job.window.starts.len() * settings.longest() + whole) * per_frame
        };
        prepared.iter().map(of).sum()
    }

    /// Measures a case. None where an end is asked for before a start is done.
    fn measure(
        &self,
        job: &Prepared<'_>,
        task: &Task<'_, '_>,
    ) -> Result<Option<Measured>, ConvergenceError> {
        let Some(reference) = self.reference(job, task)? else {
            return Ok(None);
        };
        let settings = &self.settings;
        let bench = Bench {
            case: job.case,
            reference: &reference,
            gauge: Gauge::of(job.case.scene()),
            horizons: &settings.horizons,
            task,
        };
        let half = settings.half();
        let methods: Vec<&Method> = std::iter::once(&half).chain(&settings.rivals).collect();
        // A start counts when all methods have run from it.
        let starts = job.window.starts.par_iter();
        let runs: Vec<Option<Vec<Run>>> = starts
            .map(|&start| {
                let runs = methods.iter().map(|method| bench.run(method, start));
                runs.collect()
            })
            .collect();
        let runs: Vec<Vec<Run>> = runs.into_iter().flatten().collect();
        let wholes = self.wholes(job, &bench, &methods);
        let frames = job.window.last - job.case.first_frame();
        // What goes beyond a training was looked at when the plan was made.
        let beyond = |method: &Method| job.case.beyond(method, frames).ok().flatten();
        let series = |number: usize| Series {
            method: methods[number].clone(),
            whole: wholes.get(number).cloned().flatten(),
            beyond: beyond(methods[number]),
            runs: runs
                .iter()
                .map(|of_start| of_start[number].clone())
                .collect(),
            ms_per_frame: None,
        };
        let starts: Vec<usize> = runs.iter().map(|of_start| of_start[0].start).collect();
        let Some(middle) = starts.get(starts.len() / 2) else {
            return Ok(None);
        };
        let middle = reference.saved(*middle);
        Ok(Some(Measured {
            middle: middle.ok_or_else(|| vanished(job))?,
            outcome: CaseOutcome {
                name: job.case.name.clone(),
                vertices: job.case.scene().mesh.positions().len(),
                last: job.window.last,
                half: series(0),
                rivals: (1..methods.len()).map(series).collect(),
                starts,
            },
        }))
    }

    /// The whole run of each of `methods`; nothing where none are asked for.
    fn wholes(
        &self,
        job: &Prepared<'_>,
        bench: &Bench<'_, '_>,
        methods: &[&Method],
    ) -> Vec<Option<Result<WholeRun, String>>> {
        if !self.settings.whole {
            return Vec::new();
        }
        let (first, last) = (job.case.first_frame(), job.window.last);
        let methods = methods.par_iter();
        methods
            .map(|method| bench.whole(method, first, last))
            .collect()
    }

    fn reference(
        &self,
        job: &Prepared<'_>,
        task: &Task<'_, '_>,
    ) -> Result<Option<Reference>, ConvergenceError> {
        let (case, last) = (job.case, job.window.last);
        let method = &self.settings.reference;
        let Some(start) = &job.start else {
            let kept = reference::open(&job.path, case, method, last);
            return kept.ok_or_else(|| vanished(job)).map(Some);
        };
        let path = &job.path;
        let making = ReferenceJob {
            case,
            method,
            last,
            path,
        };
        reference::make(&making, start.clone(), task)
    }

    /// Times the frames of every method on every case, one after another.
    fn time(&self, measured: &mut [Measured], reporter: &Reporter<'_>) -> End {
        let rivals = self.settings.rivals.len();
        let task = reporter.count("timing frames", measured.len() * rivals, "runs");
        let timed = TimedFrames {
            frames: self.settings.longest(),
            task: &task,
        };
        for case in measured {
            let planned = self
                .cases
                .iter()
                .find(|(other, _)| other.name == case.outcome.name);
            let Some((scene, _)) = planned else { continue };
            for series in &mut case.outcome.rivals {
                let one = workers::alone(Some(1), || {
                    milliseconds(scene, &series.method, &case.middle, &timed)
                });
                series.ms_per_frame = one.ok().flatten();
                if task.advance().is_break() {
                    return End::Interrupted;
                }
            }
        }
        End::Complete
    }
}

fn vanished(job: &Prepared<'_>) -> ConvergenceError {
    ConvergenceError::Vanished {
        path: job.path.clone(),
    }
}

#[cfg(test)]
mod tests;
