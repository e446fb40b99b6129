//! The guard: a stepper around a stepper that measures every frame and corrects it if necessary.
//!
//! A frame within its bounds is passed on bit for bit. The edges of a frame beyond them are brought
//! back; the inner stepper continues from the corrected frame. A lost frame is replaced by a step of
//! the physics from the last two frames, or without a scene by the last frame, carried by the
//! handles. So a step fails only for its caller (targets that do not fit, a recording that has
//! ended) or for a device. Edges stay too long where handles are farther apart than the cloth can
//! reach.
//!
//! Where the scene has contact, every frame that is corrected or good is held to it too: on its way
//! from the last frame no pair of features meets. Pairs that would are pushed apart; where that
//! does not end, the frame is lost. So no frame intersects, if the first one does not. Where the
//! physics cannot go on either, as with a handle led into an obstacle, the step fails.
//!
//! No failure of the physics is silent: it is in [`Trust::physics_failed`] and, with its reason, in
//! [`Guard::physics_failure`].

use std::str::FromStr;
use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::{
    Cloth, Correctable, HandleTargets, Handles, Scene, Snapshot, StepError, Stepper, Stop,
    Topology, VertexId, check_target_count,
};
use selvedge_sim::{Led, SimulatorError};
use thiserror::Error;

use crate::carry::carry;
use crate::gauge::Gauge;
use crate::limiter::{EdgeLimiter, LimitedEdge};
use crate::rescue::Physics;
use crate::trust::{ContactWord, Moved, Replacement, Trust, Verdict};

/// Strain (l - l₀)/l₀ of an edge above which a frame is lost: replaced, not corrected.
const LOST_STRAIN: f64 = 1.0;
/// Move of a vertex above which a frame is lost, in mean lengths of an edge.
const LOST_CORRECTION: f64 = 1.0;
/// Largest number of sweeps over all edges.
const SWEEPS: u32 = 1000;

/// Correction of a frame that is beyond its bounds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Correction {
    /// None: frames are measured, errors are passed on.
    None,
    /// Edges are brought back within their bounds.
    #[default]
    Limit,
}

impl Correction {
    /// Name, in all fronts: `none` or `limit`.
    pub fn name(self) -> &'static str {
        match self {
            Self::None => "none",
            Self::Limit => "limit",
        }
    }
}

impl FromStr for Correction {
    type Err = String;

    fn from_str(name: &str) -> Result<Self, String> {
        let mut all = [Self::None, Self::Limit].into_iter();
        let found = all.find(|one| one.name() == name);
        found.ok_or_else(|| format!("guard must be none or limit, found {name:?}"))
    }
}

