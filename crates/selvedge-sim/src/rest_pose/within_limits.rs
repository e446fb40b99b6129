//! The rest pose of a cloth with strain limits, which carry load but are no force: the motion itself,
//! solves and projections, until it has come to rest.
//!
//! From the pose without limits, velocities are taken away whenever the kinetic energy has begun to
//! fall (kinetic damping, Cundall 1976). What is left is measured by a solve from a standstill. The
//! projection is exact to 10⁻⁶ of a stretch, which over the short solves of a motion looks like an
//! acceleration of centimetres per second squared: no less than [`LIMITED_TOLERANCE`] can be asked.

use glam::DVec3;
use selvedge_cloth::Scene;

use crate::active_handles::ActiveHandles;
use crate::rest_pose::{Listener, SagError, SagProgress, SaggedRest, tell};
use crate::state::State;

/// Least tolerance of a rest pose within limits `[m/s²]`.
pub(crate) const LIMITED_TOLERANCE: f64 = 0.05;

/// Goes on from `rest`, the pose without limits, until it rests within those of `scene`, whose
/// handles are those that hold; as it is, where it is within them.
pub(crate) fn settle(
    scene: &Scene,
    rest: SaggedRest,
    progress: Listener<'_>,
) -> Result<SaggedRest, SagError> {
    let failed = |solves: u32, cause: String| SagError::Solve { solves, cause };
    let mut active =
        ActiveHandles::all(scene).map_err(|cause| failed(rest.solves, cause.to_string()))?;
    let dt = 1.0 / scene.frame_rate / f64::from(scene.physics.substeps);
    let targets = scene.handles.select(scene.mesh.positions());
    let still = vec![DVec3::ZERO; rest.positions.len()];
    let mut state = State {
        positions: rest.positions.clone(),
        velocities: still.clone(),
    };
    if !active.limit(dt, &mut state) {
        return Ok(rest);
    }
    state.velocities.copy_from_slice(&still);
    let tolerance = scene.sag.tolerance.max(LIMITED_TOLERANCE);
    let (mut solves, mut energy) = (rest.solves, 0.0);
    loop {
        let stands = energy == 0.0;
        active
            .advance(dt, &mut state, &targets)
            .map_err(|cause| failed(solves, cause.to_string()))?;
        solves += 1;
        if stands {
            let fastest = state.velocities.iter().map(|v| v.length());
            let residual = fastest.fold(0.0, f64::max) / dt;
            let now = SagProgress {
                solves,
                residual,
                tolerance,
            };
            tell(progress, now)?;
            if residual <= tolerance {
                return Ok(SaggedRest {
                    positions: state.positions,
                    solves,
                    residual,
                });
            }
            if solves >= scene.sag.max_steps {
                return Err(SagError::NotConverged {
                    solves,
                    residual,
                    tolerance,
                });
            }
        }
        let mass = active.system.mass().iter();
        let now: f64 = mass
            .zip(&state.velocities)
            .map(|(mass, velocity)| mass * velocity.length_squared())
            .sum();
        if now < energy {
            state.velocities.copy_from_slice(&still);
            energy = 0.0;
        } else {
            energy = now;
        }
    }
}
