//! Conformance of a [`Stepper`] or a [`Correctable`]: one check of the trait's contract, for the
//! tests of every crate that implements it.
//!
//! Two steppers made alike take the same good steps. One of them is also given steps that must
//! fail; from then on the two must still agree to the last bit.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use glam::{DVec3, Vec3};
use thiserror::Error;

use crate::{Correctable, HandleError, HandleTargets, Handles, StepError, Stepper, Stop, Topology};

/// Position of the handles after a step.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HandlesEnd {
    /// At their targets, rounded to f32.
    AtTargets,
    /// Elsewhere: the stepper is a recording or a rigid body, or its handles are springs.
    Elsewhere,
}

/// A breach of the contract of [`Stepper`]: the step that showed it, and what was wrong.
#[derive(Clone, Debug, Error, PartialEq)]
#[error("{trial}: {what}")]
pub struct Breach {
    trial: &'static str,
    what: String,
}

/// A breach that `trial` showed.
fn breach<T>(trial: &'static str, what: impl Into<String>) -> Result<T, Breach> {
    let what = what.into();
    Err(Breach { trial, what })
}

/// The breach of a step that should have failed.
fn accepted<T>(trial: &'static str) -> Result<T, Breach> {
    breach(trial, "the step was accepted")
}

/// The breach of a step that failed as it should not have.
fn other_reason<T>(trial: &'static str, source: &StepError) -> Result<T, Breach> {
    breach(
        trial,
        format!("the step failed for another reason: {source}"),
    )
}

/// Distance that a handle moves per good step `[m]`.
const STEP: DVec3 = DVec3::new(0.001, 0.0005, -0.0008);
/// Times after the beginning of a step at which it is to stop `[µs]`.
const WAITS: [u64; 4] = [0, 30, 200, 1000];
/// A coordinate that is finite in f64, but not in f32 `[m]`.
const FAR: f64 = 1e39;

/// Checks the steppers that `make` makes, all alike and at their start.
///
/// Up to thirteen steps follow small moves of the handles, so a recording needs at least fourteen
/// frames. Between them come steps with too few and too many targets, with targets too far away for
/// f32, steps that are to stop, before they begin or in the middle (which a stepper need not hear),
/// and one with a handle let go (which a stepper may refuse).
///
/// # Errors
/// The first [`Breach`].
pub fn check<S: Stepper>(make: impl Fn() -> S, handles_end: HandlesEnd) -> Result<(), Breach> {
    let mut pair = Pair::new(&make, handles_end);
    pair.look("start")?;
    pair.good("first step")?;
    pair.good("second step")?;
    pair.wrong_count("one target too many", pair.start.len() + 1)?;
    if let Some(fewer) = pair.start.len().checked_sub(1) {
        pair.wrong_count("one target too few", fewer)?;
        pair.far("target beyond f32")?;
    }
    pair.good("step after failures")?;
    for wait in WAITS {
        pair.stopped("step that is to stop", Duration::from_micros(wait))?;
        pair.good("step after one that was to stop")?;
    }
    // Last: a handle that takes hold again may be elsewhere.
    if let Some(last) = pair.start.len().checked_sub(1) {
        pair.release("step that lets the last handle go", last)?;
    }
    Ok(())
}

/// Checks that steps of a stepper that `make` makes end with [`StepError::Stopped`] while that is
/// wanted. Every stepper may do without, which [`check`] allows.
///
/// # Errors
/// The first [`Breach`].
pub fn check_stop<S: Stepper>(make: impl Fn() -> S) -> Result<(), Breach> {
    let trial = "step that is to stop";
    let mut pair = Pair::new(&make, HandlesEnd::Elsewhere);
    pair.good("first step")?;
    let frame = pair.tried.frame();
    pair.stopped(trial, Duration::ZERO)?;
    match pair.tried.frame() == frame {
        true => pair.good("step after one that was to stop"),
        false => accepted(trial),
    }
}

/// Checks correctable steppers as [`check`] does; also steps that are undone and frames that are
/// not finite, which must be refused.
///
/// # Errors
/// The first [`Breach`].
pub fn check_correctable<S: Correctable>(
    make: impl Fn() -> S,
    handles_end: HandlesEnd,
) -> Result<(), Breach> {
    check(&make, handles_end)?;
    let mut pair = Pair::new(&make, handles_end);
    pair.good("first step")?;
    pair.undone("step that is undone", false)?;
    pair.good("step after an undone one")?;
    pair.undone("replaced step that is undone", true)?;
    pair.good("step after an undone replacement")?;
    let lost = vec![Vec3::NAN; pair.topology.vertex_count()];
    let frame = pair.tried.frame();
    let replaced = pair.tried.replace_frame(&lost);
    pair.refuses("replacement that is not finite", replaced, frame)?;
    let taken = pair.tried.take_frame(&lost);
    pair.refuses("taken frame that is not finite", taken, frame + 1)?;
    pair.good("step after refused frames")
}

