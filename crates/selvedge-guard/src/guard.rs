//! The guard: a stepper around a stepper that measures every frame and corrects it where it must.
//!
//! A frame within its bounds is passed on bit for bit. One beyond them is relaxed by the physics where
//! that is asked for, and its edges are brought back; the inner stepper then goes on from that
//! frame, not from its own. What cannot be brought back, or is no frame at all, is replaced by a
//! frame of the physics from the last two good ones, or without a scene by the last one carried by
//! the handles. So a step fails only for what its caller did: targets that do not fit, a recording
//! that has ended; and where handles are farther apart than the cloth can reach, edges stay too long.

use std::sync::Arc;

use glam::Vec3;
use selvedge_cloth::{Cloth, Correctable, HandleTargets, Scene, StepError, Stepper, VertexId};
use thiserror::Error;

use crate::carry::carry;
use crate::gauge::Gauge;
use crate::limiter::{EdgeLimiter, LimitedEdge};
use crate::rescue::Physics;
use crate::settings::{Correction, GuardSettings, SettingsError, When};
use crate::trust::{Moved, Trust, Verdict};

/// Why a cloth cannot be guarded.
#[derive(Clone, Debug, Error, PartialEq)]
#[allow(missing_docs, reason = "the fields are named in the messages")]
pub enum GuardError {
    #[error(transparent)]
    Settings(#[from] SettingsError),
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
    #[error(
        "correcting by physics needs the scene of the cloth, which is not known: limit edges instead"
    )]
    NoScene,
    #[error("the scene's {what} are not those of the cloth")]
    OtherScene { what: &'static str },
}

/// A stepper that is watched over.
pub struct Guard<S> {
    inner: S,
    settings: GuardSettings,
    gauge: Gauge,
    limiter: EdgeLimiter,
    scene: Option<Arc<Scene>>,
    /// Made when it is first needed.
    physics: Option<Physics>,
    /// The frame before the newest and the newest as they were given on `[m]`, `[vertices]`.
    last: [Vec<Vec3>; 2],
    next: Vec<Vec3>,
    trust: Trust,
}

impl<S: Correctable> Guard<S> {
    /// Watches `inner`, which moves `cloth` by `frame_rate` frames per second and stands still so far.
    /// With the `scene` of that cloth the physics is at hand.
    ///
    /// # Errors
    /// [`GuardError`] names the setting or the part that does not fit.
    pub fn new(
        inner: S,
        cloth: &Cloth,
        frame_rate: f64,
        scene: Option<Arc<Scene>>,
        settings: GuardSettings,
    ) -> Result<Self, GuardError> {
        settings.validate()?;
        match &scene {
            Some(scene) => check_scene(scene, &inner)?,
            None if settings.correction == Correction::Physics => return Err(GuardError::NoScene),
            None => {}
        }
        let lengths = check_cloth(cloth, &inner)?;
        let edges = inner.topology().edges().iter();
        let ends: Vec<[u32; 2]> = edges.map(|edge| edge.vertices.map(|v| v.0)).collect();
        let mask = inner.handles().mask(cloth.vertex_count());
        let limited = ends
            .iter()
            .zip(&lengths)
            .filter_map(|(&ends, &length)| limited_edge(ends, length, cloth, (&mask, &settings)));
        let start = inner.positions().to_vec();
        let mut guard = Self {
            limiter: EdgeLimiter::new(limited.collect()),
            gauge: Gauge::new(ends, lengths, cloth.vertex_mass(), frame_rate),
            last: [start.clone(), start.clone()],
            next: start,
            inner,
            settings,
            scene,
            physics: None,
            trust: Trust::default(),
        };
        guard.trust.frame = guard.inner.frame();
        guard.trust.given = guard.gauge.measure(&guard.last[0], &guard.last[1]);
        Ok(guard)
    }

    /// What is known of the newest frame.
    #[must_use]
    pub fn trust(&self) -> &Trust {
        &self.trust
    }

