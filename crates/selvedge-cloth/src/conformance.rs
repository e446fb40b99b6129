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

use crate::{
    Correctable, HandleError, HandleTargets, Handles, Snapshot, StepError, Stepper, Stop, Topology,
};

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

/// Distance that a handle moves per good step `[m]`.
const STEP: DVec3 = DVec3::new(0.001, 0.0005, -0.0008);
/// Times after the beginning of a step at which it is to stop `[µs]`.
const WAITS: [u64; 4] = [0, 30, 200, 1000];
/// A coordinate that is finite in f64, but not in f32 `[m]`.
const FAR: f64 = 1e39;

/// Checks the steppers that `make` makes, all alike and at their start.
///
/// Up to fifteen steps follow small moves of the handles, so a recording needs at least sixteen
/// frames. Between them come steps with too few and too many targets, with targets too far away for
/// f32, steps that are to stop, before they begin or in the middle (which a stepper need not hear),
/// and one with a handle let go (which a stepper may refuse).
///
/// # Errors
/// The first [`Breach`].
pub fn check<S: Stepper>(make: impl Fn() -> S, handles_end: HandlesEnd) -> Result<(), Breach> {
    let mut pair = Pair::new(&make, handles_end);
    pair.tries("start", |pair| pair.look())?;
    pair.tries("first step", Pair::good)?;
    pair.tries("second step", Pair::good)?;
    let count = pair.start.len();
    pair.tries("one target too many", |pair| pair.wrong_count(count + 1))?;
    if count > 0 {
        pair.tries("one target too few", |pair| pair.wrong_count(count - 1))?;
        pair.tries("target beyond f32", Pair::far)?;
    }
    pair.tries("step after failures", Pair::good)?;
    pair.tries("snapshot that is gone back to", Pair::rewound)?;
    for wait in WAITS.map(Duration::from_micros) {
        pair.tries("step that is to stop", |pair| pair.stopped(wait))?;
        pair.tries("step after one that was to stop", Pair::good)?;
    }
    // Last: a handle that takes hold again may be elsewhere.
    if count > 0 {
        let trial = "step that lets the last handle go";
        pair.tries(trial, |pair| pair.release(count - 1))?;
    }
    Ok(())
}

