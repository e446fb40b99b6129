//! Conformance of a [`Stepper`] or a [`Correctable`]: checks of the trait's contract, for the tests
//! of every crate that implements it, which take this file as a module of their own. They panic at the
//! first breach, as assertions do.
//!
//! Two steppers made alike take the same good steps. One of them is also given steps that must
//! fail; from then on the two must still agree to the last bit.

#![allow(
    dead_code,
    unreachable_pub,
    reason = "the tests of a crate need some of the checks"
)]

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use glam::{DVec3, Vec3};

use selvedge_cloth::{
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
/// # Panics
/// At the first breach.
pub fn check<S: Stepper>(make: impl Fn() -> S, handles_end: HandlesEnd) {
    let mut pair = Pair::new(&make, handles_end);
    pair.look();
    pair.good();
    pair.good();
    let count = pair.start.len();
    pair.wrong_count(count + 1);
    if count > 0 {
        pair.wrong_count(count - 1);
        pair.far();
    }
    pair.good();
    pair.rewound();
    for wait in WAITS.map(Duration::from_micros) {
        pair.stopped(wait);
        pair.good();
    }
    // Last: a handle that takes hold again may be elsewhere.
    if count > 0 {
        pair.release(count - 1);
    }
}

/// Checks that steps of a stepper that `make` makes end with [`StepError::Stopped`] while that is
/// wanted. Every stepper may do without, which [`check`] allows.
///
/// # Panics
/// At the first breach.
pub fn check_stop<S: Stepper>(make: impl Fn() -> S) {
    let mut pair = Pair::new(&make, HandlesEnd::Elsewhere);
    pair.good();
    let frame = pair.tried.frame();
    pair.stopped(Duration::ZERO);
    assert_eq!(pair.tried.frame(), frame, "the step was accepted");
    pair.good();
}

/// Checks correctable steppers as [`check`] does; also steps that are undone and frames that are
/// not finite, which must be refused.
///
/// # Panics
/// At the first breach.
pub fn check_correctable<S: Correctable>(make: impl Fn() -> S, handles_end: HandlesEnd) {
    check(&make, handles_end);
    let mut pair = Pair::new(&make, handles_end);
    pair.good();
    pair.undone(false);
    pair.good();
    pair.undone(true);
    pair.good();
    let lost = vec![Vec3::NAN; pair.topology.vertex_count()];
    let frame = pair.tried.frame();
    let replaced = pair.tried.replace_frame(&lost);
    pair.refuses(replaced, frame);
    let taken = pair.tried.take_frame(&lost);
    pair.refuses(taken, frame + 1);
    pair.good();
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

    /// Places of the handles in the next good step `[m]`, `[handles]`.
    fn next(&self) -> Vec<DVec3> {
        let moved = STEP * (self.tried.frame() + 1) as f64;
        self.start.iter().map(|p| *p + moved).collect()
    }

    /// The stepper that also fails takes a step that must succeed.
    fn alone(&mut self) -> HandleTargets {
        let targets = targets(self.next(), None);
        done(self.tried.step(&targets));
        targets
    }

    /// A step that must succeed.
    fn good(&mut self) {
        let expected = self.tried.frame() + 1;
        let targets = self.alone();
        self.follow(&targets, expected);
    }

    /// The spared stepper takes the step that the other one has taken; both must agree.
    fn follow(&mut self, targets: &HandleTargets, expected: usize) {
        done(self.spared.step(targets));
        assert_eq!(self.tried.frame(), expected, "the frame count");
        self.look();
        let mut pairs = self.tried.positions().iter().zip(self.spared.positions());
        let other = pairs.position(|(a, b)| a != b);
        assert_eq!(other, None, "after steps that failed the motion is another");
        if self.handles_end == HandlesEnd::Elsewhere {
            return;
        }
        let places = self.handles.of(self.tried.positions());
        for (handle, (found, target)) in places.zip(targets.end()).enumerate() {
            let is_there = !targets.holds(handle) || found == target.as_vec3();
            assert!(is_there, "handle {handle} is at {found}, not at {target}");
        }
    }

    /// A step with `count` targets, which must be refused for it.
    fn wrong_count(&mut self, count: usize) {
        let mut places = self.next();
        places.resize(count, DVec3::ZERO);
        let (expected, found) = (self.start.len(), count);
        match self.refused(places, None) {
            Some(StepError::Handles { source, .. }) => {
                assert_eq!(source, HandleError::Count { expected, found });
            }
            other => panic!("{count} targets for {expected} handles: {other:?}"),
        }
    }

    /// A step to places that f32 does not reach.
    fn far(&mut self) {
        let refused = self.refused(vec![DVec3::splat(FAR); self.start.len()], None);
        let is_right = refused.is_some() || self.handles_end == HandlesEnd::Elsewhere;
        assert!(is_right, "a step beyond f32 was accepted");
    }

    /// A step that lets a handle go, which may be refused.
    fn release(&mut self, handle: usize) {
        match self.refused(self.next(), Some(handle)) {
            None => {}
            Some(StepError::Handles { .. }) => self.good(),
            Some(other) => panic!("a handle let go: {other}"),
        }
    }

    /// Goes on by two steps from a snapshot and back to it, where the stepper has any; what is no
    /// snapshot of it is refused. The two steps are taken again.
    fn rewound(&mut self) {
        let Some(snapshot) = self.tried.snapshot() else {
            return;
        };
        let frame = self.tried.frame();
        self.alone();
        self.alone();
        match self.tried.rewind(&Snapshot::of(())) {
            Err(StepError::Snapshot { frame: found }) => assert_eq!(found, frame + 2),
            other => panic!("what is no snapshot of it: {other:?}"),
        }
        done(self.tried.rewind(&snapshot));
        self.is_as_spared();
        self.good();
        self.good();
    }

    /// The stepper is as the other, which has taken no step meanwhile.
    fn is_as_spared(&self) {
        let is_same = self.tried.positions() == self.spared.positions()
            && self.tried.frame() == self.spared.frame();
        assert!(is_same, "the cloth is not as it was before");
    }

    /// A step that is to stop `wait` after its beginning. It is made whole or not at all.
    fn stopped(&mut self, wait: Duration) {
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
        let is_right = matches!(refused, None | Some(StepError::Stopped { .. }));
        assert!(is_right, "a step that is to stop: {refused:?}");
    }

    /// A step that may fail. If so, gives the error, which must name the right frame and leave the
    /// cloth as it was; if not, the spared stepper follows.
    fn refused(&mut self, places: Vec<DVec3>, free: Option<usize>) -> Option<StepError> {
        let expected = self.tried.frame() + 1;
        let targets = targets(places, free);
        let Err(error) = self.tried.step(&targets) else {
            self.follow(&targets, expected);
            return None;
        };
        self.unchanged(&error, expected);
        Some(error)
    }

    /// Checks the cloth after `error`, which must name frame `expected`: it is as it was.
    fn unchanged(&self, error: &StepError, expected: usize) {
        assert_eq!(error.frame(), expected, "the frame that the error names");
        self.is_as_spared();
        self.look();
    }

    /// Positions are as many as vertices and finite; topology and handles are as at the start.
    fn look(&self) {
        let positions = self.tried.positions();
        assert_eq!(positions.len(), self.topology.vertex_count(), "positions");
        let lost = positions.iter().position(|p| !p.is_finite());
        assert_eq!(lost, None, "a vertex is not finite");
        let is_same = *self.tried.topology() == self.topology;
        let is_same = is_same && *self.tried.handles() == self.handles;
        assert!(is_same, "the topology or the handles are others");
    }
}

impl<S: Correctable> Pair<S> {
    /// A step that is undone, twice: the second time there is nothing to undo.
    fn undone(&mut self, is_replaced: bool) {
        self.alone();
        if is_replaced {
            let raised = self.tried.positions().iter().map(|p| *p + 0.001 * Vec3::Y);
            let raised: Vec<Vec3> = raised.collect();
            done(self.tried.replace_frame(&raised));
        }
        self.tried.undo_step();
        self.tried.undo_step();
        self.is_as_spared();
    }

    /// Checks that a frame was refused with an error of frame `expected`.
    fn refuses(&self, outcome: Result<(), StepError>, expected: usize) {
        match outcome {
            Ok(()) => panic!("a frame that is not finite was accepted"),
            Err(error) => self.unchanged(&error, expected),
        }
    }
}

/// Targets at these places, one handle of them let go.
fn targets(places: Vec<DVec3>, free: Option<usize>) -> HandleTargets {
    let released: Vec<bool> = (0..places.len()).map(|k| Some(k) == free).collect();
    let targets = HandleTargets::at_frame_end(places);
    let targets = match free {
        Some(_) => targets.and_then(|targets| targets.releasing(released)),
        None => targets,
    };
    targets.unwrap_or_else(|error| panic!("the stepper's own places are no targets: {error}"))
}

/// What must not fail.
fn done(outcome: Result<(), StepError>) {
    outcome.unwrap_or_else(|error| panic!("the step failed: {error}"));
}
