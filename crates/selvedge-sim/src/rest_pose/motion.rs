//! How a cloth comes to rest by itself: its motion from the start, solve by solve, until it is slow.
//!
//! A cloth may have several rest poses near each other; which one it reaches depends on the way. This
//! is the way of a simulation that waits, slower than the search for an equilibrium in
//! [`crate::rest_pose`], which takes over from the slow cloth.

use glam::DVec3;
use selvedge_cloth::Scene;

use crate::active_handles::ActiveHandles;
use crate::rest_pose::{Listener, SagError, SagProgress, tell};
use crate::state::State;

/// The cloth has come to rest when no vertex is faster than this `[m/s]`, but not in the first
/// moments, in which it may not have begun to move out of its plane.
const SLOW: f64 = 2e-3;
const FIRST_MOMENTS: f64 = 3.0;
/// Longest time that is waited `[s]`.
const LONGEST: f64 = 30.0;

/// Where `scene`'s cloth, let go at `positions` `[m]`, `[vertices]`, is when it has become slow, and the
/// solves that it took.
pub(crate) fn fall(
    scene: &Scene,
    positions: Vec<DVec3>,
    progress: Listener<'_>,
) -> Result<(Vec<DVec3>, u32), SagError> {
    let failed = |solves: u32, cause: String| SagError::Solve { solves, cause };
    let mut active = ActiveHandles::all(scene).map_err(|cause| failed(0, cause.to_string()))?;
    let dt = 1.0 / scene.frame_rate / f64::from(scene.physics.substeps);
    let targets = scene.handles.select(scene.mesh.positions());
    let mut state = State {
        velocities: vec![DVec3::ZERO; positions.len()],
        positions,
    };
    let last = (LONGEST / dt) as u32;
    let mut before = state.velocities.clone();
    for solves in 1..=last.min(scene.sag.max_steps) {
        before.copy_from_slice(&state.velocities);
        active
            .advance(dt, &mut state, &targets)
            .map_err(|cause| failed(solves, cause.to_string()))?;
        let change = largest(state.velocities.iter().zip(&before).map(|(a, b)| *a - *b));
        let now = SagProgress {
            solves,
            residual: change / dt,
            tolerance: scene.sag.tolerance,
        };
        tell(progress, now)?;
        let slow = largest(state.velocities.iter().copied()) < SLOW;
        if slow && f64::from(solves) * dt > FIRST_MOMENTS {
            return Ok((state.positions, solves));
        }
    }
    Ok((state.positions, last.min(scene.sag.max_steps)))
}

fn largest(vectors: impl Iterator<Item = DVec3>) -> f64 {
    vectors.map(|v| v.length()).fold(0.0, f64::max)
}