/// Checks that steps of a stepper that `make` makes end with [`StepError::Stopped`] while that is
/// wanted. Every stepper may do without, which [`check`] allows.
///
/// # Errors
/// The first [`Breach`].
pub fn check_stop<S: Stepper>(make: impl Fn() -> S) -> Result<(), Breach> {
    let mut pair = Pair::new(&make, HandlesEnd::Elsewhere);
    pair.tries("first step", Pair::good)?;
    let frame = pair.tried.frame();
    pair.tries("step that is to stop", |pair| {
        pair.stopped(Duration::ZERO)?;
        if pair.tried.frame() == frame { Ok(()) } else { accepted() }
    })?;
    pair.tries("step after one that was to stop", Pair::good)
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
    pair.tries("first step", Pair::good)?;
    pair.tries("step that is undone", |pair| pair.undone(false))?;
    pair.tries("step after an undone one", Pair::good)?;
    pair.tries("replaced step that is undone", |pair| pair.undone(true))?;
    pair.tries("step after an undone replacement", Pair::good)?;
    let lost = vec![Vec3::NAN; pair.topology.vertex_count()];
    let frame = pair.tried.frame();
    pair.tries("replacement that is not finite", |pair| {
        let replaced = pair.tried.replace_frame(&lost);
        pair.refuses(replaced, frame)
    })?;
    pair.tries("taken frame that is not finite", |pair| {
        let taken = pair.tried.take_frame(&lost);
        pair.refuses(taken, frame + 1)
    })?;
    pair.tries("step after refused frames", Pair::good)
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

    /// Tries something, and names it where it shows a breach.
    fn tries(
        &mut self,
        trial: &'static str,
        run: impl FnOnce(&mut Self) -> Result<(), String>,
    ) -> Result<(), Breach> {
        run(self).map_err(|what| Breach { trial, what })
    }

    /// Targets of the next good step `[m]`, `[handles]`.
    fn next(&self) -> Vec<DVec3> {
        let moved = STEP * (self.tried.frame() + 1) as f64;
        self.start.iter().map(|p| *p + moved).collect()
    }

    /// A step that must succeed.
    fn good(&mut self) -> Result<(), String> {
        let expected = self.tried.frame() + 1;
        let targets = targets(self.next(), None)?;
        self.tried.step(&targets).map_err(failed)?;
        self.follow(&targets, expected)
    }

    /// The spared stepper takes the step that the other one has taken; both must agree.
    fn follow(&mut self, targets: &HandleTargets, expected: usize) -> Result<(), String> {
        self.spared.step(targets).map_err(failed)?;
        let found = self.tried.frame();
        if found != expected {
            return Err(format!("the frame count is {found}, expected {expected}"));
        }
        self.look()?;
        let mut pairs = self.tried.positions().iter().zip(self.spared.positions());
        if let Some(vertex) = pairs.position(|(a, b)| a != b) {
            return Err(format!(
                "after steps that failed, the motion is another one from vertex {vertex} on"
            ));
        }
        match self.handles_end {
            HandlesEnd::AtTargets => self.at_targets(targets),
            HandlesEnd::Elsewhere => Ok(()),
        }
    }

    fn at_targets(&self, targets: &HandleTargets) -> Result<(), String> {
        let places = self.handles.of(self.tried.positions());
        for (handle, (found, target)) in places.zip(targets.end()).enumerate() {
            let target = target.as_vec3();
            if targets.holds(handle) && found != target {
                return Err(format!(
                    "handle {handle} is at {found}, its target is {target}"
                ));
            }
        }
        Ok(())
    }

    /// A step with `count` targets, which must be refused for it.
    fn wrong_count(&mut self, count: usize) -> Result<(), String> {
        let mut places = self.next();
        places.resize(count, DVec3::ZERO);
        let (expected, found) = (self.start.len(), count);
        let reason = HandleError::Count { expected, found };
        match self.refused(places, None)? {
            Some(StepError::Handles { source, .. }) if source == reason => Ok(()),
            Some(source) => other_reason(&source),
            None => accepted(),
        }
    }

    /// A step to places that f32 does not reach.
    fn far(&mut self) -> Result<(), String> {
        let places = vec![DVec3::splat(FAR); self.start.len()];
        match self.refused(places, None)? {
            None if self.handles_end == HandlesEnd::AtTargets => accepted(),
            _ => Ok(()),
        }
    }

    /// A step that lets a handle go, which may be refused.
    fn release(&mut self, handle: usize) -> Result<(), String> {
        match self.refused(self.next(), Some(handle))? {
            None => Ok(()),
            Some(StepError::Handles { .. }) => self.good(),
            Some(source) => other_reason(&source),
        }
    }

    /// Goes on by two steps from a snapshot and back to it, where the stepper has any; what is no
    /// snapshot of it is refused. The two steps are taken again.
    fn rewound(&mut self) -> Result<(), String> {
        let Some(snapshot) = self.tried.snapshot() else {
            return Ok(());
        };
        let frame = self.tried.frame();
        for _ in 0..2 {
            let targets = targets(self.next(), None)?;
            self.tried.step(&targets).map_err(failed)?;
        }
        match self.tried.rewind(&Snapshot::of(())) {
            Err(StepError::Snapshot { frame: found }) if found == frame + 2 => {}
            Err(error) => return other_reason(&error),
            Ok(()) => return Err("what is no snapshot of it was accepted".to_owned()),
        }
        self.tried.rewind(&snapshot).map_err(failed)?;
        if self.tried.positions() != self.spared.positions() {
            return Err("the cloth is not as it was in the snapshot".to_owned());
        }
        self.good()?;
        self.good()
    }

    /// A step that is to stop `wait` after its beginning. It is made whole or not at all.
    fn stopped(&mut self, wait: Duration) -> Result<(), String> {
        let flag = Arc::new(AtomicBool::new(wait.is_zero()));
        self.tried.stop_by(Arc::clone(&flag).into());
        let refused = thread::scope(|scope| {
            scope.spawn(|| {
                thread::sleep(wait);
                flag.store(true, Ordering::Relaxed);
            });
            self.refused(self.next(), None)
        });
        self.tried.stop_by(Stop::default());
        match refused? {
            None | Some(StepError::Stopped { .. }) => Ok(()),
            Some(source) => other_reason(&source),
        }
    }

    /// A step that may fail. If so, gives the error, which must name the right frame and leave the
    /// cloth as it was; if not, the spared stepper follows.
    fn refused(
        &mut self,
        places: Vec<DVec3>,
        free: Option<usize>,
    ) -> Result<Option<StepError>, String> {
        let expected = self.tried.frame() + 1;
        let before = self.tried.positions().to_vec();
        let targets = targets(places, free)?;
        match self.tried.step(&targets) {
            Ok(()) => self.follow(&targets, expected).map(|()| None),
            Err(error) => {
                self.unchanged(&error, expected, &before)?;
                Ok(Some(error))
            }
        }
    }

    /// Checks the cloth after `error`, which must name frame `expected`: it is as it was `before`.
    fn unchanged(&self, error: &StepError, expected: usize, before: &[Vec3]) -> Result<(), String> {
        let found = error.frame();
        if found != expected {
            return Err(format!(
                "the error names frame {found}, the step was to frame {expected}"
            ));
        }
        let is_same = self.tried.positions() == before;
        if self.tried.frame() != self.spared.frame() || !is_same {
            return Err("the failed step changed positions or the frame count".to_owned());
        }
        self.look()
    }

    /// Positions are as many as vertices and finite; topology and handles are as at the start.
    fn look(&self) -> Result<(), String> {
        let positions = self.tried.positions();
        let (expected, found) = (self.topology.vertex_count(), positions.len());
        if expected != found {
            return Err(format!(
                "there are {found} positions of {expected} vertices"
            ));
        }
        if let Some(vertex) = positions.iter().position(|p| !p.is_finite()) {
            return Err(format!("the position of vertex {vertex} is not finite"));
        }
        if *self.tried.topology() != self.topology || *self.tried.handles() != self.handles {
            return Err("the topology or the handles are no longer those of the start".to_owned());
        }
        Ok(())
    }
}

