//! Which handles hold the cloth, and the system that goes with them: a handle that is let go becomes
//! an unknown like any other vertex, so that the pattern of the system changes.
//!
//! A handle that takes hold again does so of its vertex where it then is: its target is moved by the
//! difference to its path, which stays until it lets go again.

use glam::DVec3;
use selvedge_cloth::{HandleTargets, Integrator, Scene, VertexId};

use crate::laws::strain_limit::StrainLimiter;
use crate::solver::FactorError;
use crate::solver::Newton;
use crate::solver::{SolveError, System};
use crate::state::State;

/// The handles that hold, and what solves for the rest.
pub(crate) struct ActiveHandles {
    /// Whether each handle holds, `[handles]`.
    holds: Vec<bool>,
    /// What each handle's target is moved by `[m]`, `[handles]`.
    offsets: Vec<DVec3>,
    /// The system of the cloth with those that hold, in their order.
    pub(crate) system: System,
    /// The limits of its faces, where the material has some.
    limiter: Option<StrainLimiter>,
    /// What solves a substep's equations to the end, where that is asked for.
    newton: Option<Newton>,
}

impl ActiveHandles {
    /// All handles of `scene`, on their paths.
    pub(crate) fn all(scene: &Scene) -> Result<Self, FactorError> {
        let count = scene.handles.len();
        Self::new(scene, vec![true; count], vec![DVec3::ZERO; count])
    }

    /// The handles that hold in `targets`, which those that did not before take hold of `state`;
    /// `paths` is where all of them were told to be last `[m]`, `[handles]`.
    pub(crate) fn changed(
        &self,
        scene: &Scene,
        targets: &HandleTargets,
        state: &State,
        paths: &[DVec3],
    ) -> Result<Self, FactorError> {
        let holds: Vec<bool> = (0..self.holds.len()).map(|h| targets.holds(h)).collect();
        let mut offsets = self.offsets.clone();
        for (handle, vertex) in scene.handles.vertices().iter().enumerate() {
            if holds[handle] && !self.holds[handle] {
                offsets[handle] = state.positions[vertex.index()] - paths[handle];
            }
        }
        Self::new(scene, holds, offsets)
    }

    /// The handles of `scene` that hold, each moved off its path by its offset `[m]`, `[handles]`.
    pub(crate) fn new(
        scene: &Scene,
        holds: Vec<bool>,
        offsets: Vec<DVec3>,
    ) -> Result<Self, FactorError> {
        let part;
        let scene = if holds.iter().all(|holds| *holds) {
            scene
        } else {
            part = Scene {
                handles: scene.handles.subset(&holds),
                ..scene.clone()
            };
            &part
        };
        let system = System::new(scene)?;
        Ok(Self {
            holds,
            offsets,
            limiter: StrainLimiter::new(scene, system.mass()),
            newton: match scene.physics.integrator {
                Integrator::Linearised => None,
                Integrator::Newton(settings) => Some(Newton::new(settings, system.mass().len())),
            },
            system,
        })
    }

    /// Whether every handle holds, and where its path is.
    pub(crate) fn holds_all(&self) -> bool {
        let mut pairs = self.holds.iter().zip(&self.offsets);
        pairs.all(|(holds, offset)| *holds && *offset == DVec3::ZERO)
    }

    /// Whether the handles that hold are those of `targets`.
    pub(crate) fn fits(&self, targets: &HandleTargets) -> bool {
        let holds = self.holds.iter().enumerate();
        holds
            .into_iter()
            .all(|(h, holds)| *holds == targets.holds(h))
    }

    /// Moves `state` by one substep over `dt` `[s]`, those that hold to `targets` `[m]`, and then within
    /// the limits of the material; on an error the state is unusable and the caller restores it.
    pub(crate) fn advance(
        &mut self,
        dt: f64,
        state: &mut State,
        targets: &[DVec3],
    ) -> Result<(), SolveError> {
        match &mut self.newton {
            None => self.system.advance(dt, state, targets)?,
            Some(newton) => newton.advance(&mut self.system, dt, state, targets)?,
        }
        let Some(limiter) = &self.limiter else {
            return Ok(());
        };
        limiter.limit(dt, state);
        let moved = state.positions.iter().zip(&state.velocities);
        match moved
            .into_iter()
            .position(|(x, v)| !(x.is_finite() && v.is_finite()))
        {
            Some(vertex) => Err(SolveError::NonFinite {
                vertex: VertexId(vertex as u32),
            }),
            None => Ok(()),
        }
    }

    /// Moves `state` within the limits of the material; whether that was needed.
    pub(crate) fn limit(&self, dt: f64, state: &mut State) -> bool {
        let limiter = self.limiter.as_ref();
        limiter.is_some_and(|limiter| limiter.limit(dt, state) > 0)
    }

    /// The targets of those that hold `[m]`, put into `targets`; `path` gives that of a handle.
    pub(crate) fn put_targets(&self, targets: &mut Vec<DVec3>, path: impl Fn(usize) -> DVec3) {
        targets.clear();
        for (handle, holds) in self.holds.iter().enumerate() {
            if *holds {
                targets.push(path(handle) + self.offsets[handle]);
            }
        }
    }
}