/// Two steppers made alike.
struct Pair<S> {
    /// Also takes the steps that fail.
    tried: S,
    /// Takes only the steps that succeed.
    spared: S,
    topology: Topology,
    handles: Handles,
    /// Handles at the start `[m]`, `[handles]`.
    start: Vec<DVec3>,
    handles_end: HandlesEnd,
}

impl<S: Stepper> Pair<S> {
    fn new(make: &impl Fn() -> S, handles_end: HandlesEnd) -> Self {
        let tried = make();
        let places = tried.handles().of(tried.positions());
        Self {
            topology: tried.topology().clone(),
            handles: tried.handles().clone(),
            start: places.map(|p| p.as_dvec3()).collect(),
            tried,
            spared: make(),
            handles_end,
        }
    }

    /// Targets of the next good step `[m]`, `[handles]`.
    fn next(&self) -> Vec<DVec3> {
        let moved = STEP * (self.tried.frame() + 1) as f64;
        self.start.iter().map(|p| *p + moved).collect()
    }

    /// A step that must succeed.
    fn good(&mut self, trial: &'static str) -> Result<(), Breach> {
        let expected = self.tried.frame() + 1;
        let targets = targets(self.next(), None).map_err(refused(trial, expected))?;
        self.tried.step(&targets).map_err(failed(trial))?;
        self.follow(trial, &targets, expected)
    }

    /// The spared stepper takes the step that the other one has taken; both must agree.
    fn follow(
        &mut self,
        trial: &'static str,
        targets: &HandleTargets,
        expected: usize,
    ) -> Result<(), Breach> {
        self.spared.step(targets).map_err(failed(trial))?;
        let found = self.tried.frame();
        if found != expected {
            let what = format!("the frame count is {found}, expected {expected}");
            return breach(trial, what);
        }
        self.look(trial)?;
        self.compare(trial)?;
        match self.handles_end {
            HandlesEnd::AtTargets => self.at_targets(trial, targets),
            HandlesEnd::Elsewhere => Ok(()),
        }
    }

    fn at_targets(&self, trial: &'static str, targets: &HandleTargets) -> Result<(), Breach> {
        let places = self.handles.of(self.tried.positions());
        for (handle, (found, target)) in places.zip(targets.end()).enumerate() {
            let target = target.as_vec3();
            if targets.holds(handle) && found != target {
                let what = format!("handle {handle} is at {found}, its target is {target}");
                return breach(trial, what);
            }
        }
        Ok(())
    }

    /// A step with `count` targets, which must be refused for it.
    fn wrong_count(&mut self, trial: &'static str, count: usize) -> Result<(), Breach> {
        let mut places = self.next();
        places.resize(count, DVec3::ZERO);
        let (expected, found) = (self.start.len(), count);
        let reason = HandleError::Count { expected, found };
        match self.refused(trial, places, None)? {
            Some(StepError::Handles { source, .. }) if source == reason => Ok(()),
            Some(source) => other_reason(trial, &source),
            None => accepted(trial),
        }
    }

    /// A step to places that f32 does not reach.
    fn far(&mut self, trial: &'static str) -> Result<(), Breach> {
        let places = vec![DVec3::splat(FAR); self.start.len()];
        match self.refused(trial, places, None)? {
            None if self.handles_end == HandlesEnd::AtTargets => accepted(trial),
            _ => Ok(()),
        }
    }

    /// A step that lets a handle go, which may be refused.
    fn release(&mut self, trial: &'static str, handle: usize) -> Result<(), Breach> {
        match self.refused(trial, self.next(), Some(handle))? {
            None => Ok(()),
            Some(StepError::Handles { .. }) => self.good("step after a refused release"),
            Some(source) => other_reason(trial, &source),
        }
    }

    /// A step that is to stop `wait` after its beginning. It is made whole or not at all.
    fn stopped(&mut self, trial: &'static str, wait: Duration) -> Result<(), Breach> {
        let flag = Arc::new(AtomicBool::new(wait.is_zero()));
        self.tried.stop_by(Arc::clone(&flag).into());
        let refused = thread::scope(|scope| {
            scope.spawn(|| {
                thread::sleep(wait);
                flag.store(true, Ordering::Relaxed);
            });
            self.refused(trial, self.next(), None)
        });
        self.tried.stop_by(Stop::default());
        match refused? {
            None | Some(StepError::Stopped { .. }) => Ok(()),
            Some(source) => other_reason(trial, &source),
        }
    }