impl<S: Correctable> Pair<S> {
    /// A step that is undone, twice: the second time there is nothing to undo.
    fn undone(&mut self, is_replaced: bool) -> Result<(), String> {
        let (before, frame) = (self.tried.positions().to_vec(), self.tried.frame());
        let targets = targets(self.next(), None)?;
        self.tried.step(&targets).map_err(failed)?;
        if is_replaced {
            let raised = self.tried.positions().iter().map(|p| *p + 0.001 * Vec3::Y);
            let raised: Vec<Vec3> = raised.collect();
            self.tried.replace_frame(&raised).map_err(failed)?;
        }
        self.tried.undo_step();
        self.tried.undo_step();
        if self.tried.frame() != frame || self.tried.positions() != before {
            return Err("the cloth is not as it was before the step that was undone".to_owned());
        }
        Ok(())
    }

    /// Checks that a frame was refused with an error of frame `expected`.
    fn refuses(&self, outcome: Result<(), StepError>, expected: usize) -> Result<(), String> {
        match outcome {
            Ok(()) => accepted(),
            Err(error) => self.unchanged(&error, expected, self.spared.positions()),
        }
    }
}

/// Targets at these places, one handle of them let go.
fn targets(places: Vec<DVec3>, free: Option<usize>) -> Result<HandleTargets, String> {
    let released: Vec<bool> = (0..places.len()).map(|k| Some(k) == free).collect();
    let targets = HandleTargets::at_frame_end(places);
    let targets = match free {
        Some(_) => targets.and_then(|targets| targets.releasing(released)),
        None => targets,
    };
    targets.map_err(|source| format!("the stepper's own places are no targets: {source}"))
}

/// What is wrong with a step that should have failed.
fn accepted<T>() -> Result<T, String> {
    Err("the step was accepted".to_owned())
}

/// What is wrong with a step that failed as it should not have.
fn other_reason<T>(source: &StepError) -> Result<T, String> {
    Err(format!("the step failed for another reason: {source}"))
}

/// What is wrong with a step that fails where it must not.
fn failed(source: StepError) -> String {
    format!("the step failed: {source}")
}

#[cfg(test)]
mod tests;
