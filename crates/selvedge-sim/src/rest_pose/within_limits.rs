//! Dynamic relaxation within strain limits, which carry load but are no force: solves and
//! projections of the motion itself, until it has come to rest.
//!
//! From the pose without limits, velocities are set to zero whenever the kinetic energy begins to
//! fall (kinetic damping, Cundall 1976). The residual is measured by a solve from a standstill. The
//! projection is exact to 10⁻⁶ of a stretch. Over the short solves of a motion this looks like an
//! acceleration of centimetres per second squared, so [`LIMITED_TOLERANCE`] is the least tolerance.

use glam::DVec3;
use selvedge_cloth::Scene;

use crate::active_handles::ActiveHandles;
use crate::rest_pose::progress::{Largest, Listener, SagError, SagProgress, SaggedRest, tell};
use crate::state::State;

/// Least tolerance of a rest pose within limits `[m/s²]`.
const LIMITED_TOLERANCE: f64 = 0.05;

/// Moves on from `rest`, the pose without limits, until the cloth rests within those of `scene`,
/// whose handles all hold. Gives `rest` itself if it is within the limits.
pub(super) fn relax_within_limits(
    scene: &Scene,
    rest: SaggedRest,
    progress: Listener<'_>,
) -> Result<SaggedRest, SagError> {
    let active = ActiveHandles::all(scene);
    let active = active.map_err(|cause| SagError::failed_solve(rest.solves, &cause))?;
    let dt = 1.0 / scene.frame_rate / f64::from(scene.physics.substeps);
    let mut damped = KineticDamping {
        active,
        dt,
        targets: scene.handles.select(scene.mesh.positions()),
        state: State {
            velocities: vec![DVec3::ZERO; rest.positions.len()],
            positions: rest.positions.clone(),
        },
        energy: 0.0,
    };
    let limited = damped.active.limit(dt, &mut damped.state);
    if !limited.map_err(|cause| SagError::failed_solve(rest.solves, &cause))? {
        return Ok(rest);
    }
    damped.stop();
    let tolerance = scene.sag.tolerance.max(LIMITED_TOLERANCE);
    let mut solves = rest.solves;
    loop {
        let residual = damped.step(solves)?;
        solves += 1;
        if let Some(residual) = residual {
            let now = SagProgress {
                solves,
                residual: residual.value,
                vertex: residual.vertex,
                tolerance,
            };
            tell(progress, now)?;
            if now.is_reached() {
                return Ok(now.rest(damped.state.positions));
            }
            if solves >= scene.sag.max_steps {
                return Err(now.not_converged());
            }
        }
        damped.damp();
    }
}

/// A motion with kinetic damping.
struct KineticDamping {
    active: ActiveHandles,
    /// Time of a solve `[s]`.
    dt: f64,
    /// Targets of the handles `[m]`, `[handles]`.
    targets: Vec<DVec3>,
    state: State,
    /// Twice the kinetic energy after the last solve `[J]`; 0 at a standstill.
    energy: f64,
}

impl KineticDamping {
    /// One solve and projection. From a standstill it gives the residual.
    fn step(&mut self, solves: u32) -> Result<Option<Largest>, SagError> {
        let stands = self.energy == 0.0;
        self.active
            .advance_within_limits(self.dt, &mut self.state, None, &self.targets)
            .map_err(|cause| SagError::failed_solve(solves, &cause))?;
        let speeds = self.state.velocities.iter().map(|v| v.length());
        Ok(stands.then(|| Largest::of(speeds.map(|speed| speed / self.dt).enumerate())))
    }

    /// Stops the cloth if its kinetic energy has begun to fall.
    fn damp(&mut self) {
        let mass = self.active.system.mass().iter();
        let now: f64 = mass
            .zip(&self.state.velocities)
            .map(|(mass, velocity)| mass * velocity.length_squared())
            .sum();
        if now < self.energy {
            self.stop();
        } else {
            self.energy = now;
        }
    }

    fn stop(&mut self) {
        self.state.velocities.fill(DVec3::ZERO);
        self.energy = 0.0;
    }
}
