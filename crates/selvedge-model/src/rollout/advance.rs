//! One frame of the learned cloth: from an acceleration to the next positions, back from positions
//! to the acceleration, and the derivative.
//!
//! p^{t+1} = a + 2 p^t - q `[eq:integration]`, with the reference q of the spec's [`Integration`].
//! Handle vertices take their targets instead. Then edges come back within the limits of the spec,
//! and a position that is not finite is an error. A rollout and a training call [`advance`]; losses
//! call the same equation in `f64` and local axes ([`TwoFrames::moved`]); the kernels of a device
//! are tested against it.

use std::ops::{Add, Sub};

use glam::Vec3;
use selvedge_cloth::VertexId;
use thiserror::Error;

use crate::graph::ClothGraph;
use crate::graph::frame::Yaw;
use crate::spec::ModelSpec;
use crate::spec::integration::{Integration, LastFrames};

/// Two frames from which a cloth moves on, all positions in the same axes `[m]`, `[vertices]`.
#[derive(Clone, Copy, Debug)]
pub struct TwoFrames<'a, V> {
    /// The cloth.
    pub graph: &'a ClothGraph,
    /// Positions one frame earlier from which uniform motion leads to the next frame without a
    /// network ([`Integration::reference`]).
    pub reference: &'a [V],
    /// Current positions.
    pub current: &'a [V],
}

/// An acceleration in local axes.
#[derive(Clone, Copy, Debug)]
pub struct LocalAcceleration<'a> {
    /// The local frame.
    pub yaw: Yaw,
    /// Components `[m/frame²]`, `[vertices, 3]`.
    pub rows: &'a [f32],
}

/// A position that is not finite.
#[derive(Clone, Copy, Debug, Error, PartialEq, Eq)]
#[error("the position of vertex {vertex} is not finite")]
pub struct NonFinite {
    /// Its vertex, the first such one.
    pub vertex: VertexId,
}

impl<V: Copy + Add<Output = V> + Sub<Output = V>> TwoFrames<'_, V> {
    /// Sets `next` to the positions that the accelerations of all vertices lead to, and what
    /// handles hold to their positions `handles`.
    ///
    /// # Panics
    /// When `next` does not have a position per vertex.
    pub fn moved(
        &self,
        accelerations: impl Iterator<Item = V>,
        handles: impl Iterator<Item = V>,
        next: &mut [V],
    ) {
        assert_eq!(next.len(), self.graph.vertex_count(), "positions");
        let frames = self.current.iter().zip(self.reference);
        for ((next, a), (&p, &q)) in next.iter_mut().zip(accelerations).zip(frames) {
            *next = a + ((p + p) - q);
        }
        let held = self.graph.handle_mask();
        for (vertex, target) in self.graph.handles().vertices().iter().zip(handles) {
            if held[vertex.index()] {
                next[vertex.index()] = target;
            }
        }
    }

    /// The acceleration that leads vertex `vertex` to `next`: the inverse of [`Self::moved`].
    pub fn acceleration_to(&self, next: V, vertex: usize) -> V {
        let (p, q) = (self.current[vertex], self.reference[vertex]);
        (next - p) - (p - q)
    }
}

/// Sets `next` to the frame after `frames` (in the world): the acceleration is integrated, handles
/// take their targets `next_handles`, and edges keep the limits of `spec`.
///
/// # Errors
/// [`NonFinite`] names the first vertex whose position is not finite.
///
/// # Panics
/// When `next` does not have a position per vertex.
pub fn advance(
    spec: &ModelSpec,
    frames: &TwoFrames<'_, Vec3>,
    next_handles: &[Vec3],
    acceleration: LocalAcceleration<'_>,
    next: &mut [Vec3],
) -> Result<(), NonFinite> {
    let LocalAcceleration { yaw, rows } = acceleration;
    let rows = rows.as_chunks::<3>().0.iter();
    let accelerations = rows.map(|a| yaw.to_world(Vec3::from_array(*a)));
    frames.moved(accelerations, next_handles.iter().copied(), next);
    if let Some(limits) = spec.edge_limits {
        limits.apply(frames.graph, next);
    }
    require_finite(next)
}

/// The acceleration in the local frame `yaw` that leads to `next`, `[vertices, 3]`: the inverse of
/// [`advance`] for free vertices of a spec without edge limits.
#[must_use]
pub fn target_acceleration(frames: &TwoFrames<'_, Vec3>, yaw: Yaw, next: &[Vec3]) -> Vec<f32> {
    let rows = next.iter().enumerate();
    rows.flat_map(|(v, &p)| yaw.to_local(frames.acceleration_to(p, v)).to_array())
        .collect()
}

/// Adds to `previous` and `current` the gradient of the last two frames for the gradient `by_next`
/// of the next positions, all in the world, `[vertices]`. Handles are held, and edge limits are
/// left out.
pub fn advance_backward(
    integration: Integration,
    frames: &LastFrames<'_>,
    by_next: &[Vec3],
    previous: &mut [Vec3],
    current: &mut [Vec3],
) {
    let slope = integration.reference_slope(frames);
    for (to, g) in current.iter_mut().zip(by_next) {
        *to += 2.0 * *g;
    }
    let by_reference: Vec<Vec3> = by_next.iter().map(|&g| -g).collect();
    slope.backward(&by_reference, previous, current);
}

/// Checks every position.
pub(crate) fn require_finite(positions: &[Vec3]) -> Result<(), NonFinite> {
    match positions.iter().position(|p| !p.is_finite()) {
        Some(vertex) => Err(NonFinite {
            vertex: VertexId(vertex as u32),
        }),
        None => Ok(()),
    }
}

#[cfg(test)]
mod tests;