    /// A step that may fail. If so, gives the error, which must name the right frame and leave the
    /// cloth as it was; if not, the spared stepper follows.
    fn refused(
        &mut self,
        trial: &'static str,
        places: Vec<DVec3>,
        free: Option<usize>,
    ) -> Result<Option<StepError>, Breach> {
        let expected = self.tried.frame() + 1;
        let before = self.tried.positions().to_vec();
        let targets = targets(places, free).map_err(refused(trial, expected))?;
        match self.tried.step(&targets) {
            Ok(()) => self.follow(trial, &targets, expected).map(|()| None),
            Err(error) => {
                self.unchanged(trial, &error, expected, &before)?;
                Ok(Some(error))
            }
        }
    }

    /// Checks the cloth after `error`, which must name frame `expected`: it is as it was `before`.
    fn unchanged(
        &self,
        trial: &'static str,
        error: &StepError,
        expected: usize,
        before: &[Vec3],
    ) -> Result<(), Breach> {
        let found = error.frame();
        if found != expected {
            let what = format!("the error names frame {found}, the step was to frame {expected}");
            return breach(trial, what);
        }
        let is_same = self.tried.positions() == before;
        if self.tried.frame() != self.spared.frame() || !is_same {
            return breach(
                trial,
                "the failed step changed positions or the frame count",
            );
        }
        self.look(trial)
    }

    /// Positions are as many as vertices and finite; topology and handles are as at the start.
    fn look(&self, trial: &'static str) -> Result<(), Breach> {
        let positions = self.tried.positions();
        let (expected, found) = (self.topology.vertex_count(), positions.len());
        if expected != found {
            let what = format!("there are {found} positions of {expected} vertices");
            return breach(trial, what);
        }
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return breach(
                trial,
                format!("the position of vertex {vertex} is not finite"),
            );
        }
        if *self.tried.topology() != self.topology || *self.tried.handles() != self.handles {
            let what = "the topology or the handles are no longer those of the start";
            return breach(trial, what);
        }
        Ok(())
    }

    fn compare(&self, trial: &'static str) -> Result<(), Breach> {
        let mut pairs = self.tried.positions().iter().zip(self.spared.positions());
        match pairs.position(|(a, b)| a != b) {
            Some(vertex) => breach(
                trial,
                format!(
                    "after steps that failed, the motion is another one from vertex {vertex} on"
                ),
            ),
            None => Ok(()),
        }
    }
}

impl<S: Correctable> Pair<S> {
    /// A step that is undone, twice: the second time there is nothing to undo.
    fn undone(&mut self, trial: &'static str, is_replaced: bool) -> Result<(), Breach> {
        let (before, frame) = (self.tried.positions().to_vec(), self.tried.frame());
        let targets = targets(self.next(), None).map_err(refused(trial, frame + 1))?;
        self.tried.step(&targets).map_err(failed(trial))?;
        if is_replaced {
            let raised = self.tried.positions().iter().map(|p| *p + 0.001 * Vec3::Y);
            let raised: Vec<Vec3> = raised.collect();
            self.tried.replace_frame(&raised).map_err(failed(trial))?;
        }
        self.tried.undo_step();
        self.tried.undo_step();
        if self.tried.frame() != frame || self.tried.positions() != before {
            let what = "the cloth is not as it was before the step that was undone";
            return breach(trial, what);
        }
        Ok(())
    }

    /// Checks that a frame was refused with an error of frame `expected`.
    fn refuses(
        &self,
        trial: &'static str,
        outcome: Result<(), StepError>,
        expected: usize,
    ) -> Result<(), Breach> {
        match outcome {
            Ok(()) => accepted(trial),
            Err(error) => self.unchanged(trial, &error, expected, self.spared.positions()),
        }
    }
}

fn targets(places: Vec<DVec3>, free: Option<usize>) -> Result<HandleTargets, HandleError> {
    let released = (0..places.len()).map(|handle| Some(handle) == free);
    let released: Vec<bool> = released.collect();
    let targets = HandleTargets::at_frame_end(places)?;
    match free {
        Some(_) => targets.releasing(released),
        None => Ok(targets),
    }
}

/// The breach of a stepper that fails where it must not.
fn failed(trial: &'static str) -> impl Fn(StepError) -> Breach {
    move |source| Breach {
        trial,
        what: format!("the step failed: {source}"),
    }
}

/// The breach of a stepper whose own handle positions make no targets.
fn refused(trial: &'static str, frame: usize) -> impl Fn(HandleError) -> Breach {
    move |source| failed(trial)(StepError::Handles { frame, source })
}

#[cfg(test)]
mod tests;
