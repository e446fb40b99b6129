//! Runs from true states, and the time of a frame.

use std::time::{Duration, Instant};

use selvedge_cloth::Scene;
use selvedge_data::{Drive, SavedState};

use super::case::Case;
use super::deviation::{Deviation, Gauge, Strains};
use super::method::Method;
use super::outcome::Run;
use super::reference::{Reference, State};
use super::runner::{KnownFrames, Runner};
use crate::event::Task;

/// Time after which there are frames enough to know how long one takes.
const PATIENCE: Duration = Duration::from_secs(2);

/// A case with its truth.
pub(super) struct Bench<'a, 'l> {
    pub(super) case: &'a Case,
    pub(super) reference: &'a Reference,
    pub(super) gauge: Gauge<'a>,
    /// Rising.
    pub(super) horizons: &'a [usize],
    pub(super) task: &'a Task<'a, 'l>,
}

impl Bench<'_, '_> {
    /// Runs `method` from the true state of frame `start`. None where an end is asked for.
    pub(super) fn run(&self, method: &Method, start: usize) -> Option<Run> {
        let mut run = Run {
            start,
            deviations: Vec::with_capacity(self.horizons.len()),
            familiar: None,
            failure: None,
        };
        match self.steps(method, &mut run) {
            Ok(Finished::Yes) => {}
            Ok(Finished::Stopped) => return None,
            Err(problem) => run.failure = Some(problem),
        }
        Some(run)
    }

    fn steps(&self, method: &Method, run: &mut Run) -> Result<Finished, String> {
        let scene = self.case.scene_by(method);
        let mut runner = self.runner(method, &scene, run.start)?;
        let path = scene.handle_path().map_err(|error| error.to_string())?;
        let drive = Drive {
            path: &path,
            samples_per_frame: method.substeps as usize,
        };
        let mut strains = Strains::NONE;
        let mut familiar = 0.0;
        for k in 1..=self.horizons.last().copied().unwrap_or(0) {
            runner.step(drive)?;
            let frame = run.start + k;
            let truth = self.truth(frame)?;
            let found = runner.state();
            let found = State {
                positions: &found.positions,
                velocities: &found.velocities,
            };
            strains = strains.max(self.gauge.strains(truth, found));
            if self.horizons.contains(&k) {
                let deviation = self.gauge.deviation(truth, found, strains);
                check_finite(&deviation, frame)?;
                run.deviations.push(deviation);
            }
            familiar += runner.familiar().unwrap_or(0.0);
            run.familiar = runner.familiar().map(|_| familiar / k as f64);
            if self.task.advance_by(method.substeps).is_break() {
                return Ok(Finished::Stopped);
            }
        }
        Ok(Finished::Yes)
    }

    /// The true state of `frame`.
    ///
    /// # Errors
    /// A frame that the reference does not have, in words.
    pub(super) fn truth(&self, frame: usize) -> Result<State<'_>, String> {
        let state = self.reference.state(frame);
        state.ok_or_else(|| format!("the reference has no frame {frame}"))
    }

    /// A cloth of `scene`, which is by `method`, in the true state of `frame`.
    ///
    /// # Errors
    /// A state or a scene that cannot be run, in words.
    pub(super) fn runner(
        &self,
        method: &Method,
        scene: &Scene,
        frame: usize,
    ) -> Result<Runner, String> {
        let saved = self.reference.saved(frame);
        let saved = saved.ok_or_else(|| format!("the reference has no frame {frame}"))?;
        let known = KnownFrames {
            truth: &|frame| self.reference.state(frame).map(|state| state.positions),
            rest: self.case.rest_frame(),
        };
        Runner::start(method, scene, saved, known)
    }
}

/// The end of a run that did not fail.
pub(super) enum Finished {
    Yes,
    Stopped,
}

pub(super) fn check_finite(deviation: &Deviation, frame: usize) -> Result<(), String> {
    if deviation.values().iter().all(|value| value.is_finite()) {
        return Ok(());
    }
    Err(format!("frame {frame} has a measure that is not finite"))
}

/// The median time of a frame of `case` by `method` from `start` on one thread, over up to `frames`
/// frames `[ms]`; none where the first failed or an end is asked for.
pub(super) fn milliseconds(
    case: &Case,
    method: &Method,
    start: &SavedState,
    task: &TimedFrames<'_, '_>,
) -> Option<f64> {
    let scene = case.scene_by(method);
    // The time of a frame does not depend on the frames before it.
    let known = KnownFrames {
        truth: &|_| Some(start.positions.as_slice()),
        rest: Some(0),
    };
    let mut simulator = Runner::start(method, &scene, start.clone(), known).ok()?;
    let path = scene.handle_path().ok()?;
    let drive = Drive {
        path: &path,
        samples_per_frame: method.substeps as usize,
    };
    let begun = Instant::now();
    let mut times = Vec::with_capacity(task.frames);
    while times.len() < task.frames && begun.elapsed() < PATIENCE {
        if task.task.is_stopped() {
            return None;
        }
        let before = Instant::now();
        if simulator.step(drive).is_err() {
            break;
        }
        times.push(1e3 * before.elapsed().as_secs_f64());
    }
    times.sort_by(f64::total_cmp);
    times.get(times.len() / 2).copied()
}

/// Frames that are timed, and who may stop it.
pub(super) struct TimedFrames<'a, 'l> {
    /// At most, and at least 1.
    pub(super) frames: usize,
    pub(super) task: &'a Task<'a, 'l>,
}