/// Reason why a cloth cannot be guarded.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum GuardError {
    #[error("the cloth's {what} are not those that its stepper moves")]
    OtherCloth { what: &'static str },
    #[error(
        "the material length of the edge from vertex {from} to {to} must be positive, found {length} m"
    )]
    Length {
        from: VertexId,
        to: VertexId,
        length: f64,
    },
    #[error("the scene's {what} are not those of the cloth")]
    OtherScene { what: &'static str },
    #[error("the physics that is to hold frames to contact cannot be set up: {0}")]
    Physics(#[source] SimulatorError),
    #[error("frames cannot be held to contact: {0}")]
    Start(#[source] StepError),
}

/// Failure of the physics beside a guard.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum PhysicsFailure {
    /// The physics of the scene cannot be set up; it is not tried again.
    #[error("the physics cannot be set up: {0}")]
    SetUp(#[source] SimulatorError),
    /// A step failed.
    #[error(transparent)]
    Step(#[from] StepError),
}

/// A stepper under a guard.
pub struct Guard<S> {
    inner: S,
    correction: Correction,
    gauge: Gauge,
    limiter: EdgeLimiter,
    scene: Option<Arc<Scene>>,
    /// Physics of the scene; set up at the start where frames are held to contact, else at the first
    /// lost frame.
    physics: Option<Result<Physics, SimulatorError>>,
    physics_failure: Option<PhysicsFailure>,
    stop: Stop,
    /// True if frames are held to contact.
    is_held_apart: bool,
    /// The last two frames that were given on, the newest last `[m]`, `[vertices]`.
    last: [Vec<Vec3>; 2],
    next: Vec<Vec3>,
    trust: Trust,
}

impl<S: Correctable> Guard<S> {
    /// Guards `inner`, which moves `cloth` by `frame_rate` frames per second and stands still so
    /// far. With the `scene` of that cloth, lost frames are replaced by the physics.
    pub fn new(
        inner: S,
        cloth: &Cloth,
        frame_rate: f64,
        scene: Option<Arc<Scene>>,
        correction: Correction,
    ) -> Result<Self, GuardError> {
        if let Some(scene) = &scene {
            let found = moved_by(&inner, scene.mesh.topology(), &scene.handles);
            found.map_err(|what| GuardError::OtherScene { what })?;
        }
        moved_by(&inner, cloth.topology(), cloth.handles())
            .map_err(|what| GuardError::OtherCloth { what })?;
        let lengths = edge_lengths(cloth)?;
        let has_contact = scene.as_ref().is_some_and(|scene| scene.contact.is_some());
        let is_held_apart = has_contact && correction != Correction::None;
        let physics = match &scene {
            Some(scene) if is_held_apart => {
                let physics = Physics::new(scene).map_err(GuardError::Physics)?;
                let (frame, start) = (inner.frame(), inner.positions());
                let apart = physics.simulator.check_apart(frame, start);
                apart.map_err(GuardError::Start)?;
                Some(Ok(physics))
            }
            _ => None,
        };
        let edges = inner.topology().edges().iter();
        let ends: Vec<[u32; 2]> = edges.map(|edge| edge.vertices.map(|v| v.0)).collect();
        let is_handle = inner.handles().mask(cloth.vertex_count());
        let bounds = cloth.edge_bounds().into_iter();
        let limited = ends.iter().zip(bounds).map(|(&ends, bounds)| {
            let [least, most] = bounds.map(|length| length as f32);
            let inverse = ends.map(|v| 1.0 / cloth.vertex_mass()[v as usize]);
            LimitedEdge {
                ends,
                least,
                most,
                inverse,
            }
        });
        let start = inner.positions().to_vec();
        let mut guard = Self {
            limiter: EdgeLimiter::new(limited.collect(), is_handle),
            gauge: Gauge::new(ends, lengths, cloth.vertex_mass(), frame_rate),
            last: [start.clone(), start.clone()],
            next: start,
            inner,
            correction,
            scene,
            physics,
            is_held_apart,
            physics_failure: None,
            stop: Stop::default(),
            trust: Trust::default(),
        };
        guard.trust.frame = guard.inner.frame();
        guard.trust.given = guard.gauge.measure(&guard.last[0], &guard.last[1]);
        Ok(guard)
    }

    /// Trust in the newest frame.
    pub fn trust(&self) -> &Trust {
        &self.trust
    }

    /// Reason of the newest failure of the physics; none so far if there was none.
    pub fn physics_failure(&self) -> Option<&PhysicsFailure> {
        self.physics_failure.as_ref()
    }

    /// The stepper under guard.
    pub fn inner(&self) -> &S {
        &self.inner
    }

    /// Judges the frame that the inner stepper has made, and corrects it.
    fn judge(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let found = self.inner.positions();
        let given = self.gauge.measure(&self.last[1], found);
        let is_finite = given.largest_strain.is_finite() && given.largest_speed.is_finite();
        let predicted = is_finite.then_some(given);
        let holds = is_finite && self.limiter.holds(found);
        let is_lost = !is_finite || given.largest_strain > LOST_STRAIN;
        let replaced_by = Replacement::Nothing;
        self.trust = Trust {
            frame: self.inner.frame(),
            verdict: match (holds, is_lost) {
                (true, _) => Verdict::Held,
                (false, true) => Verdict::Lost { replaced_by },
                (false, false) => Verdict::Corrected,
            },
            physics_failed: false,
            is_strained: self.inner.is_strained(),
            contact: ContactWord::Free,
            predicted,
            given,
            correction: predicted.map(|_| Moved::default()),
        };
        self.next.clear();
        self.next.extend_from_slice(found);
        if self.correction == Correction::None {
            return Ok(());
        }
        if !holds {
            if self.trust.verdict.is_lost() || !self.correct() {
                self.replace(targets);
            }
            self.keep_apart(targets)?;
        } else {
            self.keep_apart(targets)?;
            if self.trust.contact == ContactWord::Free {
                return Ok(());
            }
        }
        self.check_stop()?;
        let moved = moved(self.inner.positions(), &self.next);
        self.trust.correction = predicted.map(|_| moved);
        self.trust.given = self.gauge.measure(&self.last[1], &self.next);
        self.inner.replace_frame(&self.next)
    }

    /// Makes and hands on the next frame after a failed step of the inner stepper.
    fn take_over(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        self.trust = Trust {
            frame: self.inner.frame() + 1,
            ..Trust::default()
        };
        self.replace(targets);
        self.keep_apart(targets)?;
        self.check_stop()?;
        self.trust.given = self.gauge.measure(&self.last[1], &self.next);
        self.inner.take_frame(&self.next)
    }

    /// Drops a frame whose physics may have been stopped.
    fn check_stop(&self) -> Result<(), StepError> {
        if self.stop.is_wanted() {
            Err(StepError::Stopped {
                frame: self.trust.frame,
            })
        } else {
            Ok(())
        }
    }

    /// Holds the next frame to contact on its way from the last one: certified, or pushed apart, or
    /// else replaced. A frame of the physics is free of contact already. Where that failed too, the
    /// step fails.
    fn keep_apart(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        let is_physics =
            |guard: &Self| guard.trust.verdict.replaced_by() == Some(Replacement::Physics);
        if !self.is_held_apart || is_physics(self) {
            return Ok(());
        }
        let word = match self.lead(targets) {
            Ok(word) => word,
            Err(_) => {
                self.replace(targets);
                if !is_physics(self) {
                    self.lead(targets)?;
                }
                ContactWord::Lost
            }
        };
        self.trust.contact = word;
        if word == ContactWord::Pushed && self.trust.verdict == Verdict::Held {
            self.trust.verdict = Verdict::Corrected;
        }
        Ok(())
    }

    /// Leads the next frame from the last one, pushing apart what would meet.
    fn lead(&mut self, targets: &HandleTargets) -> Result<ContactWord, StepError> {
        let frame = self.trust.frame.saturating_sub(1);
        let Some(Ok(Physics { simulator, .. })) = &mut self.physics else {
            return Ok(ContactWord::Free);
        };
        match simulator.lead(frame, &self.last[1], &mut self.next, targets)? {
            Led::Free => Ok(ContactWord::Free),
            Led::Pushed => Ok(ContactWord::Pushed),
        }
    }

    /// Brings the edges of the next frame back. Returns false if it is lost after all.
    fn correct(&mut self) -> bool {
        let within = self.limiter.apply(&mut self.next, SWEEPS);
        let farthest = LOST_CORRECTION * self.gauge.mean_length();
        within && moved(self.inner.positions(), &self.next).largest <= farthest
    }

    /// Makes the next frame without the inner stepper: by the physics, or by carrying the last one.
    fn replace(&mut self, targets: &HandleTargets) {
        let last = std::mem::take(&mut self.last);
        let frame = self.trust.frame.saturating_sub(1);
        let mut next = std::mem::take(&mut self.next);
        let outcome = self.physics().map(|physics| {
            let found = physics?.step(frame, &last[0], &last[1], targets)?;
            next.clear();
            next.extend_from_slice(found);
            Ok(())
        });
        let is_physics = matches!(outcome, Some(Ok(())));
        if let Some(Err(failure)) = outcome
            && !self.stop.is_wanted()
        {
            // Where it was stopped the frame will be dropped.
            self.trust.physics_failed = true;
            self.physics_failure = Some(failure);
        }
        let replaced_by = if is_physics {
            Replacement::Physics
        } else {
            carry(self.inner.handles(), &last[1], targets, &mut next);
            Replacement::Carry
        };
        self.trust.verdict = Verdict::Lost { replaced_by };
        if self.is_held_apart && is_physics {
            // Nothing meets in it, if nothing is moved.
            (self.last, self.next) = (last, next);
            return;
        }
        // The handles of a physics with springs end beside their targets.
        for (vertex, target) in targets.held(self.inner.handles()) {
            next[vertex.index()] = target.as_vec3();
        }
        self.limiter.apply(&mut next, SWEEPS);
        (self.last, self.next) = (last, next);
    }

    /// The physics, set up if that was not tried before; none without a scene.
    fn physics(&mut self) -> Option<Result<&mut Physics, PhysicsFailure>> {
        if let (None, Some(scene)) = (&self.physics, &self.scene) {
            self.physics = Some(Physics::new(scene).map(|mut physics| {
                physics.simulator.stop_by(self.stop.clone());
                physics
            }));
        }
        let physics = self.physics.as_mut()?.as_mut();
        Some(physics.map_err(|error| PhysicsFailure::SetUp(error.clone())))
    }

    /// Makes the next frame the newest one.
    fn advance(&mut self) {
        self.last.swap(0, 1);
        std::mem::swap(&mut self.last[1], &mut self.next);
    }
}

impl<S: Correctable> Stepper for Guard<S> {
    selvedge_cloth::delegate_stepper!(self: self.inner, but stop_by);

    /// Heard by the inner stepper and by the physics beside it.
    fn stop_by(&mut self, stop: Stop) {
        self.inner.stop_by(stop.clone());
        if let Some(Ok(physics)) = &mut self.physics {
            physics.simulator.stop_by(stop.clone());
        }
        self.stop = stop;
    }

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        check_target_count(self, targets)?;
        check_within_f32(self, targets)?;
        let before = self.trust;
        let handles = self.inner.handles().vertices().iter().enumerate();
        let held = handles.map(|(handle, v)| (v.index(), targets.holds(handle)));
        self.limiter.hold(held);
        let stepped = match self.inner.step(targets) {
            Ok(()) => self.judge(targets).inspect_err(|_| self.inner.undo_step()),
            Err(error) if self.correction == Correction::None || is_callers(&error) => Err(error),
            Err(_) => self.take_over(targets),
        };
        match stepped {
            Ok(()) => self.advance(),
            Err(_) => self.trust = before,
        }
        stepped
    }

    fn snapshot(&self) -> Option<Snapshot> {
        let state: State = (self.inner.snapshot()?, self.last.clone(), self.trust);
        Some(Snapshot::of(state))
    }

    fn rewind(&mut self, snapshot: &Snapshot) -> Result<(), StepError> {
        let (inner, last, trust): &State = snapshot.get(self.frame(), |_| true)?;
        self.inner.rewind(inner)?;
        self.last.clone_from(last);
        self.trust = *trust;
        Ok(())
    }
}

/// The state of the inner stepper, the last two frames and the word on the newest.
type State = (Snapshot, [Vec<Vec3>; 2], Trust);

/// Checks that `targets` are finite as f32, as the positions of handles are to be.
fn check_within_f32(stepper: &impl Stepper, targets: &HandleTargets) -> Result<(), StepError> {
    let mut pairs = stepper.handles().vertices().iter().zip(targets.end());
    match pairs.find(|(_, target)| !target.as_vec3().is_finite()) {
        Some((&vertex, _)) => Err(StepError::NonFinite {
            frame: stepper.frame() + 1,
            vertex,
        }),
        None => Ok(()),
    }
}

/// Returns true if a step failed for its caller, or for the machine that it ran on.
fn is_callers(error: &StepError) -> bool {
    match error {
        StepError::Handles { .. }
        | StepError::EndOfRecording { .. }
        | StepError::Device { .. }
        | StepError::Snapshot { .. }
        | StepError::Obstacle { .. }
        | StepError::Stopped { .. } => true,
        StepError::NonFinite { .. }
        | StepError::Solve { .. }
        | StepError::Contact { .. }
        | StepError::Intersections { .. }
        | StepError::Rounded { .. }
        | StepError::Overstretched { .. } => false,
    }
}

/// Distances from `a` to `b` `[m]`, `[vertices]`.
fn moved(a: &[Vec3], b: &[Vec3]) -> Moved {
    let mut moved = Moved::default();
    for (p, q) in a.iter().zip(b) {
        let squared = p.as_dvec3().distance_squared(q.as_dvec3());
        moved.rms += squared;
        moved.largest = moved.largest.max(squared);
    }
    Moved {
        rms: (moved.rms / a.len().max(1) as f64).sqrt(),
        largest: moved.largest.sqrt(),
    }
}

/// Checks that these are the faces and handles that `inner` moves; else says which are not.
fn moved_by(
    inner: &impl Stepper,
    topology: &Topology,
    handles: &Handles,
) -> Result<(), &'static str> {
    match (topology == inner.topology(), handles == inner.handles()) {
        (true, true) => Ok(()),
        (true, false) => Err("handles"),
        (false, _) => Err("faces"),
    }
}

/// The material length of each edge of `cloth` `[m]`, `[edges]`.
fn edge_lengths(cloth: &Cloth) -> Result<Vec<f64>, GuardError> {
    let lengths = cloth.pattern().edge_lengths();
    let mut edges = cloth.topology().edges().iter().zip(&lengths);
    let is_bad = |length: f64| !(length.is_finite() && length > 0.0);
    if let Some((edge, &length)) = edges.find(|(_, length)| is_bad(**length)) {
        let [from, to] = edge.vertices;
        return Err(GuardError::Length { from, to, length });
    }
    Ok(lengths)
}

#[cfg(test)]
mod tests;
