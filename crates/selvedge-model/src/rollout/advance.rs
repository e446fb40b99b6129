//! One frame of the learned cloth: from an acceleration to the next positions, back from positions
//! to the acceleration, and the derivative.
//!
//! p^{t+1} = a + 2 p^t - p^{t-1} `[eq:integration]`. Handle vertices take their targets instead. A
//! position that is not finite is an error. A rollout and a training call [`advance`]; losses call
//! the same equation in `f64` and local axes ([`TwoFrames::moved`]); the kernels of a device are
//! tested against it.

use std::ops::{Add, Sub};

use glam::Vec3;
use selvedge_cloth::VertexId;
use thiserror::Error;

use crate::graph::ClothGraph;
use crate::graph::frame::Yaw;

/// Two frames from which a cloth moves on, all positions in the same axes `[m]`, `[vertices]`.
#[derive(Clone, Copy, Debug)]
pub struct TwoFrames<'a, V> {
    /// The cloth.
    pub graph: &'a ClothGraph,
    /// Positions one frame earlier.
    pub previous: &'a [V],
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
        let frames = self.current.iter().zip(self.previous);
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
        let (p, q) = (self.current[vertex], self.previous[vertex]);
        (next - p) - (p - q)
    }
}

/// Sets `next` to the frame after `frames` (in the world): the acceleration is integrated, handles take
/// their targets `next_handles`, and what the cloth touches keeps it at the thickness of contact
/// `[eq:separation]`, with edges within their bounds. Returns true if they were not before.
///
/// # Errors
/// [`NonFinite`] names the first vertex whose position is not finite.
///
/// # Panics
/// When `next` does not have a position per vertex.
pub fn advance(
    frames: &TwoFrames<'_, Vec3>,
    next_handles: &[Vec3],
    acceleration: LocalAcceleration<'_>,
    next: &mut [Vec3],
) -> Result<bool, NonFinite> {
    let LocalAcceleration { yaw, rows } = acceleration;
    let rows = rows.as_chunks::<3>().0.iter();
    let accelerations = rows.map(|a| yaw.to_world(Vec3::from_array(*a)));
    frames.moved(accelerations, next_handles.iter().copied(), next);
    let surroundings = frames.graph.surroundings();
    let is_strained = surroundings
        .is_some_and(|around| around.keep_apart(frames.current, next, frames.graph.handle_mask()));
    require_finite(next).map(|()| is_strained)
}

/// Adds to `previous` and `current` the gradient of the last two frames for the gradient `by_next`
/// of the next positions, all in the world, `[vertices]`. Handles are held.
pub fn advance_backward(by_next: &[Vec3], previous: &mut [Vec3], current: &mut [Vec3]) {
    for ((q, p), g) in previous.iter_mut().zip(current).zip(by_next) {
        *q -= *g;
        *p += 2.0 * *g;
    }
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
