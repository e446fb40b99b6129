//! Dynamic relaxation by the cloth's own motion: the motion from the start, solve by solve, until
//! it is slow.
//!
//! A cloth may have several rest poses near each other, and the way decides which one it reaches.
//! This is the way of a simulation that waits. It is slower than [`super::equilibrium`], which
//! takes over from the slow cloth.

use glam::DVec3;
use selvedge_cloth::Scene;

use crate::active_handles::ActiveHandles;
use crate::rest_pose::progress::{Approach, Largest, Listener, SagError, SagProgress, tell};
use crate::state::State;

/// Speed below which a cloth counts as at rest `[m/s]`.
const SLOW: f64 = 2e-3;
/// Time in which a cloth may not yet have begun to move out of its plane, and is never at rest
/// `[s]`.
const FIRST_MOMENTS: f64 = 3.0;
/// Longest time that the motion takes `[s]`.
const LONGEST: f64 = 30.0;

/// Moves `scene`'s cloth, released at `positions` `[m]`, `[vertices]`, until it is slow.
pub(super) fn relax_by_motion(
    scene: &Scene,
    positions: Vec<DVec3>,
    progress: Listener<'_>,
) -> Result<Approach, SagError> {
    let mut active =
        ActiveHandles::all(scene).map_err(|cause| SagError::failed_solve(0, &cause))?;
    let dt = 1.0 / scene.frame_rate / f64::from(scene.physics.substeps);
    let targets = scene.handles.select(scene.mesh.positions());
    let mut state = State {
        velocities: vec![DVec3::ZERO; positions.len()],
        positions,
    };
    let last = ((LONGEST / dt) as u32).min(scene.sag.max_steps);
    let mut before = state.velocities.clone();
    for solves in 1..=last {
        before.copy_from_slice(&state.velocities);
        active
            .advance_first_order(dt, &mut state, &targets)
            .map_err(|cause| SagError::failed_solve(solves, &cause))?;
        let changes = state.velocities.iter().zip(&before);
        let change = Largest::of(changes.map(|(a, b)| a.distance(*b)).enumerate());
        let now = SagProgress {
            solves,
            residual: change.value / dt,
            vertex: change.vertex,
            tolerance: scene.sag.tolerance,
        };
        tell(progress, now)?;
        let fastest = Largest::of(state.velocities.iter().map(|v| v.length()).enumerate());
        let slow = fastest.value < SLOW;
        if slow && f64::from(solves) * dt > FIRST_MOMENTS {
            return Ok(Approach {
                positions: state.positions,
                solves,
            });
        }
    }
    Ok(Approach {
        positions: state.positions,
        solves: last,
    })
}