    /// What is guarded.
    #[must_use]
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
        let is_lost = !is_finite || given.largest_strain > self.settings.lost_strain;
        self.trust = Trust {
            frame: self.inner.frame(),
            verdict: match (holds, is_lost) {
                (true, _) => Verdict::Held,
                (false, true) => Verdict::Lost,
                (false, false) => Verdict::Corrected,
            },
            predicted,
            given,
            correction: predicted.map(|_| Moved::default()),
        };
        self.next.clear();
        self.next.extend_from_slice(found);
        let is_always =
            self.settings.when == When::Always && self.settings.correction == Correction::Physics;
        if self.settings.correction == Correction::None || (holds && !is_always) {
            return Ok(());
        }
        if self.trust.verdict == Verdict::Lost || !self.correct(targets) {
            self.trust.verdict = Verdict::Lost;
            self.replace(targets);
        }
        let moved = moved(self.inner.positions(), &self.next);
        self.trust.correction = predicted.map(|_| moved);
        self.trust.given = self.gauge.measure(&self.last[1], &self.next);
        self.inner.replace_frame(&self.next)
    }

    /// Corrects the next frame as the settings say; whether that came to a good end.
    fn correct(&mut self, targets: &HandleTargets) -> bool {
        if self.settings.correction == Correction::Physics {
            self.relax(targets);
        }
        let within = self.limiter.apply(&mut self.next, self.settings.sweeps);
        let farthest = self.settings.lost_correction * self.gauge.mean_length();
        within && moved(self.inner.positions(), &self.next).largest <= farthest
    }

    /// Relaxes the next frame by the physics; what cannot be solved stays as it is, to be limited.
    fn relax(&mut self, targets: &HandleTargets) {
        let (frame, solves) = (self.trust.frame, self.settings.solves);
        let mut relaxed = std::mem::take(&mut self.next);
        if let Some(physics) = self.physics() {
            // On an error positions stay as they were.
            let _ = physics.relax(frame, solves, targets.end(), &mut relaxed);
        }
        for (vertex, target) in self.inner.handles().vertices().iter().zip(targets.end()) {
            relaxed[vertex.index()] = target.as_vec3();
        }
        self.next = relaxed;
    }

    /// Makes the next frame without the inner stepper: by the physics, or by carrying the last one.
    fn replace(&mut self, targets: &HandleTargets) {
        let last = std::mem::take(&mut self.last);
        let frame = self.trust.frame.saturating_sub(1);
        let mut next = std::mem::take(&mut self.next);
        let found = match self.physics() {
            Some(physics) => physics.step(frame, [&last[0], &last[1]], targets).ok(),
            None => None,
        };
        match found.filter(|found| found.iter().all(|p| p.is_finite())) {
            Some(found) => {
                next.clear();
                next.extend_from_slice(found);
                // Where handles have been exact there is nothing to do.
                for (vertex, target) in self.inner.handles().vertices().iter().zip(targets.end()) {
                    next[vertex.index()] = target.as_vec3();
                }
            }
            None => carry(self.inner.handles(), &last[1], targets.end(), &mut next),
        }
        self.limiter.apply(&mut next, self.settings.sweeps);
        (self.last, self.next) = (last, next);
    }

    /// The physics, where there is a scene; made when it is first needed.
    fn physics(&mut self) -> Option<&mut Physics> {
        if let (None, Some(scene)) = (&self.physics, &self.scene) {
            self.physics = Physics::new(scene).ok();
        }
        self.physics.as_mut()
    }

    /// The newest frame is the next one.
    fn advance(&mut self) {
        self.last.swap(0, 1);
        std::mem::swap(&mut self.last[1], &mut self.next);
    }
}

impl<S: Correctable> Stepper for Guard<S> {
    selvedge_cloth::looks_like!(inner);

    fn step(&mut self, targets: &HandleTargets) -> Result<(), StepError> {
        match self.inner.step(targets) {
            Ok(()) => self.judge(targets)?,
            Err(error) if self.settings.correction == Correction::None || is_callers(&error) => {
                return Err(error);
            }
            Err(_) => {
                self.trust = Trust {
                    frame: self.inner.frame() + 1,
                    verdict: Verdict::Lost,
                    ..Trust::default()
                };
                self.replace(targets);
                self.trust.given = self.gauge.measure(&self.last[1], &self.next);
                self.inner.take_frame(&self.next)?;
            }
        }
        self.advance();
        Ok(())
    }
}

/// Whether a step failed for what its caller did, or for the machine it ran on.
fn is_callers(error: &StepError) -> bool {
    match error {
        StepError::Handles { .. } | StepError::EndOfRecording { .. } | StepError::Device { .. } => {
            true
        }
        StepError::NonFinite { .. } | StepError::Solve { .. } | StepError::Strain { .. } => false,
    }
}

/// How far it is from `a` to `b` `[m]`, `[vertices]`.
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

/// The bounds of an edge; none where both ends are handles.
fn limited_edge(
    ends: [u32; 2],
    length: f64,
    cloth: &Cloth,
    (mask, settings): (&[bool], &GuardSettings),
) -> Option<LimitedEdge> {
    let inverse = ends.map(|v| match mask[v as usize] {
        true => 0.0,
        false => 1.0 / cloth.vertex_mass()[v as usize],
    });
    let both: f32 = inverse.iter().sum();
    let [a, b] = ends.map(|v| cloth.rest_positions()[v as usize].as_dvec3());
    let (rest, margin) = (a.distance(b), settings.rest_margin);
    let least = (settings.least_stretch * length).min((1.0 - margin) * rest);
    let most = (settings.most_stretch * length).max((1.0 + margin) * rest);
    (both > 0.0).then(|| LimitedEdge {
        ends,
        bounds: [least as f32, most as f32],
        shares: inverse.map(|weight| weight / both),
    })
}

fn check_scene(scene: &Scene, inner: &impl Stepper) -> Result<(), GuardError> {
    if scene.mesh.topology() != inner.topology() {
        return Err(GuardError::OtherScene { what: "faces" });
    }
    if scene.handles != *inner.handles() {
        return Err(GuardError::OtherScene { what: "handles" });
    }
    Ok(())
}

/// The material length of each edge `[m]`, `[edges]`, of the cloth that `inner` moves.
fn check_cloth(cloth: &Cloth, inner: &impl Stepper) -> Result<Vec<f64>, GuardError> {
    if cloth.topology() != inner.topology() {
        return Err(GuardError::OtherCloth { what: "faces" });
    }
    if cloth.handles() != inner.handles() {
        return Err(GuardError::OtherCloth { what: "handles" });
    }
    let length = |[from, to]: [VertexId; 2]| {
        let [a, b] = [from, to].map(|v| cloth.material_coordinates()[v.index()].as_dvec2());
        match a.distance(b) {
            length if length.is_finite() && length > 0.0 => Ok(length),
            length => Err(GuardError::Length { from, to, length }),
        }
    };
    cloth
        .topology()
        .edges()
        .iter()
        .map(|e| length(e.vertices))
        .collect()
}

#[cfg(test)]
mod tests;
